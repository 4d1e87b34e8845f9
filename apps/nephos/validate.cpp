// SPDX-License-Identifier: Apache-2.0

// nephos validate: every problem of a scene in one pass; or the scene with all its defaults spelled out.

#include <algorithm>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "core/text.h"
#include "scenes/format/errors.h"
#include "scenes/format/warnings.h"
#include "scenes/format/writer.h"
#include "simulation/layer_simulation.h"
#include "simulation/memory.h"
#include "simulation/scene_files.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

struct ValidateArguments {
    std::vector<std::string> files;
    SceneArguments scene;
    bool print = false;
    WorkArguments work;
};

Json problem_json(const Problem& problem) {
    Json json = {{"file", problem.where.file},     {"line", problem.where.line},
                 {"column", problem.where.column}, {"message", problem.message},
                 {"expected", problem.expected},   {"source_line", problem.source_line}};
    return json;
}

Json scene_json(const std::string& file, const Scene& scene) {
    const Extent& cells = scene.automaton.extent;
    Json layers = Json::array();
    for (const LayerOptions& layer : scene.layers) {
        layers.push_back({{"name", layer.name},
                          {"automaton", layer.automaton},
                          {"veil", layer.is_veil},
                          {"cells", {layer.extent.x, layer.extent.y, layer.extent.z}}});
    }
    return {{"file", file},
            {"valid", true},
            {"name", scene.name},
            {"cells", {cells.x, cells.y, cells.z}},
            {"layers", layers},
            {"steps", scene.steps},
            {"frames", frame_count(scene)},
            {"scene_hash", scene_hash(scene)},
            {"warnings", warnings(scene)},
            {"keys_without_effect", keys_without_effect(scene)},
            {"memory_bytes", memory_estimate_bytes(scene)},
            {"memory_bytes_without_pictures", memory_estimate_bytes(scene, RunParts::density)},
            {"memory_bytes_statistics_only", memory_estimate_bytes(scene, RunParts::statistics)}};
}

std::string cells_text(const Extent& cells) {
    return fmt::format("{} x {} x {} cells", cells.x, cells.y, cells.z);
}

std::string kind_text(const LayerOptions& layer) {
    if (layer.is_veil) return "veil of " + cells_text(layer.extent);
    return layer.automaton ? cells_text(layer.extent) : "drawn directly";
}

std::string summary(const std::string& file, const Scene& scene) {
    std::vector<std::string> lattices;
    for (const LayerOptions& layer : scene.layers) {
        lattices.push_back(fmt::format("{} ({})", layer.name, kind_text(layer)));
    }
    if (lattices.empty()) lattices.push_back(cells_text(scene.automaton.extent));
    return fmt::format("{}: valid: {}, {} steps, {} frames, up to {} of memory, scene hash {}", file,
                       fmt::join(lattices, ", "), scene.steps, frame_count(scene),
                       bytes_text(memory_estimate_bytes(scene)), scene_hash(scene));
}

int validate(const ValidateArguments& a) {
    Output output;
    Json results = Json::array();
    int status = 0;
    bool unreadable = false;
    for (const std::string& file : a.files) {
        SceneArguments one = a.scene;
        one.file = file;
        try {
            const Scene scene = load_scene(one);
            check_files(scene);
            print_warnings(scene);
            for (const std::string& note : keys_without_effect(scene)) print_note(file + ": " + note);
            if (a.print) {
                output.write(to_toml(scene));
            } else if (a.work.json) {
                results.push_back(scene_json(file, scene));
            } else {
                output.line(summary(file, scene));
            }
        } catch (const SceneErrors& errors) {
            status = std::max(status, int(errors.code()));
            if (a.work.json) {
                Json problems = Json::array();
                for (const Problem& problem : errors.problems()) problems.push_back(problem_json(problem));
                results.push_back({{"file", file}, {"valid", false}, {"problems", problems}});
            } else {
                print_scene_errors(errors);
            }
        } catch (const Error& error) {  // cannot be read
            unreadable = true;
            print_error(error);
            results.push_back({{"file", file}, {"valid", false}, {"error", error.what()}});
        }
    }
    if (a.work.json) output.line(json_text(results));
    return unreadable ? int(ErrorCode::io) : status;
}

}  // namespace

void add_validate_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("validate", "Check scenes: every problem at once, with its place");
    const auto a = std::make_shared<ValidateArguments>();
    command->add_option("SCENE", a->files, "Scene files (TOML)")->required()->type_name("SCENE");
    add_scene_changes(*command, a->scene);
    CLI::Option* print =
        command->add_flag("--print", a->print, "Print the scene with every key and default spelled out");
    add_json(*command, a->work);
    command->get_option("--json")->excludes(print);
    command->footer(
        "Exit status 0: all scenes are valid; 2: at least one is not; 3: at least one cannot be read, or a file that it\n"
        "names.\n"
        "\n"
        "Examples:\n"
        "  nephos validate scenes/*.toml\n"
        "  nephos validate my-scene.toml --set field.background.hum=0.2 --print");
    command->callback([a, &action] { action = [a] { return validate(*a); }; });
}

}  // namespace nephos
