// SPDX-License-Identifier: Apache-2.0

// nephos fit: parameters for targets, with their uncertainty.

#include <algorithm>
#include <memory>
#include <thread>

#include "study/fit_folder.h"
#include <fmt/format.h>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"

namespace nephos {
namespace {

struct FitArguments {
    std::string file, out;
    std::optional<std::uint64_t> runs;
    int workers = 0;
    bool retry_failed = false, overwrite = false;
    WorkArguments work;
};

int fit(const FitArguments& a) {
    start_threads(1);  // workers are forked from one thread
    const FitOptions options = read_fit_file(a.file, a.runs);
    if (!a.work.quiet)
        for (const std::string& note : options.notes) print_note(note);
    SweepJob job;
    job.folder = a.out.empty() ? "out/fit-" + std::filesystem::path(a.file).stem().string() : a.out;
    job.workers = a.workers > 0 ? a.workers : int(std::max(1u, std::thread::hardware_concurrency()));
    job.retry_failed = a.retry_failed;
    job.overwrite = a.overwrite;
    std::unique_ptr<ProgressBar> bar;
    int shown = 0;
    defer_signals();
    const std::optional<FitResult> result = run_fit(
        options, job,
        [&](int wave, const SweepProgress& progress) {
            if (wave != shown) {
                bar.reset();
                bar = std::make_unique<ProgressBar>("run", progress.before, progress.in_all, !a.work.quiet);
                shown = wave;
            }
            bar->update(progress.done, wave == 4 ? "proof" : fmt::format("wave {} of 3", wave));
        },
        [] { return pending_signal() != 0; });
    bar.reset();
    if (!result) {
        print_note(a.overwrite ? "stopped; the same command without --overwrite goes on"
                               : "stopped; the same command goes on");
        return 128 + pending_signal();
    }
    print_problems(result->problems);
    const int status = !result->problems.empty() ? int(ErrorCode::io)
                       : result->failed > 0      ? int(ErrorCode::check)
                                                 : 0;
    if (a.work.quiet) {
        if (result->failed > 0) print_note(failed_runs_text(*result));
        return status;
    }
    Output output;
    output.write(fit_text(options, *result));
    const std::string folder = job.folder.string();
    output.line(
        fmt::format("\n{0}/fitted.toml    the scene with the best parameters\n"
                    "{0}/posterior.csv  1,000 equally likely parameters\n"
                    "{0}/fit.json       all of the above",
                    folder));
    return status;
}

}  // namespace

void add_fit_command(CLI::App& app, Action& action) {
    CLI::App* command =
        app.add_subcommand("fit", "Find the parameters of a scene that meet targets, with uncertainty");
    const auto a = std::make_shared<FitArguments>();
    command->add_option("FILE", a->file, "Fit file (TOML): scene, parameters with priors, targets")
        ->required()
        ->type_name("FILE");
    add_out_folder(*command, a->out, "Folder to write to (default: out/fit-NAME)");
    add_value(*command, "--runs", "N", "Runs without the proof, instead of the file's",
              [a](const std::string& text) { a->runs = parse_unsigned(text, 8, 1'000'000); });
    add_value(*command, "-j,--workers", "N",
              "Runs at a time, each in a process with one thread (default: all cores)",
              [a](const std::string& text) { a->workers = int(parse_unsigned(text, 1, 1024)); });
    command->add_flag("--retry-failed", a->retry_failed, "Run again what failed");
    command->add_flag("--overwrite", a->overwrite,
                      "Throw the records of an earlier fit in the folder away first");
    add_quiet(*command, a->work);
    command->footer(
        "The file:\n"
        "  scene = \"fair.toml\"\n"
        "  runs = 64\n"
        "  [[parameter]]\n"
        "  key = \"field.background.ext\"\n"
        "  prior = { from = 0.03, to = 0.4, scale = \"log\" }\n"
        "  [[target]]\n"
        "  statistic = \"cover\"\n"
        "  value = 0.3\n"
        "  sd = 0.015\n"
        "\n"
        "Exit status 1: some runs failed, and told nothing; 3: records are damaged, and named.\n"
        "\n"
        "The same command goes on where it was stopped. docs/research.md explains the method and every key.\n"
        "\n"
        "Examples:\n"
        "  nephos fit cover.toml --out fit\n"
        "  nephos run fit/fitted.toml --out clouds");
    command->callback([a, &action] { action = [a] { return fit(*a); }; });
}

}  // namespace nephos
