// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_folder.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/error.h"
#include "core/paths.h"
#include "render/image/video.h"
#include "scenes/format/writer.h"
#include "simulation/branch.h"
#include "simulation/earlier_run.h"
#include "simulation/folder_lock.h"
#include "simulation/manifest.h"
#include "simulation/run_inputs.h"
#include "simulation/run_parts.h"
#include "simulation/run_recorder.h"
#include "simulation/scene_files.h"
#include "simulation/statistics_file.h"

namespace nephos {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kLookEvery_s = 0.05;  // whether the folder is still in its place

double seconds_between(Clock::time_point begin, Clock::time_point end) {
    return std::chrono::duration<double>(end - begin).count();
}
double seconds_since(Clock::time_point begin) { return seconds_between(begin, Clock::now()); }

// Returns what a report says of the settings alone.
RunReport report_head(const RunSettings& settings) {
    RunReport report;
    report.scene = settings.scene.name;
    report.scene_hash = settings.scene_hash;
    report.simulation_hash = settings.simulation_hash;
    report.folder = settings.folder;
    report.last_step = settings.range.last_step;
    return report;
}

RunFiles statistics_files(const RunSettings& settings, const RunFolder& folder) {
    RunFiles statistics{"statistics", {folder.statistics()}};
    for (const LayerOptions& layer : settings.scene.layers) statistics.files.push_back(folder.statistics(layer.name));
    return statistics;
}

RunReport report_of(const RunRecorder& recorder, const RunSettings& settings, const Simulation& simulation) {
    const ManifestState& state = recorder.state();
    RunReport report = report_head(settings);
    report.complete = state.complete;
    report.steps_taken = simulation.steps_taken();
    report.steps_reported = state.steps_reported;
    report.frames = int(state.frames.size());
    report.state_hash = state.state_hash;
    report.wall_s = state.wall_s;
    report.backend = state.backend;
    report.device = state.device;
    report.files = recorder.frame_files();
    const RunFolder& folder = recorder.folder();
    if (state.complete && settings.render && settings.scene.frames.video) {
        report.files.push_back({"video", {folder.video()}});
    }
    report.files.push_back(statistics_files(settings, folder));
    report.files.push_back({"manifest", {folder.manifest()}});
    if (settings.checkpoint || !state.complete) report.files.push_back({"checkpoint", {folder.checkpoint()}});
    return report;
}

bool stopped(const RunObserver& observer) { return observer.stop && observer.stop(); }

void report_progress(const RunObserver& observer, const Simulation& simulation, const RunRecorder& recorder,
                     const RunSettings& settings, std::string_view phase) {
    if (!observer.progress) return;
    observer.progress({simulation.steps_taken(), simulation.steps_in_all(), recorder.frames_done(),
                       settings.range.last_frame - settings.range.first_frame + 1, phase});
}

// Up to the end or until it is stopped; leaves a checkpoint, at the end only where one is wanted.
void simulate(Simulation& simulation, RunRecorder& recorder, const RunSettings& settings,
              const RunObserver& observer, const std::function<void()>& require_in_place,
              Clock::time_point begin) {
    Clock::time_point saved = Clock::now(), looked = saved;
    require_in_place();
    while (!simulation.finished() && !stopped(observer)) {
        simulation.advance(recorder);
        report_progress(observer, simulation, recorder, settings, "simulating");
        const Clock::time_point now = Clock::now();
        const bool is_due = seconds_between(saved, now) >= settings.checkpoint_every_s;
        // Not after each of many short steps: it asks the system.
        if (is_due || seconds_between(looked, now) >= kLookEvery_s) {
            require_in_place();
            looked = now;
        }
        if (!is_due) continue;
        recorder.save(simulation, seconds_since(begin));
        saved = Clock::now();
    }
    require_in_place();
    recorder.save(simulation, seconds_since(begin), settings.checkpoint || !simulation.finished());
    report_progress(observer, simulation, recorder, settings, "simulating");
}

// The report of a run that was complete before and has no checkpoint that could be read: of statistics alone.
RunReport report_of_complete(const RunSettings& settings, const RunFolder& folder) {
    RunReport report = report_head(settings);
    report.complete = report.skipped = true;
    const EarlierRun earlier = read_manifest(folder.manifest());
    require_tables_of_run(folder, earlier, kStartAnew);
    report.first_step = report.steps_taken = settings.range.last_step;
    report.steps_reported = settings.range.last_step + 1;
    read_statistics(
        folder.statistics(), report.steps_reported,
        [&](std::uint64_t, std::string_view, const StateHash& hash) { report.state_hash = hash.hex(); },
        kStatisticsHeader, kStartAnew);
    report.files = {statistics_files(settings, folder), {"manifest", {folder.manifest()}}};
    return report;
}

// Completes the video, when there is to be one and it is not there yet; false when it was stopped.
bool encode(const Simulation& simulation, RunRecorder& recorder, const RunSettings& settings,
            const RunObserver& observer) {
    if (!recorder.makes_video()) return true;
    report_progress(observer, simulation, recorder, settings, "encoding");
    try {
        recorder.finish_video();
    } catch (const Error&) {
        // Whoever stops the run may have ended ffmpeg too; then resuming encodes.
        if (!stopped(observer)) throw;
        return false;
    }
    return true;
}

// Keeps what a run holds of its folder while it is at work, and names the earlier files that it takes the place of.
struct Claim {
    HeldFolders held;
    std::vector<std::filesystem::path> replaced;
};

// Throws Error(io) for a link in place of a file of the run that is replaced or appended to: it would lead to that of another.
void refuse_links(const RunFolder& folder, const Scene& scene) {
    std::vector<std::filesystem::path> files{folder.manifest(), folder.checkpoint(), folder.statistics()};
    for (const LayerOptions& layer : scene.layers) files.push_back(folder.statistics(layer.name));
    for (const std::filesystem::path& file : files)
        if (type_at(file) == std::filesystem::file_type::symlink)
            throw Error(ErrorCode::io, file.string() + ": is a link, which is not followed here");
}

// Throws where the folder of the layers' tables is a link: these are cut and appended to, and a copy of the run would share them.
void refuse_linked_tables(const RunFolder& folder, ErrorCode code) {
    const std::filesystem::path tables = folder.folder / "statistics";
    if (type_at(tables) == std::filesystem::file_type::symlink)
        throw Error(code,
                    tables.string() + ": is a link, which is not followed here: put the folder itself there");
}

// Adds links in place of the tables that a run of the scene writes, whatever they lead to.
void add_linked_tables(const RunFolder& folder, const Scene& scene,
                       std::vector<std::filesystem::path>& files) {
    for (const LayerOptions& layer : scene.layers) {
        const std::filesystem::path table = folder.statistics(layer.name);
        const bool is_link = type_at(table) == std::filesystem::file_type::symlink;
        if (is_link && std::ranges::find(files, table) == files.end()) files.insert(files.begin(), table);
    }
}

// Makes sure that nothing is lost where the run is to write, that it is there, and that nobody else writes there. Throws as
// run_scene().
Claim claim_folder(const RunFolder& folder, const RunSettings& settings, const std::vector<RunInput>& inputs,
                   Resumption found, const FolderLock& lock) {
    Claim claim{HeldFolders(folder.folder, lock), {}};
    lock.require_in_place();  // what is known is the folder that is locked
    const std::vector<std::filesystem::path> parts =
        parts_of_run(folder, settings.scene, settings.range, settings.render);
    for (const std::filesystem::path& part : parts) claim.held.hold(part);  // before they are looked at
    if (settings.resume) {
        refuse_links(folder, settings.scene);
        refuse_linked_tables(folder, ErrorCode::io);
    } else {
        for (bool is_more = true; is_more;) {
            is_more = false;
            claim.replaced = earlier_files(folder);
            add_linked_tables(folder, settings.scene, claim.replaced);
            for (const std::filesystem::path& file : claim.replaced)
                is_more = claim.held.hold(file.parent_path()) || is_more;
        }
        refuse_to_remove_inputs(folder, claim.replaced, inputs);
        if (settings.branch) refuse_to_remove_other_run(settings, claim.replaced);
        if (!settings.overwrite) refuse_to_lose(folder, claim.replaced, settings, inputs, found);
        if (!settings.scene.layers.empty()) refuse_linked_tables(folder, ErrorCode::usage);
    }
    for (const std::filesystem::path& part : parts) create_folders(part);
    if (settings.range.has_frames()) refuse_shared_density_folders(folder, settings.scene);
    claim.held.hold_in_place(parts);  // those that are new, too
    lock.require_in_place();          // what was looked at, and is held, was in this folder
    return claim;
}

}  // namespace

