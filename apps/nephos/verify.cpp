// SPDX-License-Identifier: Apache-2.0

// nephos verify: whether the folder of a run or of an export is whole and says the truth.

#include "simulation/verify.h"

#include <algorithm>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "simulation/export/export.h"
#include "simulation/run_listing.h"

namespace nephos {
namespace {

struct VerifyArguments {
    std::string folder, against;
    VerifyOptions options;
    WorkArguments work;
};

Verification verify_folder(const VerifyArguments& a) {
    if (is_run_folder(a.folder)) return verify_run(a.folder, a.options);
    if (is_export_folder(a.folder)) return verify_export(a.folder, a.options);
    throw Error(ErrorCode::io,
                a.folder + ": holds neither a run (manifest.json) nor an export (export.json)");
}

void print(const VerifyArguments& a, const Verification& result) {
    Output output;
    if (a.work.json) {
        nlohmann::ordered_json checks = nlohmann::ordered_json::array();
        for (const Check& check : result.checks) {
            nlohmann::ordered_json json = {{"name", check.name},
                                           {"passed", check.passed},
                                           {"done", check.done},
                                           {"detail", check.detail}};
            for (const auto& [name, value] : check.figures) json["figures"][name] = value;
            checks.push_back(std::move(json));
        }
        output.line(json_text(
            {{"folder", a.folder}, {"kind", result.kind}, {"passed", result.passed()}, {"checks", checks}}));
    } else if (!a.work.quiet || !result.passed()) {
        const bool colours = colours_on(stdout);
        for (const Check& check : result.checks) {
            output.write_styled(fmt::format("  {}  {:9} {}\n",
                                            check.passed  ? "ok  "
                                            : !check.done ? "none"
                                                          : styled("FAIL", Style::red, colours),
                                            check.name, escaped_lines(check.detail)));
        }
    }
    output.flush();
}

int verify(const VerifyArguments& a) {
    if (a.options.hashes_only && (a.options.seam || a.options.max_change))
        throw Error(ErrorCode::usage, "--hashes decodes nothing: leave it out, or --seam and --max-change");
    start_threads(a.work.threads);
    const Verification result = verify_folder(a);
    print(a, result);
    if (result.passed()) return 0;
    if (!result.failed()) {
        const auto none = std::ranges::find(result.checks, false, &Check::done);
        throw Error(ErrorCode::io,
                    fmt::format("{}: nothing is wrong, but the check `{}` could not be done: {}", a.folder,
                                none->name, none->detail));
    }
    throw Error(ErrorCode::check, a.folder + ": the " + result.kind + " is not what it claims to be");
}

}  // namespace

void add_verify_command(CLI::App& app, Action& action) {
    CLI::App* command =
        app.add_subcommand("verify", "Check the files of a run or an export against their checksums");
    const auto a = std::make_shared<VerifyArguments>();
    command->add_option("DIR", a->folder, "Folder of a run (manifest.json) or of an export (export.json)")
        ->required()
        ->type_name("DIR");
    command->add_flag("--hashes", a->options.hashes_only,
                      "Compare the files' checksums alone; decode nothing");
    command
        ->add_option_function<std::string>(
            "--against", [a](const std::string& text) { a->options.against = text; },
            "Another run that must have the same states and voxels, by its tables and manifest")
        ->type_name("DIR");
    add_value(*command, "--replay", "N",
              "Simulate the first N frames anew and compare states, and voxels of files that are not refined",
              [a](const std::string& text) { a->options.replay = int(parse_integer(text, 1, kMaxFrames)); });
    command->add_flag(
        "--seam", a->options.seam,
        "Demand that density goes on across both horizontal axes, periodic or not, as it does inside, "
        "in the mean of all frames (docs/flight-simulators.md, Tiles)");
    add_value(*command, "--max-change", "X", "Largest change of a voxel from frame to frame that passes",
              [a](const std::string& text) { a->options.max_change = parse_real(text, 0, 1); });
    add_threads(*command, a->work);
    add_json(*command, a->work);
    add_quiet(*command, a->work);
    command->footer(
        "Of a run: no frame or file is missing or extra; bytes and XXH3-128 of each file and of its decoded "
        "voxels are\n"
        "those of the manifest; transform, bounds and class are the same in all files; values are finite, 0 "
        "to 1,\n"
        "in refined files with detail to 1 + `detail.thermals`;\n"
        "metadata agree with the manifest; layers add up to the common grid; the tables of one that is not\n"
        "complete begin with what was saved. Reported: breaks at the seam of periodic axes in the\n"
        "last frame, largest change of a voxel and of sharpness; where there is no file of all layers "
        "together\n"
        "(`density.combined`), of the layer that is worst. Of an export: checksums, and the voxels read "
        "back\n"
        "from each file against those of the source, within the error of their type.\n"
        "\n"
        "Exit status 0: everything holds; 1: a check failed; 2: usage, also where --against names no folder\n"
        "of a run; 3: a file cannot be read, or all holds but for a check that was asked for and could not\n"
        "be done: --replay takes the files that the scene names, and of a branch (run --from) the\n"
        "checkpoint that it began with, as they were; --seam and --max-change a box of at most 2^28\n"
        "voxels, and --max-change two frames that follow each other.\n"
        "\n"
        "Examples:\n"
        "  nephos verify out/cumulus\n"
        "  nephos verify out/cumulus --replay 3 --json\n"
        "  nephos verify out/cumulus --against /mnt/other/cumulus --hashes");
    command->callback([a, &action] { action = [a] { return verify(*a); }; });
}

}  // namespace nephos
