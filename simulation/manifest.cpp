// SPDX-License-Identifier: Apache-2.0
#include "simulation/manifest.h"

#include <array>
#include <charconv>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/math.h"
#include "core/random.h"
#include "density/combine.h"
#include "scenes/format/errors.h"
#include "scenes/format/given_keys.h"
#include "scenes/format/named_files.h"
#include "scenes/format/reader.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"
#include "simulation/checked_json.h"
#include "simulation/scene_place.h"
#include "simulation/sealed_json.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr char kFormat[] = "nephos run";
constexpr int kFormatVersion = 1;

Json vector_json(const Vec3& v) { return {v.x, v.y, v.z}; }

// A path below the run's folder, with forward slashes.
std::string relative(const RunSettings& settings, const std::filesystem::path& path) {
    return path.lexically_relative(settings.folder).generic_string();
}

Json rain_json(const RainRecord& area) {
    constexpr std::array kSources{"placed", "attached", "found"};
    return {{"id", fmt::format("{:016x}", area.id)},
            {"layer", area.layer},
            {"source", kSources.at(std::size_t(area.id >> 62))},
            {"centre_m", {area.x_m, area.y_m}},
            {"semi_axes_m", {area.semi_a_m, area.semi_b_m}},
            {"yaw_deg", area.yaw_deg},
            {"intensity_mm_per_h", area.intensity_mm_per_h}};
}

RainRecord rain_record(const Json& json, const std::filesystem::path& manifest) {
    RainRecord area;
    const auto id = json.at("id").get<std::string>();
    const auto [end, error] = std::from_chars(id.data(), id.data() + id.size(), area.id, 16);
    if (error != std::errc() || end != id.data() + id.size())
        throw Error(ErrorCode::io,
                    manifest.string() + ": '" + shortened(id) + "' is not the number of a rain area");
    area.layer = json.at("layer").get<std::string>();
    area.x_m = json.at("centre_m").at(0).get<double>();
    area.y_m = json.at("centre_m").at(1).get<double>();
    area.semi_a_m = json.at("semi_axes_m").at(0).get<double>();
    area.semi_b_m = json.at("semi_axes_m").at(1).get<double>();
    area.yaw_deg = json.at("yaw_deg").get<double>();
    area.intensity_mm_per_h = json.at("intensity_mm_per_h").get<double>();
    return area;
}

Json file_json(const FileRecord& file) {
    Json json = {{"path", file.path}, {"bytes", file.digest.bytes}, {"xxh3", file.digest.xxh3}};
    if (!file.voxels.empty()) json["voxels_xxh3"] = file.voxels;
    return json;
}

Json files_json(const std::vector<FileRecord>& files) {
    Json list = Json::array();
    for (const FileRecord& file : files) list.push_back(file_json(file));
    return list;
}

Json frame_json(const RunSettings& settings, const FrameRecord& frame, const ManifestState& state,
                const RunFolder& folder) {
    const FrameOptions& frames = settings.scene.frames;
    Json entry = {{"number", frame.number},
                  {"time_s", frame.time_s}};
    if (const std::string utc = utc_at(settings.scene.georeference, frame.time_s); !utc.empty())
        entry["utc"] = utc;
    entry.update(Json{{"step", frame.step},
                      {"state_hash", frame.state_hash.hex()}});
    if (has_density(settings.scene) && (settings.scene.layers.empty() || settings.scene.density_files.combined))
        entry["density"] = relative(settings, folder.density(frame.number));
    if (settings.render && (frames.png || frames.video)) {
        entry["png"] = relative(settings, folder.picture(frame.number, ".png"));
    }
    if (settings.render && frames.exr)
        entry["exr"] = relative(settings, folder.picture(frame.number, ".exr"));
    Json layers = Json::object();
    for (const LayerOptions& layer : settings.scene.layers) {
        if (settings.scene.density_files.per_layer && has_density(layer))
            layers[layer.name] = relative(settings, folder.density(frame.number, layer.name));
    }
    if (!layers.empty()) entry["layers"] = std::move(layers);
    if (!frame.files.empty()) entry["files"] = files_json(frame.files);
    const auto rain = state.rain.find(frame.number);
    if (rain == state.rain.end()) return entry;
    Json areas = Json::array();
    for (const RainRecord& area : rain->second) areas.push_back(rain_json(area));
    entry["rain"] = std::move(areas);
    return entry;
}

