// SPDX-License-Identifier: Apache-2.0
// States from OpenVDB files.

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <openvdb/openvdb.h>

#include "core/text.h"
#include "density/metaballs.h"
#include "density/openvdb_access.h"
#include "density/vdb/block_stream.h"
#include "density/vdb/serial_tree.h"
#include "density/vdb/vdb_archive.h"
#include "density/vdb/vdb_file.h"
#include "density/vdb/vdb_metadata.h"
#include "density/vdb/vdb_sandbox.h"

namespace nephos {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

// In the child: the blocks of one bool or mask tree.
template <class Tree>
void send_bits(const Tree& tree, const CoordBBox& allowed, const std::string& name, SandboxWriter& writer) {
    if (tree.background()) throw std::runtime_error("the background of grid `" + name + "` is true");
    CoordBBox active;
    if (tree.evalActiveVoxelBoundingBox(active) && !allowed.isInside(active)) {
        throw std::runtime_error("grid `" + name + "` has voxels outside the " +
                                 std::to_string(allowed.dim().x()) + " x " +
                                 std::to_string(allowed.dim().y()) + " x " +
                                 std::to_string(allowed.dim().z()) + " voxels of the scene");
    }
    const auto send = [&](const Coord& origin, const std::uint64_t(&words)[8]) {
        writer.value(Record::leaf);
        for (int a = 0; a < 3; ++a) writer.value(std::int32_t(origin[a]));
        writer.bytes(words, sizeof words);
    };
    for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
        std::uint64_t words[8] = {};
        for (auto voxel = leaf->cbeginValueOn(); voxel; ++voxel) {
            if (*voxel || kIsActivityAlone<Tree>)
                words[voxel.pos() >> 6] |= std::uint64_t{1} << (voxel.pos() & 63);
        }
        if (std::ranges::any_of(words, [](std::uint64_t word) { return word != 0; }))
            send(leaf->origin(), words);
    }
    std::uint64_t full[8];
    std::fill_n(full, 8, ~std::uint64_t{0});
    auto tile = tree.cbeginValueOn();
    tile.setMaxDepth(Tree::ValueOnCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        if (!*tile && !kIsActivityAlone<Tree>) continue;
        const CoordBBox box = tile.getBoundingBox();
        for (int z = box.min().z(); z <= box.max().z(); z += kBlock) {
            for (int y = box.min().y(); y <= box.max().y(); y += kBlock) {
                for (int x = box.min().x(); x <= box.max().x(); x += kBlock) send({x, y, z}, full);
            }
        }
    }
    send_end(writer);
}

constexpr const char* kStateGrids[] = {"hum", "act", "cld"};

// Checks the extent of a state by nephos_bbox_max. Without it the extent is unknown, and only voxels outside
// of `extent` are errors.
void check_state_extent(const openvdb::GridBase& header, int refine, const Extent& extent) {
    const auto last = meta_value<openvdb::Vec3i>(header, kMetaBoxMax);
    if (!last) return;
    const auto cells = [&](int axis) { return (std::int64_t{(*last)[axis]} + 1) / refine; };
    if (cells(0) == extent.x && cells(1) == extent.y && cells(2) == extent.z) return;
    const auto text = [](std::int64_t x, std::int64_t y, std::int64_t z) {
        return std::to_string(x) + " x " + std::to_string(y) + " x " + std::to_string(z);
    };
    throw std::runtime_error("it holds a state of " + text(cells(0), cells(1), cells(2)) +
                             " cells, but the scene has " + text(extent.x, extent.y, extent.z));
}

std::string point_text(const openvdb::Vec3d& p) {
    return "(" + number_text(p.x(), 9) + ", " + number_text(p.y(), 9) + ", " + number_text(p.z(), 9) + ") m";
}