std::filesystem::path RunFolder::density(int frame) const {
    return frame_path(folder / "density", name, frame);
}

std::filesystem::path RunFolder::density(int frame, const std::string& layer) const {
    return frame_path(folder / "density" / layer, name, frame);
}

std::filesystem::path RunFolder::picture(int frame, std::string_view extension) const {
    return frame_path(folder / "frames", name, frame).replace_extension(extension);
}

std::vector<std::filesystem::path> density_files(const RunFolder& folder, const Scene& scene, int frame) {
    std::vector<std::filesystem::path> files;
    if (has_density(scene) && (scene.layers.empty() || scene.density_files.combined))
        files.push_back(folder.density(frame));
    for (const LayerOptions& layer : scene.layers) {
        if (scene.density_files.per_layer && has_density(layer)) files.push_back(folder.density(frame, layer.name));
    }
    return files;
}

std::vector<std::filesystem::path> picture_files(const RunFolder& folder, const Scene& scene, int frame) {
    std::vector<std::filesystem::path> files;
    if (wants_png(scene)) files.push_back(folder.picture(frame, ".png"));
    if (scene.frames.enabled && scene.frames.exr) files.push_back(folder.picture(frame, ".exr"));
    return files;
}

std::filesystem::path RunFolder::video() const { return folder / "frames" / (name + ".mp4"); }

