// SPDX-License-Identifier: Apache-2.0
// Which options mean something to which formats.

#include <algorithm>

#include <fmt/format.h>

#include "core/error.h"
#include "simulation/export/sequence.h"

namespace nephos {
namespace {

using Takes = bool (*)(ExportFormat format, const ExportOptions& given);

bool takes_type(ExportFormat format, const ExportOptions& given) {
    if (is_dense(format)) return true;
    return given.type == VoxelType::r32f || (given.type == VoxelType::r16f && format == ExportFormat::vdb);
}
bool takes_shape(ExportFormat format, const ExportOptions&) { return is_dense(format); }
bool takes_range(ExportFormat format, const ExportOptions&) {
    return is_dense(format) || format == ExportFormat::flightgear;
}
bool takes_mips(ExportFormat format, const ExportOptions&) {
    return is_dense(format) && format != ExportFormat::vti && format != ExportFormat::slices;
}
bool takes_zip(ExportFormat format, const ExportOptions&) {
    return format == ExportFormat::vti || format == ExportFormat::nvdb;
}
bool takes_velocity(ExportFormat format, const ExportOptions&) {
    return format == ExportFormat::vdb || format == ExportFormat::usd;
}
bool takes_voxels(ExportFormat, const ExportOptions&) { return true; }
template <ExportFormat only>
bool takes_own(ExportFormat format, const ExportOptions&) {
    return format == only;
}

std::string joined(const std::vector<std::string>& words) {
    std::string text;
    for (std::size_t n = 0; n < words.size(); ++n)
        text += (n == 0 ? "" : n + 1 == words.size() ? " and " : ", ") + words[n];
    return text;
}

}  // namespace

void refuse_unused(const ExportOptions& given, const ExportOptions& options) {
    const ExportOptions none;
    const struct {
        const char* name;
        bool is_given;
        Takes takes;
    } rules[] = {
        {"--type", given.type.has_value(), takes_type},
        {"--range auto", given.range_auto, takes_range},
        {"--voxel", given.voxel_m.has_value(), takes_voxels},
        {"--size", given.largest_side.has_value(), takes_voxels},
        {"--budget", given.budget_bytes.has_value(), takes_shape},
        {"--mips", given.mips, takes_mips},
        {"--bricks", given.brick_edge != none.brick_edge, takes_own<ExportFormat::bricks>},
        {"--border", given.layout.border != none.layout.border, takes_shape},
        {"--pad", given.layout.multiple != none.layout.multiple || given.layout.power_of_two, takes_shape},
        {"--axes", given.layout.axes != none.layout.axes, takes_shape},
        {"--velocity", !given.velocity_name.empty(), takes_velocity},
        {"--zip", given.zip, takes_zip},
        {"--quantise", given.quantise != none.quantise, takes_own<ExportFormat::nvdb>},
        {"--legacy-dds", given.legacy_dds, takes_own<ExportFormat::dds>},
        {"--layer", given.layer.has_value(), takes_voxels},
        {"--grid", !given.grid.empty(), takes_voxels},
    };
    const std::vector<ExportFormat> formats = all_formats(options);
    std::vector<std::string> written;
    for (const NamedFormat& named : export_formats())
        if (std::ranges::count(formats, named.format) > 0) written.emplace_back(named.name);
    for (const NamedWeather& named : weather_formats())
        if (std::ranges::count(options.weather, named.format) > 0) written.emplace_back(named.name);
    for (const auto& rule : rules) {
        const auto takes = [&](ExportFormat format) { return rule.takes(format, given); };
        if (!rule.is_given || written.empty() || std::ranges::any_of(formats, takes)) continue;
        std::vector<std::string> takers;
        for (const NamedFormat& named : export_formats())
            if (takes(named.format)) takers.emplace_back(named.name);
        const std::string value = rule.takes == takes_type ? " " + std::string(type_name(*given.type)) : "";
        throw Error(ErrorCode::usage, fmt::format("{}{}: is for {}, and of no effect in {}", rule.name, value,
                                                  joined(takers), joined(written)));
    }
}

}  // namespace nephos
