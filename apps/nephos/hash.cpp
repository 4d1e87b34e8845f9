// SPDX-License-Identifier: Apache-2.0

// nephos hash: the state hash after every step, to compare machines, versions and thread counts.

#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/random.h"
#include "scenes/format/text.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

struct HashArguments {
    SceneArguments scene;
    std::optional<std::uint64_t> steps;
    std::string from;
    std::string check;
    WorkArguments work;
};

// The lines of a file, to compare with; blank lines and comments (#) left out.
std::vector<std::string> expected_lines(const std::string& path) {
    if (is_named_pipe(path)) throw Error(ErrorCode::io, path + ": is a named pipe");
    std::error_code error;
    const std::filesystem::file_status status = std::filesystem::status(path, error);
    if (std::filesystem::is_character_file(status) || std::filesystem::is_block_file(status))
        throw Error(ErrorCode::io, path + ": is a device: expected a file");
    std::ifstream stream(path);
    if (!stream) throw Error(ErrorCode::io, path + ": cannot open: " + std::strerror(errno));
    constexpr std::size_t kLongest = 4096;  // of a comment; steps and their hashes are far shorter
    std::vector<std::string> lines;
    std::string line(kLongest, '\0');
    std::size_t number = 1;
    for (; stream.getline(line.data(), kLongest); ++number) {
        std::string_view text = line.data();
        if (text.ends_with('\r')) text.remove_suffix(1);
        const std::size_t read =
            std::size_t(stream.gcount()) - (stream.eof() ? 0 : 1);  // without the end of the line
        if (line.find('\0') < read)
            throw Error(ErrorCode::usage, fmt::format("{}:{}: holds a byte that no text has", path, number));
        if (!text.empty() && text.front() != '#') lines.emplace_back(text);
    }
    if (!stream.eof() && !stream.bad())
        throw Error(ErrorCode::usage,
                    fmt::format("{}: line {} has more than {} bytes: expected lines such as `nephos hash` "
                                "prints them",
                                path, number, kLongest - 1));
    if (stream.bad()) throw Error(ErrorCode::io, path + ": cannot read: " + std::strerror(errno));
    return lines;
}

int hash(const HashArguments& a) {
    start_threads(a.work.threads);
    const Scene scene = load_scene(a.scene, SceneUse::without_frames);
    std::vector<std::string> expected;
    if (!a.check.empty()) expected = expected_lines(a.check);
    std::vector<LayerSimulation> layers = start_layers(scene, a.scene.file, a.from);

    const std::uint64_t steps = a.steps.value_or(scene.steps);
    Output output;
    ProgressBar bar("step", 0, steps, !a.work.quiet && a.work.json);
    nlohmann::ordered_json hashes = nlohmann::ordered_json::array();
    for (std::uint64_t step = 0;; ++step) {
        const std::string hash = combined_hash(layers).hex();
        const std::string line = fmt::format("{} {}", step, hash);
        if (!a.check.empty() && (step >= expected.size() || expected[step] != line)) {
            output.flush();
            throw Error(ErrorCode::check,
                        fmt::format("{}: step {} should be '{}', but is '{}'", a.check, step,
                                    step < expected.size() ? shortened(expected[step]) : "(no line)", line));
        }
        if (a.work.json) {
            hashes.push_back(hash);
        } else if (a.check.empty()) {
            output.line(line);
            output.require_reader();
        }
        bar.update(step);
        if (step == steps) break;
        for (LayerSimulation& layer : layers) layer.step();
    }
    bar.clear();
    if (!a.check.empty() && expected.size() != steps + 1) {
        throw Error(ErrorCode::check, fmt::format("{}: has {} steps, but {} were compared", a.check,
                                                  expected.size() - 1, steps));
    }
    if (a.work.json) {
        const nlohmann::ordered_json json = {{"scene", scene.name},
                                             {"seed", std::to_string(scene.automaton.seed)},
                                             {"random_stream_version", kRandomStreamVersion},
                                             {"hashes", hashes}};
        output.line(json_text(json));
    } else if (!a.check.empty()) {
        output.line(fmt::format("{}: steps 0 to {} agree", a.check, steps));
    }
    return 0;
}

}  // namespace

void add_hash_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("hash", "Print the state hash after every step of a scene");
    const auto a = std::make_shared<HashArguments>();
    add_scene_arguments(*command, a->scene);
    add_value(*command, "-n,--steps", "N", "Steps to take (default: the scene's)",
              [a](const std::string& text) { a->steps = parse_unsigned(text, 0, kMaxSteps); });
    command->add_option("--from", a->from, "VDB file with the bool grids hum, act and cld to start from")
        ->type_name("FILE.vdb");
    command->add_option("--check", a->check, "File with the lines to expect; a difference is exit status 1")
        ->type_name("FILE");
    add_threads(*command, a->work);
    add_json(*command, a->work);
    add_quiet(*command, a->work);
    command->footer(
        "Prints a line `step hash` for each of the steps 0 to N. The hash is XXH3-128 of the planes hum, act "
        "and cld\n"
        "(with several layers, of their hashes) and does not depend on threads, instruction set or "
        "compiler.\n"
        "\n"
        "Examples:\n"
        "  nephos hash scenes/cumulus.toml --steps 100 > golden.txt\n"
        "  nephos hash scenes/cumulus.toml --steps 100 --threads 1 --check golden.txt");
    command->callback([a, &action] { action = [a] { return hash(*a); }; });
}

}  // namespace nephos
