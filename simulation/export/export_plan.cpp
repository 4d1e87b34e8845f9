// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/export_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "core/error.h"
#include "core/text.h"
#include "density/grid_names.h"
#include "scenes/format/text.h"
#include "simulation/export/frame_export.h"
#include "simulation/memory.h"
#include "simulation/run_listing.h"

namespace nephos {
namespace {

// Returns whether the size of a format's files is known before they are written.
bool has_known_size(const ExportOptions& options, ExportFormat format) {
    return is_dense(format) && !is_packed(options, format) && format != ExportFormat::bricks;
}

PlannedSequence planned(const ExportOptions& options, const ExportSequence& s) {
    PlannedSequence plan;
    plan.name = s.name;
    plan.layer = s.layer;
    plan.box = box_of(s.extent, s.placement, s.layout);
    plan.factor = s.layout.factor;
    plan.levels = s.levels;
    plan.frames = s.frames.size();
    std::uintmax_t source = 0;  // of a frame
    for (const SourceFrame& frame : s.frames) {
        std::error_code error;
        const std::uintmax_t bytes = std::filesystem::file_size(frame.file, error);
        source += error ? 0 : bytes / s.frames.size();
    }
    const double factor = s.layout.factor;
    const auto grid = std::uint64_t(std::ceil(double(source) / (factor * factor * factor)));
    for (const ExportFormat format : all_formats(options)) {
        if (format == ExportFormat::flightgear) {
            constexpr std::uint64_t kPicture = 500;  // of nothing
            plan.estimated_bytes += grid + kPicture;
        } else if (format == ExportFormat::vdb) {
            plan.estimated_bytes += grid * (has_velocity(options, s) ? 2 : 1);
        } else if (format == ExportFormat::nvdb) {
            // Not compressed it has some five times the bytes of a compressed VDB file, and nodes that are there always.
            constexpr std::uint64_t kNodes = 300'000;
            const auto bits = std::uint64_t(bits_of(options.quantise));
            plan.estimated_bytes += options.zip ? grid * bits / 32 : 5 * grid * bits / 32 + kNodes;
        } else if (is_dense(format)) {
            (has_known_size(options, format) ? plan.bytes_a_frame : plan.estimated_bytes) +=
                dense_bytes(options, s, format);
        }
    }
    return plan;
}

void require_space(const ExportOptions& options, const std::vector<ExportSequence>& sequences) {
    std::uint64_t bytes = 0;
    for (const ExportSequence& s : sequences) {
        for (const ExportFormat format : all_formats(options)) {
            if (!has_known_size(options, format)) continue;
            const std::uint64_t of_file = dense_bytes(options, s, format);
            for (const SourceFrame& frame : s.frames) {
                std::error_code none;
                const std::uintmax_t there =
                    std::filesystem::file_size(options.folder / frame_name(s, frame.number, format), none);
                bytes += of_file - (none ? 0 : std::min<std::uint64_t>(of_file, there));
            }
        }
    }
    std::error_code error;
    std::filesystem::path at = std::filesystem::absolute(options.folder, error);
    while (!std::filesystem::exists(at, error) && at.has_parent_path() && at != at.parent_path())
        at = at.parent_path();
    const auto space = std::filesystem::space(at, error);
    if (error || space.available >= bytes) return;
    throw Error(ErrorCode::io,
                fmt::format("{}: the export takes at least {}, but only {} are free", options.folder.string(),
                            bytes_text(std::size_t(bytes)), bytes_text(std::size_t(space.available))));
}

void require_box(const ExportOptions& options, const ExportSequence& s) {
    const std::array<int, 3> size = box_of(s.extent, s.placement, s.layout).size;
    require_memory(
        s.grid_bytes + std::size_t(box_bytes(options, s)),
        fmt::format("{}: a box of {} x {} x {} voxels (less with a larger --voxel; VDB and NanoVDB without "
                    "--voxel, --size, --budget and --velocity need that of their clouds alone)",
                    s.frames.front().file.string(), size[0], size[1], size[2]));
}

}  // namespace

void check_options(const ExportOptions& o) {
    if (o.formats.empty() && o.weather.empty())
        throw Error(ErrorCode::usage, "neither --to nor --for says which files to write");
    if (o.voxel_m && (o.largest_side || o.budget_bytes))
        throw Error(ErrorCode::usage, "--voxel excludes --size and --budget");
    if (o.largest_side && o.budget_bytes)
        throw Error(ErrorCode::usage, "--size and --budget exclude each other");
    if (!o.velocity_name.empty() && !is_name_of_wind(o.velocity_name))
        throw Error(ErrorCode::usage, "--velocity: \"" + shortened(o.velocity_name) + "\": expected " +
                                          std::string(kExpectedNameOfWind));
    for (const ExportFormat format : all_formats(o)) {
        const VoxelType type = type_of(o, format);
        const bool whole = type == VoxelType::r8 || type == VoxelType::r16;
        if (format == ExportFormat::vti && (type == VoxelType::bc4 || type == VoxelType::r16f))
            throw Error(ErrorCode::usage,
                        "--type " + std::string(type_name(type)) + ": VTK has r8, r16 and r32f");
        if (format == ExportFormat::bricks && type == VoxelType::bc4)
            throw Error(ErrorCode::usage, "--type bc4: bricks with a border have r8, r16, r16f or r32f");
        if (format == ExportFormat::slices && !whole)
            throw Error(ErrorCode::usage,
                        "--type " + std::string(type_name(type)) + ": slices are r8 or r16");
        if (format == ExportFormat::dds && o.legacy_dds && type != VoxelType::r8 && type != VoxelType::bc4)
            throw Error(ErrorCode::usage, "--legacy-dds: the old header has r8 and bc4");
        if (format == ExportFormat::vti && o.layout.axes != AxisOrder::enu)
            throw Error(ErrorCode::usage,
                        "--axes: VTK's space is right-handed and named x y z: leave it at enu for vti");
    }
}

ExportReport report_of(const ExportOptions& options, const std::vector<ExportSequence>& sequences) {
    ExportReport report;
    for (const ExportSequence& s : sequences) {
        report.sequences.push_back(planned(options, s));
        const PlannedSequence& plan = report.sequences.back();
        report.needed_bytes += plan.frames * (plan.bytes_a_frame + plan.estimated_bytes);
    }
    return report;
}

void require_room(const ExportOptions& options, const std::vector<ExportSequence>& sequences) {
    require_space(options, sequences);
    for (const ExportSequence& s : sequences) require_box(options, s);
}

std::string sidecar_name(const ExportSequence& s) { return s.name + ".volume.json"; }
std::string pvd_name(const ExportSequence& s) { return s.name + ".pvd"; }

std::string usd_name(const std::vector<ExportSequence>& sequences) {
    const std::string &name = sequences.front().name, &layer = sequences.front().layer;
    return (layer.empty() ? name : name.substr(0, name.size() - layer.size() - 1)) + ".usda";
}

std::vector<std::string> file_names(const ExportOptions& options, const std::optional<RunListing>& run,
                                    const std::vector<ExportSequence>& sequences) {
    std::vector<std::string> names{kReadme};
    if (run) {
        const std::string scene = run->scene.name;
        for (const NamedWeather& named : weather_formats()) {
            if (std::ranges::count(options.weather, named.format) == 0) continue;
            names.push_back(scene + std::string(named.extension));
            if (named.format == WeatherFormat::cigi) names.push_back(scene + kPackets);
        }
    }
    for (const ExportFormat format : all_formats(options)) {
        if (format == ExportFormat::usd) {
            names.push_back(usd_name(sequences));
            continue;
        }
        for (const ExportSequence& s : sequences) {
            names.push_back(sidecar_name(s));
            if (format == ExportFormat::vti) names.push_back(pvd_name(s));
            for (const SourceFrame& frame : s.frames) names.push_back(frame_name(s, frame.number, format));
        }
    }
    return names;
}

}  // namespace nephos