bool wants_png(const Scene& scene) {
    return scene.frames.enabled && (scene.frames.png || scene.frames.video);
}
bool wants_pictures(const Scene& scene) {
    return wants_png(scene) || (scene.frames.enabled && scene.frames.exr);
}
bool wants_video(const Scene& scene) { return scene.frames.enabled && scene.frames.video; }

RunSettings run_settings(Scene scene, const std::string& scene_file, RunStart from) {
    RunSettings settings;
    std::vector<FileKind> read{FileKind::simulation, FileKind::picture};
    if (from == RunStart::first_state) read.push_back(FileKind::first_state);
    settings.stamps = stamps_of(scene, read);
    scene = with_files(std::move(scene));
    if (from == RunStart::checkpoint) {
        settings.simulation_hash = simulation_hash(scene, hash_of_files(scene));
    } else {
        SimulationStart start = simulation_start(scene);
        settings.initial = std::move(start.initial);
        settings.simulation_hash = std::move(start.simulation_hash);
    }
    settings.scene_file = std::filesystem::path(scene_file).filename().string();
    settings.scene_text = to_toml(scene);
    settings.scene_hash = scene_hash(scene);
    settings.range = full_range(scene);
    settings.folder = std::filesystem::path("out") / scene.name;
    settings.scene = std::move(scene);
    return settings;
}

SimulationResults RunSettings::results() const {
    return statistics_only ? SimulationResults::statistics : SimulationResults::everything;
}

void keep_inputs(RunSettings& settings) {
    settings.inputs = std::make_shared<const std::vector<RunInput>>(inputs_of(settings));
}

