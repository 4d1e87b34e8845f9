// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_listing.h"

#include <algorithm>
#include <system_error>

#include <nlohmann/json.hpp>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "scenes/format/reader.h"
#include "simulation/checked_json.h"
#include "simulation/own_files.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

ListedFrame frame_of(const Json& json, const std::filesystem::path& manifest) {
    ListedFrame frame;
    frame.number = frame_number(json.at("number"), manifest);
    frame.time_s = json.at("time_s").get<double>();
    const Json& step = json.at("step");
    if (step.is_number() && (!step.is_number_unsigned() || step.get<std::uint64_t>() > kMaxSteps))
        throw Error(ErrorCode::io,
                    manifest.string() + ": the step " + step.dump() + " of a frame is impossible");
    frame.step = step.get<std::uint64_t>();
    frame.state_hash = json.at("state_hash").get<std::string>();
    return frame;
}

// Returns whether the run lists the file, or, while it is not complete, has made it at this path and not listed it yet.
bool is_of_run(const RunListing& run, const std::filesystem::path& file) {
    const auto is_file = [&](const FileRecord& record) {
        return is_same_place(run.folder / record.path, file);
    };
    const bool is_listed =
        std::ranges::any_of(run.frames,
                            [&](const ListedFrame& f) { return std::ranges::any_of(f.files, is_file); }) ||
        std::ranges::any_of(run.tables, is_file) || std::ranges::any_of(run.run_files, is_file);
    if (is_listed || run.complete) return is_listed;
    return !OwnFiles(run.folder, read_manifest(run.folder / "manifest.json"), run.scene).why_foreign(file);
}

// Returns whether a run may be in a folder: not in one that the user may not search, as folders above their own may be.
bool may_be_run_folder(const std::filesystem::path& folder) {
    std::error_code error;
    const auto type = std::filesystem::status(folder / "manifest.json", error).type();
    if (type == std::filesystem::file_type::none && error == std::errc::permission_denied) return false;
    return is_run_folder(folder);
}

}  // namespace

bool is_run_folder(const std::filesystem::path& folder) {
    return type_behind(folder / "manifest.json") == std::filesystem::file_type::regular;
}

std::optional<std::filesystem::path> run_with_file(const std::filesystem::path& file) {
    if (type_behind(file) != std::filesystem::file_type::regular) return {};
    constexpr int kDeepest = 2;  // density/LAYER
    for (const std::filesystem::path& path : paths_to(file)) {
        std::filesystem::path folder = holder_of(path);
        for (int depth = 0; depth <= kDeepest; ++depth, folder = holder_of(folder)) {
            if (!may_be_run_folder(folder)) continue;
            const RunFolder run{folder, {}};
            if (is_same_place(run.manifest(), path) || is_same_place(run.checkpoint(), path)) return folder;
            try {
                if (is_of_run(read_run(folder), path)) return folder;
            } catch (const ReadFailure&) {
                throw;
            } catch (const Error&) {  // damaged, or of another version: then it lists nothing
            }
        }
    }
    return {};
}

RunListing read_run(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / "manifest.json";
    const EarlierRun earlier = read_manifest(path);
    RunListing run;
    run.folder = folder;
    run.scene_hash = earlier.scene_hash;
    run.frames_hash = earlier.frames_hash;
    run.simulation_hash = earlier.simulation_hash;
    run.complete = earlier.complete;
    run.render = earlier.render;
    run.range = earlier.range;
    run.steps_reported = earlier.steps_reported;
    run.scene_file = earlier.scene_file;
    run.inputs = earlier.inputs;
    run.branch = earlier.branch;
    std::string text, given;
    const Json json = parsed_json(path);
    try {
        run.nephos_version = json.at("nephos_version").get<std::string>();
        text = json.at("scene_text").get<std::string>();
        given = json.value("scene_given", std::string());
        for (const Json& frame : json.at("frames")) run.frames.push_back(frame_of(frame, path));
        run.tables = tables_of(json, path);
        if (json.contains("run_files"))
            for (const Json& file : json.at("run_files")) run.run_files.push_back(file_record(file, path));
    } catch (const nlohmann::json::exception&) {
        throw Error(ErrorCode::io, path.string() + ": is not a manifest of a run of nephos, or is damaged");
    }
    std::map<int, std::vector<FileRecord>> files = read_frame_files(path);
    std::map<int, std::vector<RainRecord>> rain = read_rain(path);
    for (ListedFrame& frame : run.frames) {
        frame.files = std::move(files[frame.number]);
        frame.rain = std::move(rain[frame.number]);
    }
    try {
        run.scene = scene_of_texts(text, given, path);
    } catch (const ReadFailure&) {
        throw;
    } catch (const Error& error) {
        throw Error(ErrorCode::io, path.string() + ": its scene cannot be read: " + error.what());
    }
    return run;
}

std::size_t layer_index(const Scene& scene, const std::string& name) {
    std::string names;
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        if (scene.layers[n].name == name) return n;
        if (has_density(scene.layers[n])) names += (names.empty() ? "" : ", ") + scene.layers[n].name;
    }
    throw Error(ErrorCode::usage,
                "there is no layer '" + name + "'; " +
                    (names.empty() ? "the scene has no layers" : "the layers are " + names));
}

std::filesystem::path density_file(const RunListing& run, const ListedFrame& frame,
                                   const std::optional<std::string>& layer) {
    const RunFolder folder{run.folder, run.scene.name};
    if (!has_density(run.scene))
        throw Error(ErrorCode::usage, run.folder.string() + ": the run has no density files");
    if (!layer) {
        if (run.scene.layers.empty() || run.scene.density_files.combined) return folder.density(frame.number);
        throw Error(ErrorCode::usage, run.folder.string() +
                                          ": the run has no file of all layers together "
                                          "(`density.combined` is false): name a layer");
    }
    const std::size_t n = layer_index(run.scene, *layer);
    if (!has_density(run.scene.layers[n]) || !run.scene.density_files.per_layer)
        throw Error(ErrorCode::usage, run.folder.string() + ": layer '" + *layer + "' has no density files");
    return folder.density(frame.number, *layer);
}

}  // namespace nephos
