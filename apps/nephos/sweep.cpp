// SPDX-License-Identifier: Apache-2.0

// nephos sweep and nephos merge: many runs of a scene, and their tables.

#include "study/sweep.h"

#include <algorithm>
#include <memory>
#include <thread>
#include <utility>

#include "study/folder_contents.h"
#include "study/folder_guard.h"
#include "study/shard_files.h"
#include "study/sweep_file.h"
#include "study/tables.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/emit.h"
#include "apps/nephos/terminal.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/text.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

struct SweepArguments {
    SceneArguments scene;
    std::string out, layer;
    std::vector<std::string> axes;
    std::optional<Design> design;
    std::optional<std::uint64_t> points, replicates, seed;
    bool common_seeds = false, dry_run = false, status = false, retry_failed = false, fail_fast = false,
         allow_failures = false, overwrite = false, tracks = false;
    std::optional<std::pair<std::uint64_t, std::uint64_t>> steps;
    std::optional<StopAt> until;
    std::optional<std::uint64_t> clouds_every;
    std::uint32_t shard = 0, shards = 1;
    std::optional<Engine> emit;
    std::uint32_t tasks = 16;
    int workers = 0;
    WorkArguments work;
};

std::pair<std::uint64_t, std::uint64_t> parse_steps(const std::string& text) {
    const std::size_t dots = text.find("..");
    const std::uint64_t min = parse_unsigned(text.substr(0, dots), 20, kMaxSteps);
    if (dots == text.npos) return {min, min};
    return {min, parse_unsigned(text.substr(dots + 2), min, kMaxSteps)};
}

Design parse_design(const std::string& text) {
    for (const Design design :
         {Design::grid, Design::list, Design::random, Design::latin_hypercube, Design::sobol})
        if (text == design_name(design)) return design;
    throw Error(ErrorCode::usage,
                fmt::format("'{}' is not one of grid, list, random, latin_hypercube and sobol", text));
}

