// SPDX-License-Identifier: Apache-2.0
// Texts of an export: sidecar, USD scene and README.

#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/text.h"
#include "density/export/containers.h"
#include "simulation/export/sequence.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kAxisNames[] = {"east", "north", "up"};

Json format_json(const ExportOptions& options, const ExportSequence& s, const NamedFormat& named) {
    const VolumeBox box = box_of(s.extent, s.placement, s.layout);
    Json json = {{"format", named.name}, {"files", frame_pattern(s.name, named)}};
    if (!is_dense(named.format)) {
        if (named.format == ExportFormat::flightgear) {
            json["type"] = "r8";
            return json;
        }
        json["type"] = named.format == ExportFormat::nvdb && options.quantise != NanoQuantise::none
                           ? (options.quantise == NanoQuantise::fp8 ? "fp8" : "fp16")
                           : type_name(type_of(options, named.format));
        json["grid"] = "density";
        return json;
    }
    const VoxelType type = type_of(options, named.format);
    json["type"] = type_name(type);
    Json levels = Json::array();
    std::size_t offset = 0;
    for (const std::array<int, 3>& size : level_sizes(s, named.format)) {
        if (named.format == ExportFormat::bricks) {
            levels.push_back({{"size", size}});
            continue;
        }
        const std::size_t bytes = encoded_bytes(size[0], size[1], size[2], type);
        Json level = {{"size", size}, {"bytes", bytes}};
        if (named.format == ExportFormat::raw) level["offset"] = offset;
        offset += bytes;
        levels.push_back(std::move(level));
    }
    json["levels"] = std::move(levels);
    if (named.format == ExportFormat::bricks) json["brick"] = {{"edge", options.brick_edge}, {"border", 1}};
    if (named.format == ExportFormat::slices) {
        const int columns = slice_columns(box.size[0], box.size[1], box.size[2]);
        json["columns"] = columns;
        json["rows"] = (box.size[2] + columns - 1) / columns;
    }
    return json;
}

Json wind_json(const std::vector<WindTable>& tables) {
    Json json = Json::array();
    for (const WindTable& table : tables) {
        Json levels = Json::array();
        for (const WindLevel& level : table.levels)
            levels.push_back({{"height_m", level.height_m},
                              {"east_m_per_s", level.velocity.east_m_per_s},
                              {"north_m_per_s", level.velocity.north_m_per_s}});
        json.push_back({{"time_s", table.time_s}, {"levels", levels}});
    }
    return json;
}

Json georeference_json(const Georeference& place) {
    Json json = {{"latitude_deg", place.latitude_deg},
                 {"longitude_deg", place.longitude_deg},
                 {"height_m", place.height_m},
                 {"height_datum", place.height_datum == HeightDatum::msl ? "msl" : "ellipsoid"},
                 {"geoid_height_m", place.geoid_height_m},
                 {"heading_deg", place.heading_deg},
                 {"projection", "tangent"},
                 {"ecef_from_world", ecef_from_world(place)}};
    if (!place.start_utc.empty()) json["start_utc"] = place.start_utc;
    return json;
}

void replace_all(std::string& text, const std::string& key, const std::string& value) {
    for (std::size_t at = text.find(key); at != text.npos; at = text.find(key, at + value.size()))
        text.replace(at, key.size(), value);
}

// A path between marks that it does not hold.
std::string asset_path(const std::string& path) {
    constexpr std::string_view kLongMark = "@@@";
    if (path.find('@') == path.npos) return "@" + path + "@";
    std::string text = path;
    replace_all(text, std::string(kLongMark), "\\" + std::string(kLongMark));
    return std::string(kLongMark) + text + std::string(kLongMark);
}

std::string asset_list(const ExportSequence& s) {
    std::string text;
    for (const SourceFrame& frame : s.frames)
        text += fmt::format("                {}: {},\n", frame.number,
                            asset_path("./" + frame_name(s, frame.number, ExportFormat::vdb)));
    return text;
}

// Names of USD prims hold letters, digits and '_', and begin with no digit.
std::string prim_name(const std::string& name) {
    std::string prim;
    for (const char c : name) {
        const bool good =
            (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
        prim += good ? c : '_';
    }
    return prim.empty() || (prim[0] >= '0' && prim[0] <= '9') ? "_" + prim : prim;
}

}  // namespace

