// SPDX-License-Identifier: Apache-2.0

// nephos run: a scene to density grids, pictures and statistics.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>

#include "study/run_until.h"
#include "study/sweep_file.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "core/text.h"
#include "simulation/branch.h"
#include "simulation/memory.h"
#include "simulation/run_folder.h"
#include "simulation/run_listing.h"

namespace nephos {
namespace {

struct RunArguments {
    SceneArguments scene;
    std::string out, from;
    std::optional<FrameRange> frames;
    bool no_render = false, statistics_only = false, checkpoint = false, video = false, resume = false,
         overwrite = false, needs = false;
    double checkpoint_every_s = 60;
    std::optional<StopAt> until;
    std::optional<std::uint64_t> max_steps;
    DeviceArguments device;
    WorkArguments work;
};

// The run of an earlier call that this one goes on with.
struct Continued {
    std::optional<BranchPoint> branch;  // where it branched off
    bool has_scene = false;             // SCENE is left out: it is that of the run, in --out
};

Continued continued_run(const RunArguments& a) {
    Continued run;
    if (!a.resume || a.out.empty()) return run;
    run.branch = branch_in(a.out, a.from);
    run.has_scene = a.scene.file.empty() && (run.branch || (a.from.empty() && is_run_folder(a.out)));
    if (run.has_scene && !run.branch && read_run(a.out).branch)
        throw Error(
            ErrorCode::usage,
            a.out +
                ": the run there branched off another one, and left no checkpoint of its own to go on from: "
                "expected --from with the other one");
    return run;
}

Scene scene_of(const RunArguments& a, const Continued& continued) {
    const SceneUse use = a.statistics_only ? SceneUse::without_frames : SceneUse::everything;
    if (a.scene.file.empty() && a.from.empty() && !continued.has_scene)
        throw Error(ErrorCode::usage,
                    "SCENE is missing: expected a scene file, --from with the run to branch off, or "
                    "--resume with the folder of a run as --out");
    Scene scene;
    if (a.scene.file.empty()) {
        const std::string& from = continued.has_scene ? a.out : a.from;
        scene = read_scene_text(scene_text_beside(from), "the scene of " + from, {}, a.scene.overrides, use);
        if (a.scene.seed) scene.automaton.seed = *a.scene.seed;
    } else {
        scene = load_scene(a.scene, use);
    }
    if (!a.needs && !a.work.quiet) print_warnings(scene);
    if (a.video && !scene.frames.enabled)
        throw Error(
            ErrorCode::usage,
            fmt::format("--video: the scene '{}' has no frames (`frames.enabled` = false)", scene.name));
    if (a.video) scene.frames.video = true;
    return scene;
}

// For scripts that install what is missing (./run): the scene and --set decide as much as the options do.
void print_needs(const RunArguments& a) {
    const Scene scene = scene_of(a, continued_run(a));
    Output output;
    const bool render = !a.no_render && !a.statistics_only;
    if (render && wants_pictures(scene) && needs_vulkan(device_options(a.device, scene.frames)))
        output.line("vulkan");
    if (render && wants_video(scene)) output.line("ffmpeg");
}

RunSettings settings_of(const RunArguments& a) {
    const Continued continued = continued_run(a);
    Scene scene = scene_of(a, continued);
    check_memory(scene, a.statistics_only ? RunParts::statistics
                        : a.no_render     ? RunParts::density
                                          : RunParts::pictures);
    const std::string scene_file = continued.has_scene ? read_run(a.out).scene_file : a.scene.file;
    RunSettings settings =
        run_settings(std::move(scene), scene_file,
                     continued.branch || !a.from.empty() ? RunStart::checkpoint : RunStart::first_state);
    settings.statistics_only = a.statistics_only;
    if (a.frames) settings.range = range_of_frames(settings.scene, a.frames->first, a.frames->last);
    if (!a.out.empty()) settings.folder = a.out;
    if (continued.branch && (a.frames || a.until))
        throw Error(ErrorCode::usage, a.out + ": is a branch of another run: leave out --frames and --until");
    if (continued.branch) {
        branch_off(settings, *continued.branch);
    } else if (!a.from.empty()) {
        branch_off(settings, a.from);
    }
    settings.render = !a.no_render && !a.statistics_only;
    settings.device = device_options(a.device, settings.scene.frames);
    settings.resume = a.resume;
    settings.overwrite = a.overwrite;
    settings.checkpoint = !a.statistics_only || a.checkpoint;
    settings.checkpoint_every_s = a.checkpoint_every_s;
    return settings;
}

// What opens a kind of file.
std::string_view opened_by(std::string_view kind) {
    if (kind == "density") return "Blender, Houdini, vdb_view, `nephos render`, `nephos info`";
    if (kind == "png") return "any picture viewer";
    if (kind == "exr") return "Blender, Krita, exrdisplay, `nephos info`";
    if (kind == "video") return "any video player";
    if (kind == "statistics") return "any spreadsheet, pandas, gnuplot";
    if (kind == "manifest") return "any text editor, jq";
    return "`nephos run --resume`, `nephos info`";
}

std::uint64_t total_bytes(const RunFiles& files) {
    std::uint64_t bytes = 0;
    for (const std::filesystem::path& file : files.files) {
        std::error_code error;
        const std::uintmax_t size = std::filesystem::file_size(file, error);
        if (!error) bytes += size;
    }
    return bytes;
}

std::string counted(std::uint64_t number, std::string_view what) {
    return fmt::format("{} {}{}", number, what, number == 1 ? "" : "s");
}

void print_files(Output& output, const RunReport& report) {
    struct Row {
        std::string files, size, opened_by;
    };
    std::vector<Row> rows;
    std::size_t width = 0, size_width = 0;
    for (const RunFiles& files : report.files) {
        std::string name = files.files.front().string();
        if (files.files.size() > 1) name += " .. " + files.files.back().filename().string();
        name = escaped(name);
        rows.push_back({name, bytes_text(total_bytes(files)), std::string(opened_by(files.kind))});
        width = std::max(width, name.size());
        size_width = std::max(size_width, rows.back().size.size());
    }
    const bool colours = colours_on(stdout);
    for (const Row& row : rows) {
        output.write_styled(fmt::format("  {:{}}  {:>{}}  {}\n", row.files, width, row.size, size_width,
                                        styled(row.opened_by, Style::dim, colours)));
    }
}

// "cpu (AVX2, 8 threads)", or "vulkan on" a device.
std::string drawn_by(const RunReport& report) {
    if (report.backend.empty()) return {};
    return ", drawn by " +
           (report.backend == "cpu" ? report.device : report.backend + " on " + report.device);
}

void print_report(const RunReport& report) {
    Output output;
    output.write_styled(
        styled(fmt::format("{}: {}, {} in {}{}", report.scene, counted(report.steps_reported - 1, "step"),
                           counted(std::uint64_t(report.frames), "frame"), human_duration(report.wall_s),
                           drawn_by(report)),
               Style::bold, colours_on(stdout)) +
        "\n");
    print_files(output, report);
}

void print_json(const RunReport& report) {
    nlohmann::ordered_json files = nlohmann::ordered_json::object();
    for (const RunFiles& entry : report.files) {
        nlohmann::ordered_json list = nlohmann::ordered_json::array();
        for (const std::filesystem::path& file : entry.files) list.push_back(file.string());
        files[entry.kind] = list;
    }
    const nlohmann::ordered_json json = {
        {"scene", report.scene},
        {"scene_hash", report.scene_hash},
        {"simulation_hash", report.simulation_hash},
        {"folder", report.folder.string()},
        {"complete", report.complete},
        {"resumed_at_step", report.first_step},
        {"steps", report.steps_reported == 0 ? 0 : report.steps_reported - 1},
        {"frames", report.frames},
        {"state_hash", report.state_hash},
        {"wall_s", report.wall_s},
        {"backend", report.backend},
        {"device", report.device},
        {"files", files}};
    Output().line(json_text(json));
}

// "cover: steady; mean 0.3, standard error 0.002 after 600 steps", or why there is no mean.
std::string until_text(const StopAt& until, const SeriesReport& series, std::uint64_t steps) {
    std::string text = until.statistic + ": " + series.regime;
    if (!std::isfinite(series.mean))
        text += ", so it has no mean";
    else if (!std::isfinite(series.error))
        text += fmt::format("; mean {:.6g}, without a standard error", series.mean);
    else
        text += fmt::format("; mean {:.6g}, standard error {:.2g}", series.mean, series.error);
    return fmt::format("{} after {} steps{}", text, steps,
                       series.reached ? "" : ": not what --until asks for; give more --max-steps");
}

int run(const RunArguments& a) {
    if (a.resume && a.overwrite) throw Error(ErrorCode::usage, "--resume and --overwrite exclude each other");
    if (a.checkpoint && !a.statistics_only)
        throw Error(ErrorCode::usage, "--checkpoint is for --statistics-only: other runs always leave one");
    if (!a.from.empty() && a.out.empty())
        throw Error(ErrorCode::usage, "--from needs --out: a folder of its own for the run that branches off");
    if (!a.from.empty() && (a.frames || a.until))
        throw Error(ErrorCode::usage, "--from begins with the frame after the checkpoint: leave out --frames and --until");
    if (a.until && !a.statistics_only) throw Error(ErrorCode::usage, "--until needs --statistics-only");
    if (a.max_steps && !a.until) throw Error(ErrorCode::usage, "--max-steps is for --until");
    if (a.statistics_only && (a.frames || a.video))
        throw Error(ErrorCode::usage, "--statistics-only writes no frames: leave out --frames and --video");
    if (a.no_render && a.video)
        throw Error(ErrorCode::usage, "--no-render draws no pictures for --video: leave out one of them");
    if (a.needs) {
        print_needs(a);
        return 0;
    }
    start_threads(a.work.threads);
    RunSettings settings = settings_of(a);
    const bool wants_frames = settings.scene.frames.enabled && !a.statistics_only;
    const int frames_of_scene = settings.scene.frames.count;
    const bool is_counted = wants_frames && a.resume && !a.frames && frames_of_scene > 0;
    const std::uint64_t frames_end_before =
        is_counted ? steps_up_to(moment_of_frame(settings.scene, frames_of_scene - 1)) : 0;
    std::unique_ptr<ProgressBar> bar;
    RunObserver observer;
    observer.progress = [&](const RunProgress& progress) {
        if (!bar) {
            bar = std::make_unique<ProgressBar>("step", progress.steps, progress.steps_in_all, !a.work.quiet);
        }
        bar->update(progress.steps, progress.phase == "encoding" ? "encoding the video"
                                                                 : fmt::format("frame {}/{}", progress.frames,
                                                                               progress.frames_in_all));
    };
    observer.stop = [] { return pending_signal() != 0; };
    defer_signals();
    std::optional<SeriesReport> series;
    const auto run_all = [&] {
        if (!a.until) return run_scene(std::move(settings), observer);
        const std::uint64_t least = settings.scene.steps;
        const std::uint64_t most = a.max_steps.value_or(std::min(kMaxSteps, 10 * least));
        if (most < least)
            throw Error(ErrorCode::usage,
                        fmt::format("--max-steps {}: the run takes `time.steps` = {} at least: expected as many or "
                                    "more, or --set time.steps={} with it",
                                    most, least, most));
        UntilReport until = run_until(std::move(settings), *a.until, most, observer);
        if (until.run.complete) series = until.series;
        return until.run;
    };
    const RunReport report = run_all();
    bar.reset();
    if (report.restarted && !a.work.quiet)
        print_note(report.folder.string() +
                   ": the earlier run left no checkpoint to go on from, so it started anew" +
                   (a.statistics_only ? " (--checkpoint leaves one)" : ""));
    if (wants_frames && report.complete && report.frames == 0 && !a.work.quiet)
        print_note(
            fmt::format("these steps have no frame: frames.start_s and frames.count = {} lie elsewhere "
                        "(--statistics-only where none is wanted)",
                        frames_of_scene));
    if (frames_end_before > 0 && report.complete && report.first_step > frames_end_before && !a.work.quiet)
        print_note(
            fmt::format("no frame follows: all of `frames.count` = {} were written before; with 0 there are "
                        "as many as fit, "
                        "and a longer run goes on with them",
                        frames_of_scene));
    if (report.skipped && !a.work.quiet) print_note(report.folder.string() + ": is complete already");
    if (a.work.json) {
        print_json(report);
    } else if (report.complete && !a.work.quiet) {
        print_report(report);
    }
    if (series && !a.work.quiet) print_note(until_text(*a.until, *series, report.last_step));
    if (report.complete) return series && !series->reached ? int(ErrorCode::check) : 0;
    print_note(fmt::format("stopped after {} of {} steps and {}; the same command with --resume goes on",
                           report.steps_reported == 0 ? 0 : report.steps_reported - 1, report.last_step,
                           counted(std::uint64_t(report.frames), "frame")));
    return 128 + pending_signal();
}

}  // namespace

void add_run_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("run", "Simulate a scene: density grids, pictures, statistics");
    const auto a = std::make_shared<RunArguments>();
    add_scene_arguments(*command, a->scene);
    command->get_option("SCENE")->required(false);
    command
        ->add_option(
            "--from", a->from,
            "Branch off another run: start from its checkpoint (its folder, or the file) with the scene that "
            "--set changes; without SCENE that of the run. Needs --out; with --resume not needed any more "
            "once the branch has a manifest")
        ->type_name("RUN");
    add_out_folder(*command, a->out, "Folder to write to (default: out/NAME)");
    add_value(*command, "--frames", "A..B",
              "Write only these frames, counted from 1; A.., ..B and A alone work too",
              [a](const std::string& text) { a->frames = parse_frames(text); });
    command->add_flag("--no-render", a->no_render, "No pictures, only density grids and statistics");
    command->add_flag(
        "--statistics-only", a->statistics_only,
        "No frames at all, only the manifest and statistics of every step (docs/research.md defines the "
        "columns); no density is made, so mean_density and optical_cover are empty; no checkpoint is left when it "
        "is complete");
    command->add_flag(
        "--checkpoint", a->checkpoint,
        "With --statistics-only: leave the checkpoint of the complete run, to lengthen it later");
    command->add_flag("--video", a->video, "Also an MP4 of all pictures (needs the ffmpeg command)");
    command->add_flag(
        "--resume", a->resume,
        "Go on where an interrupted run stopped, or with more time.steps where a run ended; start "
        "where nothing is there, and do nothing where the same run is complete; without SCENE with that of "
        "the run in "
        "--out");
    command->add_flag(
        "--overwrite", a->overwrite,
        "Start anew although the folder holds an interrupted run, a run of another scene or seed, or files "
        "that no run wrote");
    add_value(*command, "--until", "STAT.se=X",
              "With --statistics-only: go on, half as many steps again and again, until the standard error "
              "of a mean "
              "is X, such as cover.se=0.002; exit status 1 when --max-steps do not do",
              [a](const std::string& text) { a->until = parse_stop(text); });
    add_value(*command, "--max-steps", "N", "Most steps of --until, time.steps or more (default: ten times time.steps)",
              [a](const std::string& text) { a->max_steps = parse_unsigned(text, 1, kMaxSteps); });
    add_value(*command, "--checkpoint-every", "S",
              "Seconds between checkpoints (default: 60); Ctrl-C always leaves one",
              [a](const std::string& text) { a->checkpoint_every_s = parse_real(text, 0, 1e9); });
    command->add_flag("--needs", a->needs,
                      "Only print what the run needs of the system, a word a line: vulkan, ffmpeg");
    add_device(*command, a->device);
    add_threads(*command, a->work);
    add_json(*command, a->work);
    add_quiet(*command, a->work);
    command->footer(
        "Writes DIR/density/NAME_0001.vdb ..., DIR/frames/NAME_0001.png ..., DIR/statistics.csv,\n"
        "DIR/manifest.json and DIR/checkpoint.nephos. A complete run of the same scene is replaced by one\n"
        "that makes all of its files again.\n"
        "The first Ctrl-C finishes the step and leaves a checkpoint, the second stops at once.\n"
        "\n"
        "Examples:\n"
        "  nephos run scenes/cumulus.toml\n"
        "  nephos run scenes/stratus.toml --out /tmp/st --no-render --set time.steps=500\n"
        "  nephos run scenes/cumulus.toml --resume\n"
        "  nephos run --from out/cumulus --no-render --set field.background.ext=0.4 --set time.steps=600 "
        "\\\n"
        "             --out out/drier");
    command->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace nephos
