// SPDX-License-Identifier: Apache-2.0

// nephos state: the automaton's bits after some steps, as a VDB file that can be looked at, changed and
// started from.

#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "density/statistics.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/errors.h"
#include "scenes/format/named_files.h"
#include "scenes/format/writer.h"
#include "simulation/frame_writer.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

struct StateArguments {
    SceneArguments scene;
    std::optional<std::uint64_t> steps;
    std::string from, out, layer;
    WorkArguments work;
};

// The layer whose bits are wanted: the one of the name, or the only one.
std::size_t chosen_layer(const StateArguments& a, const std::vector<LayerSimulation>& layers) {
    std::vector<std::string_view> names;
    for (std::size_t n = 0; n < layers.size(); ++n) {
        if (layers[n].automaton() == nullptr) continue;
        if (layers[n].name() == a.layer || (a.layer.empty() && layers.size() == 1)) return n;
        if (!layers[n].name().empty()) names.push_back(layers[n].name());
    }
    const bool has_any = std::ranges::any_of(
        layers, [](const LayerSimulation& layer) { return layer.automaton() != nullptr; });
    if (!has_any)
        throw Error(ErrorCode::usage,
                    a.scene.file + ": has no layer with an automaton, whose bits a state is");
    if (names.empty() && !a.layer.empty())
        throw Error(ErrorCode::usage, a.scene.file + ": has no layers: leave out --layer '" + a.layer + "'");
    const std::string_view meant = closest_word(a.layer, names);
    throw Error(ErrorCode::usage,
                a.layer.empty() ? fmt::format("{}: has several layers: give --layer, one of {}", a.scene.file,
                                              fmt::join(names, ", "))
                : meant.empty()
                    ? fmt::format("{}: has no layer '{}' with an automaton (those that have one: {})",
                                  a.scene.file, a.layer, fmt::join(names, ", "))
                    : fmt::format("{}: has no layer '{}' with an automaton, did you mean '{}'?", a.scene.file,
                                  a.layer, meant));
}

int state(const StateArguments& a) {
    start_threads(a.work.threads);
    const Scene scene = load_scene(a.scene, SceneUse::without_frames);
    refuse_to_replace(a.scene.file, a.out);
    refuse_to_replace(a.from, a.out);
    refuse_to_replace_files_of(scene, a.out);
    refuse_to_replace_listed_file(a.out);
    std::vector<LayerSimulation> layers = start_layers(scene, a.scene.file, a.from);
    const Automaton& automaton = *layers[chosen_layer(a, layers)].automaton();
    const std::uint64_t steps = a.steps.value_or(scene.steps);
    {
        ProgressBar bar("step", 0, steps, !a.work.quiet);
        for (std::uint64_t step = 0; step < steps; ++step) {
            for (LayerSimulation& layer : layers) layer.step();
            bar.update(step + 1);
        }
    }
    VdbContent content;
    content.hum = automaton.hum();
    content.act = automaton.act();
    content.cld = automaton.cld();
    content.cells = automaton.options().placement;
    const VdbMetadata metadata =
        density_metadata(scene, frames_hash(scene), automaton.time_s(), automaton.hash());
    write_vdb(a.out, content, metadata);

    const CloudStatistics statistics =
        cloud_statistics(automaton.hum(), automaton.act(), automaton.cld(), automaton.options().placement);
    Output output;
    if (a.work.json) {
        const nlohmann::ordered_json json = {
            {"file", a.out},         {"steps", steps},        {"hash", metadata.state_hash},
            {"hum", statistics.hum}, {"act", statistics.act}, {"cld", statistics.cld}};
        output.line(json_text(json));
    } else {
        output.line(fmt::format("{} {}", steps, metadata.state_hash));
    }
    return 0;
}

}  // namespace

void add_state_command(CLI::App& app, Action& action) {
    CLI::App* command =
        app.add_subcommand("state", "Write the automaton's bits after some steps as a VDB file");
    const auto a = std::make_shared<StateArguments>();
    add_scene_arguments(*command, a->scene);
    add_value(*command, "-o,--out", "FILE.vdb", "VDB file to write: the bool grids hum, act and cld",
              [a](const std::string& text) {
                  if (text.empty()) throw Error(ErrorCode::usage, "'': expected the path of a file");
                  a->out = text;
              })
        ->required();
    add_value(*command, "-n,--steps", "N", "Steps to take (default: the scene's)",
              [a](const std::string& text) { a->steps = parse_unsigned(text, 0, kMaxSteps); });
    command
        ->add_option("--from", a->from,
                     "VDB file with such grids to start from, instead of the scene's start")
        ->type_name("FILE.vdb");
    command->add_option("--layer", a->layer, "Layer whose bits are written, in a scene with several")
        ->type_name("NAME");
    add_threads(*command, a->work);
    add_json(*command, a->work);
    add_quiet(*command, a->work);
    command->footer(
        "Prints `step hash` of the state that was written. Steps count from the start that was given, and so "
        "do wind\n"
        "and randomness: a run that is to go on exactly where it stopped is what `nephos run --resume` is "
        "for.\n"
        "\n"
        "Examples:\n"
        "  nephos state scenes/cumulus.toml --steps 100 --out state.vdb\n"
        "  nephos state scenes/cumulus.toml --steps 50 --from state.vdb --out later.vdb");
    command->callback([a, &action] { action = [a] { return state(*a); }; });
}

}  // namespace nephos