// null on an axis that does not repeat.
Json period_json(const Vec3& period) {
    Json json = Json::array();
    for (int axis = 0; axis < 3; ++axis) json.push_back(period[axis] > 0 ? Json(period[axis]) : Json());
    return json;
}

// Of a layer, or of all together.
Json bounds_json(const Scene& scene, const GridBox& box, std::optional<std::size_t> layer) {
    const int refine = scene.density.refine;
    const Placement& at = box.placement;
    const Extent& cells = box.extent;
    return {{"voxels", {cells.x * refine, cells.y * refine, cells.z * refine}},
            {"voxel_size_m", at.cell_size_m / refine},
            {"min_m", vector_json(at.origin_m)},
            {"max_m",
             {at.origin_m.x + cells.x * at.cell_size_m, at.origin_m.y + cells.y * at.cell_size_m,
              at.origin_m.z + cells.z * at.cell_size_m}},
            {"period_m", period_json(period_m(scene, layer))},
            {"up_axis", "z"},
            {"extinction_per_m", scene.density.extinction_per_m}};
}

Json place_json(const Georeference& place) {
    Json json = {{"latitude_deg", place.latitude_deg},
                 {"longitude_deg", place.longitude_deg},
                 {"height_m", place.height_m},
                 {"height_datum", place.height_datum == HeightDatum::msl ? "msl" : "ellipsoid"},
                 {"geoid_height_m", place.geoid_height_m},
                 {"heading_deg", place.heading_deg}};
    if (!place.start_utc.empty()) json["start_utc"] = place.start_utc;
    json["projection"] = "tangent";
    json["ecef_from_world"] = ecef_from_world(place);
    return json;
}

// The table of one wind at its key frames.
Json wind_json(const Wind& wind) {
    Json keyframes = Json::array();
    for (const WindKeyframe& keyframe : wind.keyframes) {
        Json levels = Json::array();
        for (const WindLevel& level : keyframe.levels) {
            levels.push_back({{"height_m", level.height_m},
                              {"east_m_per_s", level.velocity.east_m_per_s},
                              {"north_m_per_s", level.velocity.north_m_per_s}});
        }
        keyframes.push_back({{"time_s", keyframe.time_s}, {"levels", std::move(levels)}});
    }
    return keyframes;
}

// The box of all layers together.
GridBox whole_box(const Scene& scene) {
    std::vector<GridBox> boxes;
    for (const LayerOptions& layer : scene.layers) {
        if (has_density(layer)) boxes.push_back({layer.extent, layer.placement});
    }
    if (boxes.empty()) boxes.push_back({scene.automaton.extent, scene.automaton.placement});
    return boxes.size() == 1 ? boxes.front() : common_box(boxes);  // one alone needs no OpenVDB, which loads slowly
}

Json layers_json(const RunSettings& settings, const RunFolder& folder) {
    Json layers = Json::array();
    for (std::size_t n = 0; n < settings.scene.layers.size(); ++n) {
        const LayerOptions& layer = settings.scene.layers[n];
        layers.push_back({{"name", layer.name},
                          {"automaton", layer.automaton},
                          {"veil", layer.is_veil},
                          {"opacity", layer.opacity},
                          {"bounds", bounds_json(settings.scene, {layer.extent, layer.placement}, n)},
                          {"wind", wind_json(layer_wind(settings.scene, n))},
                          {"statistics", relative(settings, folder.statistics(layer.name))}});
    }
    return layers;
}

Json branch_json(const BranchPoint& branch, const std::filesystem::path& folder) {
    std::filesystem::path file = branch.place.empty() ? branch.checkpoint : branch.place;
    if (branch.checkpoint.is_relative()) file = std::filesystem::proximate(file);
    return {{"checkpoint", branch.checkpoint.generic_string()},
            {"path", path_from(folder, file).generic_string()},
            {"steps", branch.steps},
            {"state_hash", branch.state_hash},
            {"simulation_hash", branch.simulation_hash}};
}

