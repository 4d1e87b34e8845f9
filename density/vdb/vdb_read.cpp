// SPDX-License-Identifier: Apache-2.0
// Densities and masks from OpenVDB files.

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <stdexcept>

#include <openvdb/openvdb.h>

#include "core/error.h"
#include "core/text.h"
#include "density/metaballs.h"
#include "density/openvdb_access.h"
#include "density/vdb/block_stream.h"
#include "density/vdb/mask_file.h"
#include "density/vdb/serial_tree.h"
#include "density/vdb/vdb_archive.h"
#include "density/vdb/vdb_file.h"
#include "density/vdb/vdb_foreign.h"
#include "density/vdb/vdb_info.h"
#include "density/vdb/vdb_metadata.h"
#include "density/vdb/vdb_sandbox.h"

namespace nephos {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;

template <class Grid>
bool is(const openvdb::GridBase& grid) {
    return grid.isType<Grid>();
}

bool is_fog(const openvdb::GridBase& grid) {
    return (is<FloatGrid>(grid) || is<openvdb::DoubleGrid>(grid)) &&
           grid.getGridClass() != openvdb::GRID_LEVEL_SET;
}

bool is_mask(const openvdb::GridBase& grid) { return is<BoolGrid>(grid) || is<openvdb::MaskGrid>(grid); }

std::size_t choose_grid(const VdbArchive& archive, const std::string& requested, bool masks) {
    const auto& entries = archive.entries();
    const auto find = [&](const auto& matches) {
        return std::size_t(std::ranges::find_if(entries, matches) - entries.begin());
    };
    if (masks) {
        const std::string mask = requested.empty() ? "cld" : requested;
        const std::size_t n =
            find([&](const auto& e) { return e.descriptor.gridName() == mask && is_mask(*e.header); });
        if (n < entries.size()) return n;
    }
    const std::string name = requested.empty() ? "density" : requested;
    std::size_t n = find([&](const auto& e) { return e.descriptor.gridName() == name && is_fog(*e.header); });
    if (n < entries.size()) return n;
    if (!requested.empty()) {
        n = find([&](const auto& e) { return e.descriptor.gridName() == name; });
        throw std::runtime_error(n < entries.size()
                                     ? "grid `" + name + "` is not a float fog volume"
                                     : "there is no grid `" + name + "`; it has " + archive.names());
    }
    n = find([](const auto& e) { return is_fog(*e.header); });
    if (n == entries.size() && masks) n = find([](const auto& e) { return is_mask(*e.header); });
    if (n == entries.size())
        throw std::runtime_error("there is no float fog volume in it; it has " + archive.names());
    return n;
}

// Bounds and counts that the file states must be bearable before any voxel is read.
void check_stated_size(const openvdb::GridBase& header, std::size_t memory_bytes) {
    const auto low = meta_value<openvdb::Vec3i>(header, openvdb::GridBase::META_FILE_BBOX_MIN);
    const auto high = meta_value<openvdb::Vec3i>(header, openvdb::GridBase::META_FILE_BBOX_MAX);
    for (int a = 0; low && high && a < 3; ++a) {
        const std::int64_t size = std::int64_t{(*high)[a]} - (*low)[a] + 1;
        if (size > std::int64_t{kMaxExtent} * kMaxRefine) {
            throw std::runtime_error("its bounds of " + std::to_string(size) +
                                     " voxels on an axis are too large");
        }
    }
    const auto voxels = meta_value<std::int64_t>(header, openvdb::GridBase::META_FILE_VOXEL_COUNT);
    if (voxels && *voxels > std::int64_t(memory_bytes / sizeof(float))) {
        throw std::runtime_error("cannot read: its " + std::to_string(*voxels) +
                                 " voxels do not fit into the memory that is allowed");
    }
}

FloatGrid::Ptr float_grid(const openvdb::GridBase& grid, const FloatTree::Ptr& tree) {
    auto result = freed_serially(FloatGrid::create(tree));
    result->setTransform(grid.transform().copy());
    return result;
}

// 1 where a voxel of a mask is active, and true where it has a value.
template <typename Grid>
FloatGrid::Ptr mask_as_float(const Grid& mask, double threshold) {
    const bool is_any = threshold < 1;  // the value of what is set is 1
    return float_grid(mask, float_tree(mask.tree(), 0.0f, [&](bool value, bool is_active) {
                          const bool is_set =
                              is_any && is_active && (value || kIsActivityAlone<typename Grid::TreeType>);
                          return FloatVoxel{is_set ? 1.0f : 0.0f, is_active};
                      }));
}

// Tells whether a voxel is cloud. Throws where it is no number.
bool is_above(double value, bool is_active, double threshold) {
    if (is_active && !std::isfinite(value))
        throw std::runtime_error("it has a density that is not a finite number");
    return is_active && value > threshold;
}

// Makes 1 of active values above the threshold, and 0 of all others, in place.
FloatGrid::Ptr marked_above(const FloatGrid::Ptr& grid, double threshold) {
    FloatTree& tree = grid->tree();
    auto tile = tree.beginValueAll();
    tile.setMaxDepth(FloatTree::ValueAllIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) tile.setValue(is_above(double(*tile), tile.isValueOn(), threshold) ? 1.0f : 0.0f);
    for (auto leaf = tree.beginLeaf(); leaf; ++leaf)
        for (openvdb::Index n = 0; n < FloatLeaf::SIZE; ++n)
            leaf->setValueOnly(
                n, is_above(double(leaf->getValue(n)), leaf->isValueOn(n), threshold) ? 1.0f : 0.0f);
    return grid;
}

FloatGrid::Ptr marked_above(const openvdb::DoubleGrid& grid, double threshold) {
    return float_grid(grid,
                      float_tree(grid.tree(), float(grid.background()), [&](double value, bool is_active) {
                          return FloatVoxel{is_above(value, is_active, threshold) ? 1.0f : 0.0f, is_active};
                      }));
}

FloatGrid::Ptr as_float(const openvdb::GridBase::Ptr& grid, std::optional<double> threshold) {
    if (threshold && *threshold >= 0) {
        if (const auto typed = openvdb::gridPtrCast<FloatGrid>(grid)) return marked_above(typed, *threshold);
        if (const auto typed = openvdb::gridPtrCast<openvdb::DoubleGrid>(grid))
            return marked_above(*typed, *threshold);
    }
    if (const auto typed = openvdb::gridPtrCast<FloatGrid>(grid)) return typed;
    if (const auto mask = openvdb::gridPtrCast<BoolGrid>(grid))
        return mask_as_float(*mask, threshold.value_or(0));
    if (const auto mask = openvdb::gridPtrCast<openvdb::MaskGrid>(grid))
        return mask_as_float(*mask, threshold.value_or(0));
    const auto typed = openvdb::gridPtrCast<openvdb::DoubleGrid>(grid);
    if (!typed) throw std::runtime_error("it is damaged: a grid changed its type");
    return float_grid(*typed,
                      float_tree(typed->tree(), float(typed->background()), [](double value, bool is_active) {
                          return FloatVoxel{float(value), is_active};
                      }));
}

// Returns nephos_bbox where present and valid for all voxels, else the bounds of the active voxels.
CoordBBox bounds_of(const FloatGrid& grid, const openvdb::GridBase& header) {
    CoordBBox active;
    const bool any = grid.tree().evalActiveVoxelBoundingBox(active);
    const auto low = meta_value<openvdb::Vec3i>(header, kMetaBoxMin);
    const auto high = meta_value<openvdb::Vec3i>(header, kMetaBoxMax);
    if (low && high) {
        const CoordBBox stated(Coord((*low)[0], (*low)[1], (*low)[2]),
                               Coord((*high)[0], (*high)[1], (*high)[2]));
        if (!stated.empty() && (!any || stated.isInside(active))) return stated;
    }
    return any ? active : CoordBBox(Coord(0), Coord(0));
}

bool has_y_up(const openvdb::GridBase& header, const openvdb::MetaMap& file, UpAxis requested) {
    if (requested != UpAxis::automatic) return requested == UpAxis::y;
    auto stated = meta_value<std::string>(header, kMetaUpAxis);
    if (!stated) stated = meta_value<std::string>(file, kMetaUpAxis);
    return stated == "y";
}

void send_metadata(SandboxWriter& writer, const std::optional<VdbMetadata>& metadata) {
    writer.value(std::uint8_t(metadata.has_value()));
    if (!metadata) return;
    writer.value(metadata->extinction_per_m);
    writer.value(metadata->time_s);
    writer.value(metadata->time_step_s);
    writer.value(metadata->frames_per_second);
    writer.value(metadata->time_scale);
    writer.value(metadata->seed);
    writer.value(metadata->random_stream_version);
    for (const std::string* text :
         {&metadata->scene_hash, &metadata->state_hash, &metadata->nephos_version}) {
        writer.text(clamp_text(*text, kMaxMetadataText));
    }
    const Georeference& place = metadata->georeference;
    writer.value(std::uint8_t(place.given));
    for (const double number :
         {place.latitude_deg, place.longitude_deg, place.height_m, place.geoid_height_m, place.heading_deg})
        writer.value(number);
    writer.value(std::uint8_t(place.height_datum == HeightDatum::ellipsoid));
    writer.text(place.start_utc);
    writer.value(metadata->period_m);
    writer.value(std::uint32_t(metadata->wind.size()));
    for (const WindLevel& level : metadata->wind) writer.value(level);
}

// Numbers of a file's metadata come as they are in it: NaN where it is damaged.
void check_finite(const VdbMetadata& metadata) {
    const auto check = [](std::initializer_list<double> numbers) {
        for (const double number : numbers)
            if (!std::isfinite(number))
                throw std::runtime_error("it is damaged: its metadata has a number that is not finite");
    };
    check({metadata.extinction_per_m, metadata.time_s, metadata.time_step_s, metadata.frames_per_second,
           metadata.time_scale});
    const Georeference& place = metadata.georeference;
    check({place.latitude_deg, place.longitude_deg, place.height_m, place.geoid_height_m, place.heading_deg});
    check({metadata.period_m.x, metadata.period_m.y, metadata.period_m.z});
    for (const WindLevel& level : metadata.wind)
        check({level.height_m, level.velocity.east_m_per_s, level.velocity.north_m_per_s});
}

std::optional<VdbMetadata> receive_metadata(SandboxReader& reader) {
    if (reader.value<std::uint8_t>() == 0) return std::nullopt;
    VdbMetadata metadata;
    metadata.extinction_per_m = reader.value<double>();
    metadata.time_s = reader.value<double>();
    metadata.time_step_s = reader.value<double>();
    metadata.frames_per_second = reader.value<double>();
    metadata.time_scale = reader.value<double>();
    metadata.seed = reader.value<std::uint64_t>();
    metadata.random_stream_version = reader.value<int>();
    for (std::string* text : {&metadata.scene_hash, &metadata.state_hash, &metadata.nephos_version})
        *text = reader.text();
    Georeference& place = metadata.georeference;
    place.given = reader.value<std::uint8_t>() != 0;
    for (double* number : {&place.latitude_deg, &place.longitude_deg, &place.height_m, &place.geoid_height_m,
                           &place.heading_deg})
        *number = reader.value<double>();
    place.height_datum = reader.value<std::uint8_t>() != 0 ? HeightDatum::ellipsoid : HeightDatum::msl;
    place.start_utc = reader.text();
    if (!place.start_utc.empty() && !utc_seconds(place.start_utc))
        throw std::runtime_error("the reading process sent an impossible moment");
    metadata.period_m = reader.value<Vec3>();
    for (auto left = reader.value<std::uint32_t>(); left > 0; --left)
        metadata.wind.push_back(reader.value<WindLevel>());
    check_finite(metadata);
    return metadata;
}

// The child's part: sends header, geometry, blocks and counts.
void send_density(VdbArchive& archive, const VdbReadOptions& options, std::optional<double> threshold,
                  std::size_t memory_bytes, SandboxWriter& writer) {
    const bool masks = threshold.has_value();
    const std::size_t n = choose_grid(archive, options.grid, masks);
    const openvdb::GridBase& header = *archive.entries()[n].header;
    check_stated_size(header, memory_bytes);
    const auto grid = as_float(archive.read(n), threshold);
    if (grid->background() != 0.0f) {
        throw std::runtime_error("its background is " + number_text(grid->background(), 6) +
                                 ", not 0: it is no fog volume");
    }
    if (count_active(grid->tree()) > memory_bytes / sizeof(float)) throw std::bad_alloc();
    if (options.list_grids) send_info(archive, writer);
    writer.text(archive.entries()[n].descriptor.gridName());
    auto metadata = from_meta_map(header);
    send_metadata(writer, metadata ? metadata : from_meta_map(archive.metadata()));
    writer.value(refine_of(header));

    DensityReceiver receiver;
    receiver.begin = [&](const Extent& extent, const Placement& placement) {
        writer.value(extent);
        writer.value(placement);
    };
    receiver.leaf = [&](const Coord& origin, const float* values) { send_leaf(writer, origin, values); };
    receiver.tile = [&](const Coord& origin, float value) { send_tile(writer, origin, value); };
    const bool y_up = has_y_up(header, archive.metadata(), options.up_axis);
    const ForeignGrid foreign{
        grid.get(), bounds_of(*grid, header), y_up, options.metres_per_unit, memory_bytes, masks};
    const ForeignResult result = convert_foreign(foreign, receiver);
    send_end(writer);
    writer.value(std::uint8_t(result.resampled));
    writer.value(result.negative);
    writer.value(result.level_height_m);
}

// The parent's part: builds the grid from the child's stream.
LoadedDensity receive_density(SandboxReader& reader, bool list_grids) {
    LoadedDensity loaded;
    if (list_grids) loaded.info = receive_info(reader);
    loaded.grid_name = clamp_text(reader.text(), kMaxMetadataText);
    loaded.metadata = receive_metadata(reader);
    loaded.refine = std::clamp(reader.value<int>(), 1, kMaxRefine);
    const auto extent = reader.value<Extent>();
    const auto placement = reader.value<Placement>();
    constexpr int kMost = kMaxExtent * kMaxRefine;
    const bool possible =
        std::min({extent.x, extent.y, extent.z}) >= 1 && std::max({extent.x, extent.y, extent.z}) <= kMost;
    const Vec3 origin_m = placement.origin_m;
    if (!possible || !(placement.cell_size_m > 0) ||
        !std::isfinite(origin_m.x + origin_m.y + origin_m.z + placement.cell_size_m))
        throw std::runtime_error("the reading process sent an impossible size");
    loaded.density = receive_blocks(reader, extent, placement);
    ForeignResult result;
    result.resampled = reader.value<std::uint8_t>() != 0;
    result.negative = reader.value<std::uint64_t>();
    loaded.level_height_m = reader.value<double>();
    if (!(loaded.level_height_m > 0) || !std::isfinite(loaded.level_height_m))
        throw std::runtime_error("the reading process sent an impossible size");
    if (result.resampled) {
        loaded.notes.push_back("its voxels are not cubes along the axes: resampled to voxels of " +
                               number_text(placement.cell_size_m, 6) + " m");
    }
    loaded.negative = result.negative;
    if (result.negative > 0) {
        loaded.notes.push_back(std::to_string(result.negative) + " values below 0 were set to 0");
    }
    return loaded;
}

void check_options(const VdbReadOptions& options) {
    if (options.metres_per_unit > 0 && std::isfinite(options.metres_per_unit)) return;
    throw Error(ErrorCode::usage,
                number_text(options.metres_per_unit, 6) + " metres per unit: must be above 0");
}

// With a threshold: a mask.
LoadedDensity load(const std::filesystem::path& path, const VdbReadOptions& options,
                   std::optional<double> threshold) {
    check_options(options);
    LoadedDensity loaded;
    const std::size_t memory_bytes = memory_limit(options.limits);  // here: the child cannot ask the system
    in_sandbox(
        path, options.limits,
        [&](VdbArchive& archive, SandboxWriter& writer) {
            send_density(archive, options, threshold, memory_bytes, writer);
        },
        [&](SandboxReader& reader) { loaded = receive_density(reader, options.list_grids); });
    return loaded;
}

}  // namespace