// Compares where the grid puts the corners of the box of cells with where the scene has them.
void check_state_placement(const openvdb::GridBase& header, const std::string& name, int refine,
                           const Extent& extent, const Placement& placement) {
    const openvdb::math::Transform& transform = header.transform();
    const bool own = meta_value<openvdb::Vec3i>(header, kMetaBoxMax).has_value();
    if (!own && transform.isIdentity()) return;
    const double cell = placement.cell_size_m, tolerance_m = cell / 100;
    const Vec3& origin = placement.origin_m;
    const openvdb::Vec3d size = transform.voxelSize() * refine;
    const double cells[3] = {double(extent.x), double(extent.y), double(extent.z)};
    for (int axis = 0; axis < 3; ++axis) {
        if (std::abs(size[axis] - cell) * cells[axis] <= tolerance_m) continue;
        throw std::runtime_error("grid `" + name + "` has cells of " + number_text(size[axis], 9) +
                                 " m, but the scene's lattice has cells of " + number_text(cell, 9) + " m");
    }
    // An index is a voxel's centre, so the lowest corner of the box has the indices -1/2.
    const auto corner = [&](double x, double y, double z) {
        return transform.indexToWorld(openvdb::Vec3d(x, y, z) * refine - openvdb::Vec3d(0.5));
    };
    const openvdb::Vec3d low = corner(0, 0, 0), expected(origin.x, origin.y, origin.z);
    const auto agree = [&](const openvdb::Vec3d& a, const openvdb::Vec3d& b) {
        return (a - b).length() <= tolerance_m;
    };
    if (!agree(low, expected)) {
        throw std::runtime_error("grid `" + name + "` starts at " + point_text(low) +
                                 ", but the scene's lattice at " + point_text(expected));
    }
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d end(0.0);
        end[axis] = cells[axis];
        const openvdb::Vec3d found = corner(end.x(), end.y(), end.z());
        if (agree(found, expected + end * cell)) continue;
        throw std::runtime_error("the axes of grid `" + name + "` are turned: its corner at " +
                                 point_text(found) + " stands at " + point_text(expected + end * cell) +
                                 " in the scene");
    }
}

void send_state(VdbArchive& archive, Extent extent, const Placement& placement, SandboxWriter& writer) {
    for (const char* name : kStateGrids) {
        const auto& entries = archive.entries();
        const auto entry =
            std::ranges::find_if(entries, [&](const auto& e) { return e.descriptor.gridName() == name; });
        if (entry == entries.end()) {
            throw std::runtime_error(std::string("there is no grid `") + name +
                                     "`; a state needs hum, act and cld; it has " + archive.names());
        }
        const int refine = refine_of(*entry->header);
        check_state_extent(*entry->header, refine, extent);
        check_state_placement(*entry->header, name, refine, extent, placement);
        writer.value(refine);
        const Coord last(extent.x * refine - 1, extent.y * refine - 1, extent.z * refine - 1);
        const auto grid = archive.read(std::size_t(entry - entries.begin()));
        if (const auto bits = openvdb::gridPtrCast<BoolGrid>(grid)) {
            send_bits(bits->tree(), {Coord(0), last}, name, writer);
        } else if (const auto mask = openvdb::gridPtrCast<openvdb::MaskGrid>(grid)) {
            send_bits(mask->tree(), {Coord(0), last}, name, writer);
        } else {
            throw std::runtime_error(std::string("grid `") + name + "` is of type " + grid->valueType() +
                                     ", not bool");
        }
    }
}

void receive_plane(SandboxReader& reader, BitPlane& plane) {
    const Extent extent = plane.extent();
    const int refine = reader.value<int>();
    if (refine < 1 || refine > kMaxRefine)
        throw std::runtime_error("the reading process sent an impossible refinement");
    const Extent voxels{extent.x * refine, extent.y * refine, extent.z * refine};
    while (reader.value<Record>() != Record::end) {
        const Coord origin = receive_origin(reader, voxels);
        std::uint64_t words[8];
        reader.bytes(words, sizeof words);
        for (int n = 0; n < kBlockVoxels; ++n) {
            if ((words[n >> 6] >> (n & 63) & 1) == 0) continue;
            const Coord v = origin + Coord(n >> 6, n >> 3 & 7, n & 7);
            if (v.x() >= voxels.x || v.y() >= voxels.y || v.z() >= voxels.z) {
                throw std::runtime_error("the reading process sent a misplaced voxel");
            }
            if (v.x() % refine == 0 && v.y() % refine == 0 && v.z() % refine == 0) {
                plane.set(v.x() / refine, v.y() / refine, v.z() / refine, true);
            }
        }
    }
}

}  // namespace

Lattice read_state(const std::filesystem::path& path, Extent extent, const Placement& placement,
                   const VdbReadLimits& limits) {
    Lattice lattice;
    in_sandbox(
        path, limits,
        [&](VdbArchive& archive, SandboxWriter& writer) { send_state(archive, extent, placement, writer); },
        [&](SandboxReader& reader) {
            lattice = {BitPlane(extent), BitPlane(extent), BitPlane(extent)};
            for (BitPlane* plane : {&lattice.hum, &lattice.act, &lattice.cld}) receive_plane(reader, *plane);
        });
    return lattice;
}

}  // namespace nephos