void parse_shard(const std::string& text, SweepArguments& a) {
    const std::size_t slash = text.find('/');
    if (slash == text.npos) throw Error(ErrorCode::usage, fmt::format("'{}' is not like 0/4", text));
    a.shards = std::uint32_t(parse_unsigned(text.substr(slash + 1), 1, 100'000));
    a.shard = std::uint32_t(parse_unsigned(text.substr(0, slash), 0, a.shards - 1));
}

// A sweep file, or a scene with axes; what the command line names comes on top of both.
SweepOptions options_of(const SweepArguments& a) {
    SweepOptions options = read_sweep_file_or_scene(a.scene.file);
    if (options.source && !a.steps) {
        const Scene scene = options.source->read(a.scene.overrides, SceneUse::without_frames);
        const std::uint64_t steps = std::max<std::uint64_t>(20, scene.steps);
        options.steps = {steps, 10 * steps, {}};
    }
    options.overrides.insert(options.overrides.end(), a.scene.overrides.begin(), a.scene.overrides.end());
    for (const std::string& axis : a.axes) options.axes.push_back(parse_axis(axis));
    if (a.design) {
        options.design = *a.design;
        options.places.design = {};
    }
    if (a.points) {
        options.points = *a.points;
        options.places.points = {};
    }
    if (a.points && !a.design && options.design == Design::grid) {
        for (const Axis& axis : options.axes)
            if (!axis.values.empty())
                throw Error(ErrorCode::usage,
                            fmt::format("--points {}: takes points from ranges, and the axis {} has values: expected "
                                        "{}=FROM..TO, or a grid of its values without --points",
                                        *a.points, fmt::join(axis.keys, "+"), fmt::join(axis.keys, "+")));
        options.design = Design::sobol;
    }
    if (a.replicates) options.replicates = std::uint32_t(*a.replicates);
    if (a.scene.seed) options.seed = *a.scene.seed;
    if (a.common_seeds) options.common_seeds = true;
    if (a.steps) options.steps = {a.steps->first, a.steps->second, options.steps.until};
    if (a.until) {
        options.steps.until = a.until;
        options.places.until = {};
    }
    if (a.clouds_every) options.clouds_every = int(*a.clouds_every);
    if (a.tracks) {
        options.tracks = true;
        options.places.tracks = {};
    }
    if (!a.layer.empty()) {
        options.layer = a.layer;
        options.places.layer = {};
    }
    return options;
}

std::string describe(const SweepPlan& plan) {
    std::vector<std::string> axes;
    for (const Axis& axis : plan.options().axes)
        axes.push_back(axis.values.empty()
                           ? fmt::format("{} from {} to {}", fmt::join(axis.keys, "+"),
                                         number_text(axis.from), number_text(axis.to))
                           : fmt::format("{}: {} values", fmt::join(axis.keys, "+"), axis.values.size()));
    const StepRules& steps = plan.options().steps;
    return fmt::format("{} {} ({}{}{}) x {} replicates = {} runs of {}{} steps", human_count(plan.points()),
                       plan.points() == 1 ? "point" : "points", design_name(plan.options().design),
                       axes.empty() ? "" : "; ", fmt::join(axes, ", "), plan.options().replicates,
                       human_count(plan.runs()), steps.min,
                       steps.max > steps.min ? fmt::format(" to {}", steps.max) : "");
}

nlohmann::ordered_json report_json(const SweepPlan& plan, const SweepReport& report,
                                   const std::string& folder) {
    return {{"folder", folder},
            {"points", plan.points()},
            {"runs", report.progress.in_all},
            {"done", report.progress.done - report.progress.failed},
            {"failed", report.progress.failed},
            {"before", report.progress.before},
            {"unused", report.unused},
            {"complete", report.complete},
            {"problems", report.problems},
            {"wall_s", report.wall_s}};
}

void print_failures(const SweepReport& report, const std::string& folder) {
    for (const std::string& failure : report.failures) print_message("  " + failure + "\n");
    if (report.progress.failed > 0)
        print_note(
            fmt::format("{} of {} runs failed; {}/failures.csv, once the tables are made, has them with the "
                        "command that repeats each, --retry-failed runs them again",
                        report.progress.failed, report.progress.in_all, folder));
}

void print_unused(std::uint64_t records, const std::string& folders) {
    if (records > 0)
        print_note(fmt::format("{}: {} records are of other points or rules; they stay, and are in no table",
                               folders, records));
}

// Points that have no mean, and those whose errors disagree, are said and not left to the table.
void print_warnings_of_points(const SweepPlan& plan, const Records& records) {
    std::uint64_t unsteady = 0, differ = 0;
    for (std::uint64_t point = 0; point < plan.points(); ++point) {
        const PointSummary summary = summarise(plan, records, point);
        unsteady += summary.regimes[std::size_t(Regime::not_steady)] > 0;
        differ += summary.statistics[0].errors_differ;
    }
    if (unsteady > 0)
        print_note(
            fmt::format("{} of {} points have runs that are not steady, and no means: give more --steps",
                        unsteady, plan.points()));
    if (differ > 0)
        print_note(fmt::format(
            "at {} of {} points the errors of cover between seeds and within the runs differ 3-fold "
            "(column cover_errors_differ)",
            differ, plan.points()));
}

// `report`: the arguments of the command that shows the records.
void write_and_print_tables(const SweepPlan& plan, const Records& records, const std::string& folder,
                            const std::string& report, bool quiet) {
    const std::uint64_t missing = write_tables(plan, records, folder);
    if (quiet) return;
    print_warnings_of_points(plan, records);
    if (missing > 0) print_note(fmt::format("{} of {} runs are missing yet", missing, plan.runs()));
    Output output;
    output.line(
        fmt::format("{0}/points.csv  a row a point: means, 95 % intervals, regimes\n"
                    "{0}/runs.csv    a row a run\n"
                    "{0}/series.nc   every step of every run (NetCDF)\n"
                    "`nephos report {1}` shows them as one page",
                    folder, report));
}

int sweep(const SweepArguments& a) {
    start_threads(1);  // parallelism is between runs; and workers are forked from one thread
    const SweepPlan plan(options_of(a));
    SweepJob job;
    job.folder = a.out.empty() ? "out/sweep-" + std::filesystem::path(a.scene.file).stem().string() : a.out;
    job.workers = a.workers > 0 ? a.workers : int(std::max(1u, std::thread::hardware_concurrency()));
    job.shard = a.shard;
    job.shards = a.shards;
    job.retry_failed = a.retry_failed;
    job.fail_fast = a.fail_fast;
    job.overwrite = a.overwrite;
    const std::string folder = job.folder.string();
    Output output;
    if (a.emit && (a.dry_run || a.status))
        throw Error(ErrorCode::usage,
                    "--emit writes files, and --dry-run and --status only tell: give one of them");
    if (a.dry_run || a.status) {
        const SweepReport report = sweep_status(plan, job);
        const int status = report.problems.empty() ? 0 : int(ErrorCode::io);
        print_problems(report.problems);
        if (a.work.json) {
            output.line(json_text(report_json(plan, report, folder)));
            return status;
        }
        output.line(describe(plan));
        output.line(fmt::format("{}: {} of {} runs done, {} failed", folder,
                                human_count(report.progress.done - report.progress.failed),
                                human_count(report.progress.in_all), report.progress.failed));
        for (std::uint64_t n = 0; a.dry_run && n < std::min<std::uint64_t>(plan.runs(), 10); ++n)
            output.line(fmt::format("  point {} replicate {}: {}", plan.run(n).point, plan.run(n).replicate,
                                    plan.options_of(plan.run(n))));
        if (a.dry_run && plan.runs() > 10)
            output.line(fmt::format("  ... and {} more", human_count(plan.runs() - 10)));
        return status;
    }
    if (a.allow_failures && a.fail_fast)
        throw Error(ErrorCode::usage, "--allow-failures goes on where --fail-fast ends: give one of them");
    if (a.emit && a.shards > 1)
        throw Error(ErrorCode::usage,
                    "--emit writes all shards: leave out --shard, and give their number as --tasks");
    if (a.emit &&
        (a.retry_failed || a.fail_fast || a.allow_failures || a.overwrite || a.workers > 0 || a.work.json))
        throw Error(
            ErrorCode::usage,
            "--emit runs nothing: leave out --retry-failed, --fail-fast, --allow-failures, --overwrite, "
            "--workers and --json, and write those that are wanted into the script");
    if (a.emit) {
        const std::string next = emit_sweep(plan, *a.emit, a.tasks, job.folder);
        if (!a.work.quiet) print_note(describe(plan));
        output.line(next);
        return 0;
    }
    if (!a.work.quiet && !a.work.json) print_note(describe(plan));
    std::unique_ptr<ProgressBar> bar;
    defer_signals();
    SweepReport report = run_sweep(
        plan, job,
        [&](const SweepProgress& progress) {
            if (!bar)
                bar = std::make_unique<ProgressBar>("run", progress.before, progress.in_all, !a.work.quiet);
            bar->update(progress.done, progress.failed > 0 ? fmt::format("{} failed", progress.failed) : "");
        },
        [] { return pending_signal() != 0; });
    bar.reset();
    print_problems(report.problems);
    if (!a.work.quiet) print_unused(report.unused, folder);
    if (a.work.json) output.line(json_text(report_json(plan, report, folder)));
    const bool quiet = a.work.quiet || a.work.json;
    const auto stopped = [&] {
        print_note(fmt::format("stopped after {} of {} runs; the same command{} goes on",
                               report.progress.done, report.progress.in_all,
                               a.overwrite ? " without --overwrite" : ""));
        return 128 + pending_signal();
    };
    if (pending_signal() != 0) return stopped();
    print_failures(report, folder);  // whatever becomes of the tables
    if (job.shards == 1) {
        const FolderGuard guard(job.folder, [] { return pending_signal() != 0; });
        if (!guard.is_held()) return stopped();
        if (!is_plan_of(plan, job.folder))
            throw Error(ErrorCode::io,
                        folder + ": another plan took the place of this one: no tables are written");
        const Records records = report.records ? std::move(*report.records) : Records::read({job.folder});
        const bool is_new = std::ranges::any_of(records.problems(), [&](const std::string& problem) {
            return std::ranges::count(report.problems, problem) == 0;
        });
        if (is_new) {  // what could be read before the runs cannot be read now
            print_problems(records.problems());
            throw Error(ErrorCode::io, folder + ": not all records can be read: no tables are written");
        }
        write_and_print_tables(plan, records, folder, folder, quiet);
    } else if (!quiet) {
        output.line(fmt::format("shard {} of {} is done; when all are, `nephos merge {}` makes the tables",
                                job.shard, job.shards, folder));
    }
    if (!report.problems.empty()) return int(ErrorCode::io);
    return report.progress.failed > 0 && !a.allow_failures ? int(ErrorCode::check) : 0;
}

struct MergeArguments {
    std::vector<std::string> folders;
    std::string out;
    bool overwrite = false;
    WorkArguments work;
};

// Keeps sweeps from making other tables of a folder from before the plan and the records are read until those of merge are
// written. None where no sweep has been, or may be: where its lock cannot be written, no shard can.
std::unique_ptr<FolderGuard> guard_of_tables(const std::filesystem::path& folder) {
    std::unique_ptr<FolderGuard> guard;
    try {
        if (is_there(folder / "shards")) guard = std::make_unique<FolderGuard>(folder);
    } catch (const Error&) {
    }
    return guard;
}

int merge(const MergeArguments& a) {
    start_threads(1);
    const std::string out = a.out.empty() ? a.folders.front() : a.out;
    const std::unique_ptr<FolderGuard> guard = guard_of_tables(out);
    const SweepPlan plan = plan_of_folder(a.folders.front());
    std::vector<std::filesystem::path> folders(a.folders.begin(), a.folders.end());
    const Records records = records_of_folders(plan, folders);
    print_problems(records.problems());
    require_sweep_folder(out);
    const LostRuns lost = a.overwrite ? LostRuns{} : runs_lost(plan, records, out);
    if (lost.unreadable > 0)
        throw Error(ErrorCode::io,
                    fmt::format("{}/runs.csv has {} runs that are in no shard that can be read: the "
                                "tables stay as they are; --overwrite replaces them",
                                out, lost.unreadable));
    if (lost.of_another_plan > 0)
        throw Error(ErrorCode::io,
                    fmt::format("{}/runs.csv has {} runs that {}/sweep.toml does not ask for: the tables of "
                                "another plan stay as they are; --overwrite replaces them",
                                out, lost.of_another_plan, a.folders.front()));
    if (!a.overwrite && has_shards(out) && !has_runs_of(plan, out))
        throw Error(ErrorCode::usage, out + ": holds the records of a sweep of another plan than " +
                                          a.folders.front() +
                                          ": expected another --out for these tables, or --overwrite");
    const std::string sources = fmt::format("{}", fmt::join(a.folders, " "));
    if (!a.work.quiet) print_unused(unused_records(plan, records), sources);
    const bool in_place = a.folders.size() == 1 && out == a.folders.front();
    if (!in_place) write_plan_of_tables(plan, out);
    write_and_print_tables(plan, records, out,
                           in_place ? out : fmt::format("{} --out {}/report.html", sources, out), a.work.quiet);
    return records.problems().empty() ? 0 : int(ErrorCode::io);
}

}  // namespace

void add_sweep_command(CLI::App& app, Action& action) {
    CLI::App* command =
        app.add_subcommand("sweep", "Many runs of a scene over values of its keys: tables with error bars");
    const auto a = std::make_shared<SweepArguments>();
    command->add_option("SCENE", a->scene.file, "Scene, or sweep file (TOML with a key `scene`)")
        ->required()
        ->type_name("SCENE");
    add_scene_changes(*command, a->scene);
    command->get_option("--seed")->description(
        "Seed that those of all runs are made of (default: 1); the scene's is not used");
    add_out_folder(*command, a->out, "Folder to write to (default: out/sweep-NAME)");
    command
        ->add_option("--axis", a->axes,
                     "A key and its values: KEY=V,V,.. or KEY=FROM..TO:COUNT or KEY=log:FROM..TO:COUNT; "
                     "without COUNT a "
                     "range for a sampled design; KEY+KEY=.. moves keys together; may be repeated")
        ->type_name("AXIS")
        ->expected(1)
        ->allow_extra_args(false)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    add_value(*command, "--design", "NAME", "grid (default), list, random, latin_hypercube or sobol",
              [a](const std::string& text) { a->design = parse_design(text); });
    add_value(*command, "--points", "N", "Number of points of a sampled design (alone: sobol)",
              [a](const std::string& text) { a->points = parse_unsigned(text, 1, 10'000'000); });
    add_value(*command, "-r,--replicates", "N", "Runs of a point, with a seed each (default: 5)",
              [a](const std::string& text) { a->replicates = parse_unsigned(text, 1, 100'000); });
    command->add_flag("--common-seeds", a->common_seeds, "Replicate r has the same seed at all points");
    add_value(*command, "--steps", "A[..B]",
              "At least A steps, and up to B while a run is not steady (default: the scene's, up to ten "
              "times as many)",
              [a](const std::string& text) { a->steps = parse_steps(text); });
    add_value(*command, "--until", "STAT.se=X",
              "Go on, up to B steps, until the standard error of a statistic is X",
              [a](const std::string& text) { a->until = parse_stop(text); });
    add_value(*command, "--clouds-every", "N",
              "Steps between snapshots whose clouds are measured (default: 10; 0: none)",
              [a](const std::string& text) { a->clouds_every = parse_unsigned(text, 0, 1'000'000); });
    command->add_flag(
        "--tracks", a->tracks,
        "Follow clouds from step to step: births, deaths, splits, mergers, lifetimes (tracks.csv)");
    command->add_option("--layer", a->layer, "Layer whose lattice is measured, in a scene with several")
        ->type_name("NAME");
    add_value(*command, "-j,--workers", "N",
              "Runs at a time, each in a process with one thread (default: all cores)",
              [a](const std::string& text) { a->workers = int(parse_unsigned(text, 1, 1024)); });
    add_value(*command, "--shard", "I/N",
              "Only the I-th of N parts of the runs, I from 0; `nephos merge` makes the tables",
              [a](const std::string& text) { parse_shard(text, *a); });
    CLI::Option* emit = add_value(
        *command, "--emit", "ENGINE",
        "Run nothing, write what slurm, snakemake or parallel needs to run the sweep on many machines",
        [a](const std::string& text) { a->emit = parse_engine(text); });
    add_value(*command, "--tasks", "N",
              "With --emit: parts of the sweep, each a task of the engine (default: 16)",
              [a](const std::string& text) { a->tasks = std::uint32_t(parse_unsigned(text, 1, 100'000)); })
        ->needs(emit);
    command->add_flag("--dry-run", a->dry_run, "Only check all values, and print what would be run");
    command->add_flag("--status", a->status, "Only print how many runs are done");
    command->add_flag("--retry-failed", a->retry_failed, "Run again what failed");
    command->add_flag("--fail-fast", a->fail_fast, "End at the first run that fails");
    command->add_flag("--allow-failures", a->allow_failures,
                      "Runs that fail are no failure of the sweep: status 0, and failures.csv has them");
    command->add_flag("--overwrite", a->overwrite,
                      "Throw the records in the folder away first, with --shard those of the shard");
    add_json(*command, a->work);
    add_quiet(*command, a->work);
    command->footer(
        "Writes DIR/points.csv (a row a point), runs.csv (a row a run), series.nc (every step), failures.csv "
        "and\n"
        "manifest.json; docs/research.md defines every column. The same command goes on where it was "
        "stopped, and\n"
        "computes only what is missing when an axis has grown. Means are given of steady and of pulsing runs "
        "only.\n"
        "Exit status 1: some runs failed; the others are in the tables. 3: a shard is damaged, and named;\n"
        "also with --status and --dry-run.\n"
        "\n"
        "Examples:\n"
        "  nephos sweep fair.toml --axis field.background.ext=0.05,0.1,0.2 --replicates 5 --out sweep\n"
        "  nephos sweep fair.toml --axis field.background.ext=0.05..0.4:8 --axis "
        "field.background.act=log:1e-6..1e-2:5\n"
        "  nephos sweep fair.toml --axis field.background.ext=0.05..0.4 --points 64 --until cover.se=0.002\n"
        "  nephos sweep PLAN.toml --out sweep --shard 2/4");
    command->callback([a, &action] { action = [a] { return sweep(*a); }; });
}

void add_merge_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("merge", "Make the tables of a sweep from its shards");
    const auto a = std::make_shared<MergeArguments>();
    command->add_option("DIR", a->folders, "Folders of the sweep; the plan is that of the first")
        ->required()
        ->type_name("DIR");
    add_out_folder(*command, a->out, "Folder for the tables (default: the first)");
    command->add_flag("--overwrite", a->overwrite,
                      "Replace tables that have more runs than the shards, or those of another plan");
    add_quiet(*command, a->work);
    command->footer(
        "The tables have the same bytes for any number of shards, in any order. A damaged shard is named, "
        "and "
        "the\n"
        "tables are made of what can be read; exit status 3. Tables that have more runs stay as they are.\n"
        "\n"
        "Examples:\n"
        "  nephos merge sweep\n"
        "  nephos merge host-a/sweep host-b/sweep --out tables");
    command->callback([a, &action] { action = [a] { return merge(*a); }; });
}

}  // namespace nephos