BranchPoint branch_point(const Json& json, const std::filesystem::path& folder) {
    BranchPoint branch;
    branch.checkpoint = json.at("checkpoint").get<std::string>();
    if (!json.contains("path")) return branch;
    branch.place = path_of(folder, json.at("path").get<std::string>());
    branch.steps = json.at("steps").get<std::uint64_t>();
    branch.state_hash = json.at("state_hash").get<std::string>();
    branch.simulation_hash = json.at("simulation_hash").get<std::string>();
    return branch;
}

Json inputs_json(const std::vector<RunInput>& inputs) {
    Json::object_t files;  // appended to: a key of an object is looked for among all of its keys
    for (const RunInput& input : inputs)
        files.emplace_back(input.key, Json{{"path", input.path.generic_string()},
                                           {"bytes", input.digest.bytes},
                                           {"xxh3", input.digest.xxh3}});
    return files;
}

Json tables_json(const std::vector<FileRecord>& tables) {
    Json files;
    for (const FileRecord& table : tables)
        files[table.path] = {{"bytes", table.digest.bytes}, {"xxh3", table.digest.xxh3}};
    return files;
}

// All that stands before the list of frames.
Json head_json(const RunSettings& settings, const ManifestState& state) {
    const Scene& scene = settings.scene;
    const RunFolder folder{settings.folder, scene.name};
    Json json;
    json["format"] = kFormat;
    json["format_version"] = kFormatVersion;
    json["nephos_version"] = version();
    json["random_stream_version"] = kRandomStreamVersion;
    json["complete"] = state.complete;
    json["scene"] = {{"name", scene.name},
                     {"file", settings.scene_file},
                     {"hash", settings.scene_hash},
                     {"frames_hash", frames_hash(scene)},
                     {"simulation_hash", settings.simulation_hash},
                     {"seed", std::to_string(scene.automaton.seed)},
                     {"steps", scene.steps}};
    if (settings.branch) json["branch"] = branch_json(*settings.branch, settings.folder);
    json["range"] = {{"last_step", settings.range.last_step},
                     {"first_frame", settings.range.first_frame},
                     {"last_frame", settings.range.last_frame},
                     {"pictures", settings.render}};
    json["steps"] = {{"reported", state.steps_reported},
                     {"time_step_s", scene.automaton.time_step_s},
                     {"state_hash", state.state_hash}};
    json["bounds"] = bounds_json(scene, whole_box(scene), std::nullopt);
    if (scene.georeference.given) json["georeference"] = place_json(scene.georeference);
    json["wind"] = wind_json(scene.automaton.wind);
    if (!scene.layers.empty()) json["layers"] = layers_json(settings, folder);
    Json::object_t keys;  // appended to: a key of an object is looked for among all of its keys
    for (const auto& [key, value] : parameters(scene)) keys.emplace_back(key, value);
    json["parameters"] = std::move(keys);
    json["files"] = {{"statistics", relative(settings, folder.statistics())}};
    if (settings.checkpoint || !state.complete)
        json["files"]["checkpoint"] = relative(settings, folder.checkpoint());
    if (state.complete && settings.render && scene.frames.video) {
        json["files"]["video"] = relative(settings, folder.video());
    }
    if (!state.tables.empty()) json["tables"] = tables_json(state.tables);
    if (!state.inputs.empty()) json["inputs"] = inputs_json(state.inputs);
    json["frames_per_second"] = scene.frames.per_second;
    json["time_scale"] = scene.frames.time_scale;
    return json;
}

// The members of an object in lines of their own, without its braces.
std::string members(const Json& object) {
    const std::string text = object.dump(2, ' ', false, Json::error_handler_t::replace);
    return text.substr(2, text.size() - 4);
}

}  // namespace

bool is_inside_folder(const std::filesystem::path& path) {
    return !path.empty() && path.is_relative() && path.lexically_normal() == path && *path.begin() != "..";
}

int frame_number(const Json& json, const std::filesystem::path& manifest) {
    if (!json.is_number()) return json.get<int>();  // throws
    const bool is_whole =
        json.is_number_integer() && (!json.is_number_unsigned() || json.get<std::uint64_t>() <= kMaxFrames);
    if (is_whole && json.get<std::int64_t>() >= -1 && json.get<std::int64_t>() <= kMaxFrames)
        return json.get<int>();
    throw Error(ErrorCode::io,
                fmt::format("{}: the frame's number {} is impossible", manifest.string(), json.dump()));
}