RunReport run_scene(RunSettings settings, const RunObserver& observer) {
    const Clock::time_point begin = Clock::now();
    if (settings.statistics_only) settings.range = {settings.scene.steps, 1, 0};
    settings.render = settings.render && wants_pictures(settings.scene) && settings.range.has_frames();
    const RunFolder folder{settings.folder, settings.scene.name};
    if (settings.render && wants_video(settings.scene)) require_ffmpeg();
    const bool may_resume = settings.resume;
    const auto found = [&] {
        return may_resume ? find_resumption(settings, folder) : Resumption::nothing_there;
    };
    if (found() == Resumption::complete) return report_of_complete(settings, folder);
    if (const double rate = settings.scene.frames.per_second;
        settings.render && wants_video(settings.scene) && rate < kLeastVideoRate)
        throw Error(ErrorCode::usage, fmt::format("`frames.per_second` is {:g}: a video has at least {:g}",
                                                  rate, kLeastVideoRate));
    std::optional<Simulation> made;  // outlives the recorder, whose threads draw what is in it
    RunRecorder recorder(settings);  // opens the device

    const auto lock = std::make_shared<const FolderLock>(folder.folder, "run");
    recorder.set_guard([lock] { lock->require_in_place(); });
    const Resumption resumption = found();  // once more: another run may have been at work until now
    if (resumption == Resumption::complete) return report_of_complete(settings, folder);
    settings.resume = resumption == Resumption::go_on;
    std::vector<RunInput> inputs = settings.inputs ? *settings.inputs : inputs_of(settings);
    const auto claim = std::make_shared<Claim>(claim_folder(folder, settings, inputs, resumption, *lock));
    const auto require_in_place = [lock, claim, folder, &settings] {
        lock->require_in_place();
        claim->held.require_in_place();
        refuse_links(folder, settings.scene);
    };
    recorder.set_guard(require_in_place);
    remove_leftovers(folder, claim->held);
    Simulation& simulation =
        made.emplace(settings.resume   ? resumed_simulation(settings, folder, inputs)
                     : settings.branch ? branched_simulation(settings, folder)
                                       : Simulation(settings.scene, settings.range, settings.simulation_hash,
                                                    std::move(settings.initial), settings.results()));
    if (settings.resume) refuse_to_replace_next_frames(folder, settings);
    // Refuses a mixture: the simulation, the pictures and the checksums read the files at different times.
    if (const auto changed = first_changed(settings.stamps))
        throw Error(ErrorCode::io,
                    changed->string() + ": was changed while the run began: give the same command again");
    recorder.set_inputs(std::move(inputs));
    const std::uint64_t first_step = simulation.steps_taken();
    const bool was_complete =
        settings.resume && simulation.finished() && read_manifest(folder.manifest()).complete;
    if (settings.resume) {
        recorder.take_over(simulation);
        // Before later rows are cut off the tables that it lists.
        if (!was_complete) recorder.write_manifest(false, seconds_since(begin));
        recorder.cut_tables();
    } else if (settings.branch) {
        recorder.begin_branch(simulation, claim->held, claim->replaced);
    } else {
        claim->held.remove(claim->replaced);
        recorder.begin();
    }
    recorder.start_video(simulation, observer.stop);
    if (was_complete && settings.checkpoint && !recorder.makes_video()) {
        recorder.leave_complete();
        RunReport report = report_of(recorder, settings, simulation);
        report.first_step = first_step;
        report.skipped = true;
        return report;
    }

    try {
        simulate(simulation, recorder, settings, observer, require_in_place, begin);
    } catch (...) {
        // What failed in a folder that is gone failed for that; and in a new one of its name another run may be at work.
        require_in_place();
        recorder.list_finished_frames(seconds_since(begin));
        throw;
    }
    const bool complete = simulation.finished() && encode(simulation, recorder, settings, observer);
    if (complete) {
        require_in_place();
        recorder.require_frames("was removed while the run was writing");
        recorder.require_tables();
        recorder.write_manifest(true, seconds_since(begin));
        if (!settings.checkpoint) claim->held.remove({folder.checkpoint()});
    }
    RunReport report = report_of(recorder, settings, simulation);
    report.first_step = first_step;
    report.restarted = resumption == Resumption::start_anew;
    return report;
}

}  // namespace nephos
