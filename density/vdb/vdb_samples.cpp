// SPDX-License-Identifier: Apache-2.0
// Values and vectors at points from OpenVDB files.

#include <cmath>
#include <stdexcept>

#include <openvdb/openvdb.h>

#include "core/text.h"
#include "density/openvdb_grids.h"
#include "density/vdb/vdb_archive.h"
#include "density/vdb/vdb_file.h"
#include "density/vdb/vdb_sandbox.h"

namespace nephos {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

bool fits(const openvdb::GridBase& grid, int parts) {
    if (parts == 1) return grid.isType<openvdb::FloatGrid>() || grid.isType<openvdb::DoubleGrid>();
    return grid.isType<openvdb::Vec3SGrid>() || grid.isType<openvdb::Vec3DGrid>();
}

std::size_t chosen_grid(const VdbArchive& archive, const std::string& name, int parts) {
    const auto& entries = archive.entries();
    std::size_t found = entries.size(), count = 0;
    for (std::size_t n = 0; n < entries.size(); ++n) {
        const std::string grid = entries[n].descriptor.gridName();
        if (!fits(*entries[n].header, parts) || (!name.empty() && grid != name)) continue;
        if (++count == 1) found = n;
    }
    if (count == 1) return found;
    const std::string kind = parts == 1 ? "float grid" : "vec3s grid";
    throw std::runtime_error((count > 1      ? "there are several " + kind + "s in it: name one of"
                              : name.empty() ? "there is no " + kind + " in it; it has"
                                             : "there is no " + kind + " `" + name + "` in it; it has") +
                             std::string(" ") + archive.names());
}

// The grid's points along the world's axes, in their order.
struct Points {
    openvdb::Vec3d first, spacing;
};

// Throws where an axis is not that of the world, to a hundredth of a voxel at the far side of the box.
Points points_of(const openvdb::GridBase& grid, const CoordBBox& box) {
    const openvdb::math::Transform& transform = grid.transform();
    const openvdb::Vec3d zero = transform.indexToWorld(openvdb::Vec3d(0.0));
    Points points{transform.indexToWorld(box.min().asVec3d()), {}};
    bool along = transform.isLinear();
    openvdb::Vec3d beside(0.0);  // how far the far side lies beside its place
    for (int axis = 0; along && axis < 3; ++axis) {
        openvdb::Vec3d step(0.0);
        step[axis] = 1;
        const openvdb::Vec3d to = transform.indexToWorld(step) - zero;
        points.spacing[axis] = to[axis];
        along = std::isfinite(to.length()) && to[axis] > 0;
        for (int other = 0; other < 3; ++other)
            if (other != axis)
                beside[other] += std::abs(to[other]) * (double(box.max()[axis]) - box.min()[axis] + 1);
    }
    for (int axis = 0; axis < 3; ++axis) along = along && beside[axis] <= 0.01 * points.spacing[axis];
    if (!along)
        throw std::runtime_error("its axes are turned, mirrored or not straight; expected voxels along east, north and up");
    return points;
}

// Returns a component at a voxel's centre of a staggered grid, whose components lie on the voxels' low faces along their axes; the last
// voxel of a row has that face alone.
template <class Accessor>
double mean_of_faces(const Accessor& accessor, const Coord& at, const CoordBBox& box, int axis) {
    Coord next = at;
    if (at[axis] < box.max()[axis]) ++next[axis];
    return 0.5 * (double(accessor.getValue(at)[axis]) + double(accessor.getValue(next)[axis]));
}

template <class Grid>
void send_values(const openvdb::GridBase& base, const CoordBBox& box, int parts, SandboxWriter& writer) {
    const auto& grid = static_cast<const Grid&>(base);
    const auto accessor = grid.getConstUnsafeAccessor();
    const bool is_staggered = grid.getGridClass() == openvdb::GRID_STAGGERED;
    for (int k = box.min().z(); k <= box.max().z(); ++k) {
        for (int j = box.min().y(); j <= box.max().y(); ++j) {
            for (int i = box.min().x(); i <= box.max().x(); ++i) {
                const auto value = accessor.getValue({i, j, k});
                for (int part = 0; part < parts; ++part) {
                    float number = 0;
                    if constexpr (openvdb::VecTraits<typename Grid::ValueType>::IsVec)
                        number =
                            float(is_staggered ? mean_of_faces(accessor, {i, j, k}, box, part) : value[part]);
                    else
                        number = float(value);
                    writer.value(number);
                }
            }
        }
    }
}

void send_samples(VdbArchive& archive, const std::string& name, int parts, std::size_t memory_bytes,
                  SandboxWriter& writer) {
    const auto grid = archive.read(chosen_grid(archive, name, parts));
    const CoordBBox box = grid->evalActiveVoxelBoundingBox();
    if (box.empty()) throw std::runtime_error("grid `" + grid->getName() + "` has no active voxel");
    const Points points = points_of(*grid, box);
    double bytes = double(parts) * sizeof(float);
    for (int axis = 0; axis < 3; ++axis) {
        const double size = double(box.max()[axis]) - box.min()[axis] + 1;
        if (size > kMaxExtent) throw std::runtime_error("its bounds of " + number_text(size, 9) + " voxels on an axis are too large");
        bytes *= size;
    }
    if (bytes > double(memory_bytes))
        throw std::runtime_error("its box of " + bytes_text(std::uint64_t(bytes)) + " does not fit into the memory that is allowed");
    for (int axis = 0; axis < 3; ++axis) {
        writer.value(points.first[axis]);
        writer.value(points.spacing[axis]);
        writer.value(std::int32_t(box.max()[axis] - box.min()[axis] + 1));
    }
    if (grid->isType<openvdb::FloatGrid>())
        send_values<openvdb::FloatGrid>(*grid, box, parts, writer);
    else if (grid->isType<openvdb::DoubleGrid>())
        send_values<openvdb::DoubleGrid>(*grid, box, parts, writer);
    else if (grid->isType<openvdb::Vec3SGrid>())
        send_values<openvdb::Vec3SGrid>(*grid, box, parts, writer);
    else
        send_values<openvdb::Vec3DGrid>(*grid, box, parts, writer);
}

SampleGrid receive_samples(int parts, std::size_t memory_bytes, SandboxReader& reader) {
    SampleGrid samples;
    samples.parts = parts;
    double count = parts;
    for (int axis = 0; axis < 3; ++axis) {
        samples.first_m[axis] = reader.value<double>();
        samples.spacing_m[axis] = reader.value<double>();
        const auto points = reader.value<std::int32_t>();
        if (!std::isfinite(samples.first_m[axis]) || !(samples.spacing_m[axis] > 0) ||
            !std::isfinite(samples.spacing_m[axis]) || points < 1 || points > kMaxExtent)
            throw std::runtime_error("the reading process sent impossible points");
        samples.points[std::size_t(axis)] = points;
        count *= points;
    }
    if (count * sizeof(float) > double(memory_bytes)) throw std::runtime_error("the reading process sent too many points");
    samples.values.resize(std::size_t(count));
    reader.bytes(samples.values.data(), samples.values.size() * sizeof(float));
    for (const float value : samples.values)
        if (!std::isfinite(value)) throw std::runtime_error("it has a value that is not a finite number");
    return samples;
}

}  // namespace

SampleGrid read_samples(const std::filesystem::path& path, const std::string& grid, int parts,
                        const VdbReadLimits& limits) {
    SampleGrid samples;
    const std::size_t memory_bytes = memory_limit(limits);
    in_sandbox(
        path, limits,
        [&](VdbArchive& archive, SandboxWriter& writer) { send_samples(archive, grid, parts, memory_bytes, writer); },
        [&](SandboxReader& reader) { samples = receive_samples(parts, memory_bytes, reader); });
    return samples;
}

}  // namespace nephos