FileRecord file_record(const Json& json, const std::filesystem::path& manifest) {
    const std::filesystem::path path = json.at("path").get<std::string>();
    if (!is_inside_folder(path))
        throw Error(ErrorCode::io, fmt::format("{}: lists the file \"{}\", which is none of its folder",
                                               manifest.string(), shortened(path.string())));
    return {path.string(),
            {json.at("bytes").get<std::uint64_t>(), json.at("xxh3").get<std::string>()},
            json.value("voxels_xxh3", std::string())};
}

std::vector<FileRecord> tables_of(const Json& manifest, const std::filesystem::path& path) {
    std::vector<FileRecord> tables;
    if (!manifest.contains("tables")) return tables;
    for (const auto& [name, file] : manifest.at("tables").items()) {
        if (!is_inside_folder(name))
            throw Error(ErrorCode::io, fmt::format("{}: lists the table \"{}\", which is none of its folder",
                                                   path.string(), shortened(name)));
        tables.push_back(
            {name, {file.at("bytes").get<std::uint64_t>(), file.at("xxh3").get<std::string>()}, {}});
    }
    return tables;
}

void write_manifest(const RunSettings& settings, const ManifestState& state) {
    const RunFolder folder{settings.folder, settings.scene.name};
    write_pieces_atomically(
        folder.manifest(),
        [&](const AppendPiece& append_to_file) {
            Digest digest;
            const auto append = [&](std::string_view piece) {
                digest.add(piece);
                append_to_file(piece);
            };
            append("{\n" + members(head_json(settings, state)) + ",\n  \"frames\": [");
            std::string_view separator = "\n";
            for (const FrameRecord& frame : state.frames) {
                append(separator);
                append("    " + frame_json(settings, frame, state, folder)
                                    .dump(-1, ' ', false, Json::error_handler_t::replace));
                separator = ",\n";
            }
            Json tail = Json::object();
            if (!state.run_files.empty()) tail["run_files"] = files_json(state.run_files);
            tail.update(
                Json{{"scene_text", settings.scene_text},
                     {"scene_given", given_toml(settings.scene)},
                     {"timing",
                      {{"wall_s", state.wall_s}, {"backend", state.backend}, {"device", state.device}}}});
            append("\n  ],\n" + members(tail));
            append_to_file(seal_text(digest));
        },
        Folders::expected);
}

std::vector<RainRecord> rain_of(const FrameResult& frame) {
    std::vector<RainRecord> areas;
    for (const LayerFrame& layer : frame.layers) {
        for (const RainArea& area : layer.rain) {
            areas.push_back({area.id, layer.name, area.x_m, area.y_m, area.semi_a_m, area.semi_b_m,
                             degrees_of_vector(area.axis_x, area.axis_y), area.intensity_mm_per_h});
        }
    }
    return areas;
}

namespace {

// Calls `read` with the manifest as a whole. Throws Error(io) naming it.
template <class Read>
auto with_manifest(const std::filesystem::path& path, const Read& read) {
    const Json json = parsed_json(path);
    try {
        return read(json);
    } catch (const nlohmann::json::exception&) {
        throw Error(ErrorCode::io, path.string() + ": is not a manifest of a run of nephos, or is damaged");
    }
}

// Returns the format that a manifest names where it is none of a run.
std::string foreign_format(const Json& json) {
    if (!json.is_object() || !json.contains("format") || !json.at("format").is_string()) return {};
    const auto format = json.at("format").get<std::string>();
    return format == kFormat ? std::string() : shortened(format);
}

}  // namespace

std::string foreign_format(const std::filesystem::path& path) {
    return foreign_format(parsed_json(path, JsonLists::left_out));
}

std::map<int, std::vector<RainRecord>> read_rain(const std::filesystem::path& path) {
    return with_manifest(path, [&](const Json& json) {
        std::map<int, std::vector<RainRecord>> rain;
        for (const Json& frame : json.at("frames")) {
            if (!frame.contains("rain")) continue;
            std::vector<RainRecord>& areas = rain[frame_number(frame.at("number"), path)];
            for (const Json& area : frame.at("rain")) areas.push_back(rain_record(area, path));
        }
        return rain;
    });
}