LoadedDensity load_density(const std::filesystem::path& path, const VdbReadOptions& options) {
    return load(path, options, std::nullopt);
}

LoadedDensity load_mask(const std::filesystem::path& path, double threshold, const VdbReadOptions& options) {
    return load(path, options, threshold);
}

void load_densities(std::span<const std::filesystem::path> paths, const VdbReadOptions& options,
                    const std::function<bool(std::size_t, LoadedDensity&&)>& each) {
    check_options(options);
    struct Stopped {};
    const std::size_t memory_bytes = memory_limit(options.limits);
    try {
        for (std::size_t first = 0; first < paths.size(); first += kMostFilesOfAChild) {
            in_sandbox(
                paths.subspan(first, std::min(kMostFilesOfAChild, paths.size() - first)), options.limits,
                [&](VdbArchive& archive, SandboxWriter& writer) {
                    send_density(archive, options, std::nullopt, memory_bytes, writer);
                },
                [&](SandboxReader& reader, std::size_t n) {
                    if (!each(first + n, receive_density(reader, options.list_grids))) throw Stopped();
                });
        }
    } catch (const Stopped&) {
    }
}

DensityGrid read_density(const std::filesystem::path& path, const VdbReadOptions& options) {
    return load_density(path, options).density;
}

}  // namespace nephos