std::string sidecar_text(const ExportOptions& options, const ExportSequence& s,
                         const std::vector<FrameFigures>& figures, SidecarUse use) {
    const VolumeBox box = box_of(s.extent, s.placement, s.layout);
    const VdbMetadata& m = s.metadata;
    Json formats = Json::array();
    for (const ExportFormat format : all_formats(options)) {
        for (const NamedFormat& named : export_formats())
            if (named.format == format && format != ExportFormat::usd)
                formats.push_back(format_json(options, s, named));
    }
    Json axes = Json::array(), period = Json::array();
    for (std::size_t a = 0; a < 3; ++a) {
        axes.push_back(kAxisNames[std::size_t(box.axis[a])]);
        const double length = m.period_m[box.axis[a]];
        period.push_back(length > 0 ? Json(length) : Json());
    }
    Json json = {{"format", "nephos volume"}, {"format_version", 1}, {"name", s.name}};
    if (!s.layer.empty()) json["layer"] = s.layer;
    // Not in a file of a frame, which later exports of more frames keep.
    const bool tells_frames = use == SidecarUse::file;
    if (tells_frames) {
        json["first"] = s.frames.front().number;
        json["count"] = s.frames.size();
    }
    json["quantity"] = "density";
    json["scale"] = s.scale;
    json["offset"] = 0;
    if (s.of_nephos) json["extinction_per_m"] = m.extinction_per_m;
    json["size"] = box.size;
    json["order"] = "x fastest, then y, then z";
    json["axes"] = axes;
    json["handedness"] = options.layout.axes == AxisOrder::enu ? "right" : "left";
    json["unit"] = "m";
    json["voxel_size_m"] = box.voxel_m;
    json["min_m"] = box.min_m;
    json["max_m"] = box.max_m;
    json["sample"] = "voxel centre";
    json["period_m"] = period;
    json["border"] = box.border;
    json["padding"] = box.padding;
    if (options.half_voxel_shift) json["half_voxel_shift"] = true;
    json["formats"] = formats;
    if (tells_frames) {
        json["time"] = {{"first_s", s.frames.front().time_s},
                        {"frames_per_second", s.frames_per_second},
                        {"time_scale", m.time_scale}};
        json["wind"] = wind_json(s.wind);
    }
    if (m.georeference.given) json["georeference"] = georeference_json(m.georeference);
    Json frames = Json::array();
    for (std::size_t n = 0; n < figures.size(); ++n) {
        Json frame = {{"number", s.frames[n].number}, {"time_s", s.frames[n].time_s}};
        if (!s.frames[n].utc.empty()) frame["utc"] = s.frames[n].utc;
        frame["sum"] = figures[n].sum;
        frame["max"] = figures[n].max;
        frames.push_back(std::move(frame));
    }
    if (!figures.empty()) json["frames"] = std::move(frames);
    if (s.of_nephos)
        json["source"] = {{"scene_hash", m.scene_hash},
                          {"seed", std::to_string(m.seed)},
                          {"nephos_version", m.nephos_version}};
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string usd_text(const ExportOptions& options, const std::vector<ExportSequence>& sequences) {
    const ExportSequence& first = sequences.front();
    std::string text = fmt::format(
        "#usda 1.0\n(\n    defaultPrim = \"clouds\"\n    metersPerUnit = 1\n    upAxis = \"Z\"\n    "
        "startTimeCode = {}\n"
        "    endTimeCode = {}\n    timeCodesPerSecond = {}\n)\n\ndef Xform \"clouds\"\n{{\n",
        first.frames.front().number, first.frames.back().number, number_text(first.frames_per_second));
    std::set<std::string> prims;
    for (const ExportSequence& s : sequences) {
        std::string prim = prim_name(s.layer.empty() ? "all" : s.layer);
        while (!prims.insert(prim).second) prim += "_";  // "a-b" and "a_b" are two layers
        const VolumeBox box = box_of(s.extent, s.placement, {.factor = s.layout.factor});
        const double shift = options.half_voxel_shift ? -box.voxel_m[0] / 2 : 0;
        text += fmt::format(
            "    def Volume \"{}\" (\n        customData = {{\n            dictionary nephos = {{\n", prim);
        if (s.of_nephos)
            text += "                double extinction_per_m = " + number_text(s.metadata.extinction_per_m) +
                    "\n";
        const Georeference& place = s.metadata.georeference;
        if (place.given) {
            text += fmt::format(
                "                double latitude_deg = {}\n                double longitude_deg = {}\n       "
                "         double height_m = {}\n"
                "                double heading_deg = {}\n",
                number_text(place.latitude_deg), number_text(place.longitude_deg),
                number_text(place.height_m), number_text(place.heading_deg));
            const Matrix4 m = ecef_from_world(place);
            // USD's matrices are for row vectors.
            text += "                matrix4d ecef_from_world = ( ";
            for (std::size_t c = 0; c < 4; ++c)
                text += fmt::format("{}({}, {}, {}, {})", c == 0 ? "" : ", ", number_text(m[c]),
                                    number_text(m[4 + c]), number_text(m[8 + c]), number_text(m[12 + c]));
            text += " )\n";
            if (!place.start_utc.empty())
                text += "                string start_utc = \"" + place.start_utc + "\"\n";
        }
        text += "            }\n        }\n    )\n    {\n";
        text += fmt::format(
            "        float3[] extent = [({}, {}, {}), ({}, {}, {})]\n        rel field:density = "
            "</clouds/{}/density>\n\n",
            number_text(box.min_m[0] + shift), number_text(box.min_m[1] + shift),
            number_text(box.min_m[2] + shift), number_text(box.max_m[0] + shift),
            number_text(box.max_m[1] + shift), number_text(box.max_m[2] + shift), prim);
        text +=
            "        def OpenVDBAsset \"density\"\n        {\n            token fieldName = \"density\"\n    "
            "        int fieldIndex = 0\n"
            "            token fieldDataType = \"float\"\n            token fieldClass = \"fogVolume\"\n     "
            "       asset filePath.timeSamples = {\n" +
            asset_list(s) + "            }\n        }\n    }\n";
    }
    return text + "}\n";
}

std::string readme_text(const ExportOptions& options, const std::vector<ExportSequence>& sequences) {
    const ExportSequence& s = sequences.front();
    const VolumeBox box = box_of(s.extent, s.placement, s.layout);
    const std::vector<ExportFormat> formats = all_formats(options);
    std::string text =
        "Clouds of nephos: " + s.name + (sequences.size() > 1 ? " and other layers" : "") + "\n\n";
    for (const ExportPreset& preset : export_presets())
        if (preset.name == options.target) text += preset.readme + "\n";
    text += "Files\n\n";
    for (const NamedFormat& named : export_formats()) {
        if (std::ranges::count(formats, named.format) > 0)
            text +=
                fmt::format("  {:18} {}\n",
                            named.format == ExportFormat::usd ? "*.usda" : "*" + std::string(named.extension),
                            named.description);
    }
    for (const NamedWeather& named : weather_formats()) {
        if (std::ranges::count(options.weather, named.format) > 0)
            text += fmt::format("  {:18} {}\n", "*" + std::string(named.extension), named.description);
    }
    if (!formats.empty())
        text +=
            "  *.volume.json      what the bytes mean: sizes, axes, place, times, wind "
            "(docs/flight-simulators.md)\n";
    text +=
        "  export.json        bytes and XXH3-128 of each file; `nephos verify` of this folder checks them\n";
    const int columns = slice_columns(box.size[0], box.size[1], box.size[2]);
    const int rows = (box.size[2] + columns - 1) / columns, empty = rows * columns - box.size[2];
    const std::string texture_end =
        empty == 0 ? std::string("max_m of the sidecar")
                   : fmt::format(
                         "[{}, {}, {}] m: the picture ends with {} empty slices behind max_m of the "
                         "sidecar, which are part of the texture",
                         number_text(box.max_m[0], 9), number_text(box.max_m[1], 9),
                         number_text(box.max_m[2] + empty * box.voxel_m[2], 9), empty);
    const std::pair<const char*, std::string> values[] = {
        {"{NAME}", s.name},
        {"{FIRST}",
         formats.empty() ? std::string() : frame_name(s, s.frames.front().number, formats.front())},
        {"{COUNT}", std::to_string(s.frames.size())},
        {"{START}", std::to_string(s.frames.front().number)},
        {"{END}", std::to_string(s.frames.back().number)},
        {"{EXTINCTION}",
         s.of_nephos ? number_text(s.metadata.extinction_per_m, 6) : "the extinction of your choice,"},
        {"{SCALE}", number_text(s.scale, 6)},
        {"{SHIFT}", number_text(-box.voxel_m[0] / 2, 6)},
        {"{VELOCITY_SCALE}", number_text(s.metadata.time_scale / std::max(1e-9, s.frames_per_second), 6)},
        {"{COLUMNS}", std::to_string(columns)},
        {"{ROWS}", std::to_string(rows)},
        {"{TEXTURE_END}", texture_end},
    };
    for (const auto& [key, value] : values) replace_all(text, key, value);
    return text;
}

}  // namespace nephos