Scene scene_of_texts(const std::string& canonical, const std::string& given,
                     const std::filesystem::path& manifest) {
    const auto read = [&](const std::string& text, const char* name) {
        return read_scene_text(text, manifest.string() + name, {}, {}, SceneUse::without_frames);
    };
    // Earlier versions have no given keys, and a program may have changed more than they show.
    try {
        if (!given.empty())
            if (Scene scene = read(given, ": scene_given"); to_toml(scene) == canonical) return scene;
    } catch (const SceneErrors&) {
    }
    Scene scene = read(canonical, ": scene_text");
    scene.given = {};
    return scene;
}

std::string read_scene_text_of(const std::filesystem::path& path) {
    const auto [canonical, given] = with_manifest(path, [](const Json& json) {
        return std::pair(json.at("scene_text").get<std::string>(), json.value("scene_given", std::string()));
    });
    Scene scene = scene_of_texts(canonical, given, path);
    locate_inputs(scene, path.parent_path(), read_manifest(path).inputs);
    for_each_file(scene, [](const std::string&, FileKind, const std::filesystem::path& file) {
        require_scene_name(file);
        return file;
    });
    return given_toml(scene);
}

std::map<int, std::vector<FileRecord>> read_frame_files(const std::filesystem::path& path) {
    return with_manifest(path, [&](const Json& json) {
        std::map<int, std::vector<FileRecord>> files;
        for (const Json& frame : json.at("frames")) {
            if (!frame.contains("files")) continue;
            std::vector<FileRecord>& records = files[frame_number(frame.at("number"), path)];
            for (const Json& file : frame.at("files")) records.push_back(file_record(file, path));
        }
        return files;
    });
}

EarlierRun read_manifest(const std::filesystem::path& path) {
    // Lists are not needed here, and that of the frames may be very long.
    const Json json = parsed_json(path, JsonLists::left_out);
    try {
        if (const std::string format = foreign_format(json); !format.empty())
            throw Error(ErrorCode::io, fmt::format("{}: is not a manifest of a run: it is that of a \"{}\"",
                                                   path.string(), format));
        if (json.at("format") != kFormat || json.at("format_version") != kFormatVersion)
            throw Error(ErrorCode::io, path.string() + ": is not a manifest of this version of nephos");
        EarlierRun run;
        run.complete = json.at("complete").get<bool>();
        run.name = json.at("scene").at("name").get<std::string>();
        run.scene_file = json.at("scene").value("file", std::string());
        run.scene_hash = json.at("scene").at("hash").get<std::string>();
        run.frames_hash = json.at("scene").value("frames_hash", run.scene_hash);  // not in those of earlier versions
        run.simulation_hash = json.at("scene").at("simulation_hash").get<std::string>();
        run.render = json.at("range").at("pictures").get<bool>();
        run.range.last_step = json.at("range").at("last_step").get<std::uint64_t>();
        // Manifests of earlier versions do not name the scene's steps; without --frames they are the last step.
        run.scene_steps = json.at("scene").value("steps", run.range.last_step);
        run.range.first_frame = frame_number(json.at("range").at("first_frame"), path);
        run.range.last_frame = frame_number(json.at("range").at("last_frame"), path);
        run.steps_reported = json.at("steps").at("reported").get<std::uint64_t>();
        run.state_hash = json.at("steps").value("state_hash", std::string());
        if (json.contains("parameters")) {
            for (const auto& [key, value] : json.at("parameters").items())
                run.parameters.emplace_back(key, value.get<std::string>());
        }
        run.tables = tables_of(json, path);
        if (json.contains("inputs")) {
            for (const auto& [key, file] : json.at("inputs").items())
                run.inputs.push_back(
                    {key,
                     file.at("path").get<std::string>(),
                     {file.at("bytes").get<std::uint64_t>(), file.at("xxh3").get<std::string>()}});
        }
        if (json.contains("branch")) {
            run.branch = branch_point(json.at("branch"), path.parent_path());
            run.branch->next_frame = run.range.first_frame;
        }
        return run;
    } catch (const nlohmann::json::exception&) {
        throw Error(ErrorCode::io, path.string() + ": is not a manifest of a run of nephos, or is damaged");
    }
}

}  // namespace nephos
