// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ostream>
#include <string>

#include <openvdb/io/Archive.h>
#include <openvdb/openvdb.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "density/openvdb_access.h"
#include "density/vdb/vdb_file.h"
#include "density/vdb/vdb_metadata.h"
#include "density/vdb/vdb_output.h"

namespace nephos {
namespace {

using BoolLeaf = BoolTree::LeafNodeType;
using VectorLeaf = VectorTree::LeafNodeType;
using Mask = openvdb::util::NodeMask<3>;

// io::File::write leaves its stream's errors unseen, so that a full disk passes for success. This archive
// writes to a stream of the caller's, who has exceptions switched on.
class CheckedArchive : public openvdb::io::Archive {
  public:
    void save(std::ostream& stream, const openvdb::GridCPtrVec& grids,
              const openvdb::MetaMap& metadata) const {
        Archive::write(stream, grids, true, metadata);
    }
};

// Geometry of a grid: all of a file share it, but for that of the wind over large boxes.
struct GridGeometry {
    Extent voxels;
    int refine = 1;       // voxels per cell and axis, as coarser_refine() counts them
    Placement placement;  // of the voxels
    double shift_voxels = 0;  // added to the places that are written, along each axis, in voxels of this grid
    int coarsening = 1;       // edge of a voxel here, in voxels of density
};

void check_plane(const std::optional<BitPlaneView>& plane, std::optional<Extent>& cells) {
    if (!plane) return;
    if (cells && !(*cells == plane->extent))
        throw Error(ErrorCode::usage, "the planes for a VDB file differ in extent");
    cells = plane->extent;
}

// Voxels per cell, from the density grid's extent over the planes'.
int refinement(Extent voxels, Extent cells) {
    const int refine = std::max(1, voxels.x / std::max(1, cells.x));
    if (voxels.x != cells.x * refine || voxels.y != cells.y * refine || voxels.z != cells.z * refine) {
        throw Error(ErrorCode::usage, "a VDB file's density and planes do not cover the same box");
    }
    return refine;
}

openvdb::math::Transform::Ptr transform_of(const GridGeometry& geometry) {
    const double size = geometry.placement.cell_size_m, centre = size * (0.5 + geometry.shift_voxels);
    const Vec3 o = geometry.placement.origin_m;
    const auto transform = openvdb::math::Transform::createLinearTransform(size);
    transform->postTranslate({o.x + centre, o.y + centre, o.z + centre});
    return transform;
}

GridGeometry geometry_of(const VdbContent& content) {
    std::optional<Extent> cells;
    check_plane(content.hum, cells);
    check_plane(content.act, cells);
    check_plane(content.cld, cells);
    if (!content.density && !cells) throw Error(ErrorCode::usage, "nothing to write into a VDB file");
    if (!content.wind.empty() && !content.density)
        throw Error(ErrorCode::usage, "the wind in a VDB file needs a density grid");
    GridGeometry geometry;
    geometry.voxels = content.density ? content.density->extent() : *cells;
    if (geometry.voxels.cells() == 0) throw Error(ErrorCode::usage, "a VDB file needs at least one voxel");
    geometry.placement = content.density ? content.density->placement() : content.cells;
    if (content.density && cells) {
        geometry.refine = refinement(geometry.voxels, *cells);
        const double edge = geometry.placement.cell_size_m * geometry.refine;
        if (!(content.cells.origin_m == geometry.placement.origin_m) ||
            std::abs(edge - content.cells.cell_size_m) > 1e-9 * content.cells.cell_size_m) {
            throw Error(ErrorCode::usage, "a VDB file's density and planes lie at different places");
        }
    } else if (content.density && content.cells.cell_size_m > 0) {
        const double ratio = content.cells.cell_size_m / geometry.placement.cell_size_m;
        if (ratio >= 1 && std::abs(ratio - std::round(ratio)) < 1e-9)
            geometry.refine = int(std::round(ratio));
    }
    if (content.half_voxel_shift) geometry.shift_voxels = -0.5;
    return geometry;
}

void describe(openvdb::GridBase& grid, const char* name, const GridGeometry& geometry,
              const openvdb::MetaMap& metadata) {
    grid.setName(name);
    grid.setTransform(transform_of(geometry));
    grid.setIsInWorldSpace(false);
    for (auto entry = metadata.beginMeta(); entry != metadata.endMeta(); ++entry) {
        grid.insertMeta(entry->first, *entry->second);
    }
    insert_box(grid, geometry.voxels, geometry.refine);
}

// Transposes an 8x8 matrix of bits: bit n of byte m becomes bit m of byte n.
std::uint64_t transpose_bits(std::uint64_t m) {
    const auto swap = [&m](std::uint64_t mask, int shift) {
        const std::uint64_t t = (m ^ m >> shift) & mask;
        m ^= t ^ t << shift;
    };
    swap(0x00AA00AA00AA00AA, 7);
    swap(0x0000CCCC0000CCCC, 14);
    swap(0x00000000F0F0F0F0, 28);
    return m;
}

// Returns the 512 bits of the block at cell (x, y, z), x a multiple of 8, in OpenVDB's order.
Mask block_bits(const BitPlaneView& plane, int x, int y, int z) {
    std::uint8_t bytes[8][8] = {};  // [y][z], bit n = cell x + n
    for (int dz = 0; dz < std::min(kBlock, plane.extent.z - z); ++dz) {
        for (int dy = 0; dy < std::min(kBlock, plane.extent.y - y); ++dy) {
            bytes[dy][dz] = std::uint8_t(plane.row(y + dy, z + dz)[x / 64] >> (x % 64));
        }
    }
    std::uint64_t words[8] = {};  // word x, bit y << 3 | z
    for (int dy = 0; dy < 8; ++dy) {
        std::uint64_t matrix;
        std::memcpy(&matrix, bytes[dy], 8);
        matrix = transpose_bits(matrix);  // byte x, bit z
        for (int dx = 0; dx < 8; ++dx) words[dx] |= (matrix >> (8 * dx) & 0xFF) << (8 * dy);
    }
    Mask mask;
    for (openvdb::Index n = 0; n < 8; ++n) mask.getWord<std::uint64_t>(n) = words[n];
    return mask;
}

// Returns the 512 bits of a block of voxels where one cell is refine^3 voxels.
Mask refined_block_bits(const BitPlaneView& plane, int refine, int x, int y, int z) {
    Mask mask;
    for (int n = 0; n < kBlockVoxels; ++n) {
        const int i = (x + (n >> 6)) / refine, j = (y + (n >> 3 & 7)) / refine, k = (z + (n & 7)) / refine;
        const bool inside = i < plane.extent.x && j < plane.extent.y && k < plane.extent.z;
        if (inside && plane.get(i, j, k)) mask.setOn(openvdb::Index(n));
    }
    return mask;
}

BoolGrid::Ptr bool_grid(const BitPlaneView& plane, const GridGeometry& geometry) {
    auto grid = BoolGrid::create(false);
    openvdb::tree::ValueAccessor<BoolTree> accessor(grid->tree());
    for (int z = 0; z < geometry.voxels.z; z += kBlock) {
        for (int y = 0; y < geometry.voxels.y; y += kBlock) {
            for (int x = 0; x < geometry.voxels.x; x += kBlock) {
                const Mask mask = geometry.refine == 1 ? block_bits(plane, x, y, z)
                                                       : refined_block_bits(plane, geometry.refine, x, y, z);
                if (mask.isOff()) continue;
                if (mask.isOn()) {
                    accessor.addTile(1, {x, y, z}, true, true);
                    continue;
                }
                auto leaf = std::make_unique<BoolLeaf>(openvdb::Coord(x, y, z), false, false);
                leaf->setValueMask(mask);
                for (openvdb::Index n = 0; n < 8; ++n)
                    leaf->buffer().data()[n] = mask.getWord<std::uint64_t>(n);
                accessor.addLeaf(leaf.release());
            }
        }
    }
    return grid;
}

// Voxels of the wind over those of a density.
GridGeometry geometry_of_wind(const GridGeometry& density) {
    const int edge = velocity_voxel(density.voxels);
    if (edge == 1) return density;
    GridGeometry wind = density;
    const auto fewer = [&](int n) { return (n + edge - 1) / edge; };
    wind.voxels = {fewer(density.voxels.x), fewer(density.voxels.y), fewer(density.voxels.z)};
    wind.placement.cell_size_m *= edge;
    wind.coarsening = edge;
    wind.refine = coarser_refine(density.refine, edge);
    return wind;
}

// The velocities at the middle of the levels of the wind: of larger voxels between two levels of the density, of those that reach beyond
// the box in the middle of what lies in it.
std::vector<openvdb::Vec3s> profile_of(const std::vector<Velocity>& levels, int edge, int count) {
    std::vector<openvdb::Vec3s> profile;
    for (int n = 0; n < count; ++n) {
        const std::size_t first = std::size_t(n * edge),
                          last = std::min(first + std::size_t(edge), levels.size()) - 1;
        const Velocity &a = levels[(first + last) / 2], &b = levels[(first + last + 1) / 2];
        profile.emplace_back(float((a.east_m_per_s + b.east_m_per_s) / 2),
                             float((a.north_m_per_s + b.north_m_per_s) / 2), 0.0f);
    }
    return profile;
}

// The wind at each voxel's centre of the whole box: it blows where no cloud is, too; the profile of voxels that reach beyond the box in
// the middle of what lies in it. Blocks of one velocity are tiles.
VectorGrid::Ptr velocity_grid(const VdbContent& content, const GridGeometry& density,
                              const GridGeometry& geometry) {
    if (content.wind.size() != std::size_t(density.voxels.z))
        throw Error(ErrorCode::usage, "a VDB file needs one velocity of the wind a level of voxels");
    const std::vector<openvdb::Vec3s> profile =
        profile_of(content.wind, geometry.coarsening, geometry.voxels.z);
    auto grid = VectorGrid::create(openvdb::Vec3s(0.0f));
    grid->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
    openvdb::tree::ValueAccessor<VectorTree> accessor(grid->tree());
    constexpr int kEdge = 8;
    const auto is_uniform = [&](const openvdb::Coord& origin) {
        const bool is_inside = origin.x() + kEdge <= geometry.voxels.x &&
                               origin.y() + kEdge <= geometry.voxels.y &&
                               origin.z() + kEdge <= geometry.voxels.z;
        if (content.wind_field || !is_inside) return false;
        const auto first = profile.begin() + origin.z();
        return std::all_of(first, first + kEdge, [&](const openvdb::Vec3s& v) { return v == *first; });
    };
    const auto add_block = [&](const openvdb::Coord& origin) {
        if (is_uniform(origin)) return accessor.addTile(1, origin, profile[std::size_t(origin.z())], true);
        auto leaf = std::make_unique<VectorLeaf>(origin);
        for (int n = 0; n < kBlockVoxels; ++n) {
            const openvdb::Coord voxel = origin + openvdb::Coord(n >> 6, n >> 3 & 7, n & 7);
            if (voxel.x() >= geometry.voxels.x || voxel.y() >= geometry.voxels.y ||
                voxel.z() >= geometry.voxels.z)
                continue;
            openvdb::Vec3s velocity = profile[std::size_t(voxel.z())];
            if (content.wind_field) {
                const Placement& at = geometry.placement;
                const Vec3 more = content.wind_field(
                    at.origin_m + at.cell_size_m * (Vec3(voxel.x(), voxel.y(), voxel.z()) + 0.5));
                velocity += openvdb::Vec3s(openvdb::Vec3d(more.x, more.y, more.z));
            }
            leaf->setValueOn(openvdb::Index(n), velocity);
        }
        accessor.addLeaf(leaf.release());
    };
    for (int x = 0; x < geometry.voxels.x; x += kEdge)
        for (int y = 0; y < geometry.voxels.y; y += kEdge)
            for (int z = 0; z < geometry.voxels.z; z += kEdge) add_block({x, y, z});
    return grid;
}

openvdb::GridCPtrVec make_grids(const VdbContent& content, const GridGeometry& geometry,
                                const openvdb::MetaMap& metadata) {
    openvdb::GridCPtrVec grids;
    if (content.density) {
        // A new grid around the same tree: its own metadata, no copy of the voxels.
        const auto tree = OpenvdbAccess::grid(*content.density).treePtr();
        const auto grid = FloatGrid::create(openvdb::ConstPtrCast<FloatTree>(tree));
        grid->setGridClass(openvdb::GRID_FOG_VOLUME);
        grid->setSaveFloatAsHalf(content.half);
        describe(*grid, "density", geometry, metadata);
        grids.push_back(grid);
    }
    const std::pair<const char*, const std::optional<BitPlaneView>*> planes[] = {
        {"hum", &content.hum}, {"act", &content.act}, {"cld", &content.cld}};
    for (const auto& [name, plane] : planes) {
        if (!*plane) continue;
        const auto grid = bool_grid(**plane, geometry);
        describe(*grid, name, geometry, metadata);
        grids.push_back(grid);
    }
    if (!content.wind.empty()) {
        const GridGeometry of_wind = geometry_of_wind(geometry);
        const auto grid = velocity_grid(content, geometry, of_wind);
        describe(*grid, content.wind_name.c_str(), of_wind, metadata);
        grids.push_back(grid);
    }
    return grids;
}

// OpenVDB puts a random UUID into every header. One that follows from the content makes files of the same
// content the same bytes: version 8 of RFC 9562, from two FNV-1a hashes of the metadata, the file's name and
// the voxel counts.
std::string uuid_of(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids,
                    const openvdb::MetaMap& metadata) {
    std::string text = path.filename().string();
    for (auto it = metadata.beginMeta(); it != metadata.endMeta(); ++it)
        text += '\n' + it->first + '=' + it->second->str();
    for (const auto& grid : grids)
        text += '\n' + grid->getName() + ':' + std::to_string(grid->activeVoxelCount());
    std::uint64_t high = 0xCBF29CE484222325u, low = 0x84222325CBF29CE4u;
    for (const char c : text) {
        high = (high ^ std::uint8_t(c)) * 0x100000001B3u;
        low = (low ^ std::uint8_t(~c)) * 0x100000001B3u;
    }
    high = (high & ~std::uint64_t{0xF000}) | 0x8000;                   // version
    low = (low & ~(std::uint64_t{3} << 62)) | std::uint64_t{2} << 62;  // variant
    char uuid[37];
    std::snprintf(uuid, sizeof uuid, "%08x-%04x-%04x-%04x-%012llx", unsigned(high >> 32),
                  unsigned(high >> 16 & 0xFFFF), unsigned(high & 0xFFFF), unsigned(low >> 48),
                  static_cast<unsigned long long>(low & 0xFFFFFFFFFFFFu));
    return uuid;
}

// The UUID's place in a file: behind magic number, versions of file and library, and a flag.
constexpr std::streamoff kUuidOffset = 8 + 3 * 4 + 1;

void write_file(const std::filesystem::path& temporary, const std::filesystem::path& path,
                const openvdb::GridCPtrVec& grids, const openvdb::MetaMap& metadata) {
    VdbOutput file(temporary);
    if (file.error() != 0) file.fail(path);
    try {
        std::ostream stream(&file);
        stream.exceptions(std::ios::badbit | std::ios::failbit);
        CheckedArchive().save(stream, grids, metadata);
        stream.seekp(kUuidOffset);
        stream << uuid_of(path, grids, metadata);
    } catch (const std::ios_base::failure&) {
        file.fail(path);
    } catch (const openvdb::Exception& error) {
        throw Error(ErrorCode::io, path.string() + ": cannot write: " + error.what());
    }
    if (!file.close()) file.fail(path);
}

// Limits a grid of the wind to 2^24 voxels.
constexpr double kMostVelocityBlocks = 32768;

}  // namespace

int velocity_voxel(const Extent& voxels) {
    const auto blocks = [&](int edge) {
        const auto along = [&](int n) { return std::ceil(double(n) / edge / kBlock); };
        return along(voxels.x) * along(voxels.y) * along(voxels.z);
    };
    int edge = 1;
    while (blocks(edge) > kMostVelocityBlocks) edge *= 2;
    return edge;
}

double velocity_bytes(double voxels) {
    constexpr double kBytesPerVelocity = 13;  // three floats, and the masks and nodes above them
    return kBytesPerVelocity * std::min(voxels, kMostVelocityBlocks * kBlockVoxels);
}

void write_vdb(const std::filesystem::path& path, const VdbContent& content, const VdbMetadata& metadata) {
    openvdb::initialize();
    const GridGeometry geometry = geometry_of(content);
    openvdb::MetaMap meta = to_meta_map(metadata);
    insert_box(meta, geometry.voxels, geometry.refine);
    const auto grids = make_grids(content, geometry, meta);
    const PublishCheck check(content.publish_check);
    write_atomically(
        path, [&](const std::filesystem::path& temporary) { write_file(temporary, path, grids, meta); });
}

std::filesystem::path frame_path(const std::filesystem::path& folder, const std::string& name, int frame) {
    char number[16];
    std::snprintf(number, sizeof number, "_%04d.vdb", frame);
    return folder / (name + number);
}

}  // namespace nephos
