// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_folder.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/error.h"
#include "core/paths.h"
#include "density/vdb/vdb_file.h"
#include "density/voxel_digest.h"
#include "render/image/video.h"
#include "scenes/format/writer.h"
#include "simulation/branch.h"
#include "simulation/earlier_run.h"
#include "simulation/folder_lock.h"
#include "simulation/frame_output.h"
#include "simulation/manifest.h"
#include "simulation/run_inputs.h"
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

// Turns results into files: statistics and manifest here, those of frames beside the simulation.
class Recorder : public SimulationSink {
  public:
    explicit Recorder(const RunSettings& settings)
        : settings_(settings),
          folder_{settings.folder, settings.scene.name},
          output_(settings, [this](const FrameResult& frame, std::vector<WrittenFile> files) {
              note(frame, std::move(files));
          }) {
        state_.backend = output_.backend_name();
        state_.device = output_.device_name();
    }

    void step(const StepResult& result) override {
        output_.check();
        statistics_->add(statistics_row(result));
        for (std::size_t n = 0; n < result.layers.size(); ++n) {
            layer_statistics_[n].add(statistics_row(result, result.layers[n]));
        }
        state_.state_hash = result.hash.hex();
        state_.steps_reported = result.step + 1;
    }

    void frame(const FrameResult& result) override { output_.add(result); }

    // The files that the scene names, for the manifest.
    void set_inputs(std::vector<RunInput> inputs) { state_.inputs = std::move(inputs); }

    // Frames whose files are all there.
    int frames_done() const { return frames_done_; }

    // The files of a run that begins. A folder that cannot be written to is found now.
    void begin() {
        write_manifest(false, 0);
        statistics_ = StatisticsFile::create(folder_.statistics());
        if (!settings_.scene.layers.empty()) create_folders(folder_.folder / "statistics");
        for (const LayerOptions& layer : settings_.scene.layers) {
            layer_statistics_.push_back(
                StatisticsFile::create(folder_.statistics(layer.name), kLayerStatisticsHeader));
        }
    }

    // Goes on from the statistics of the run that this one branches off, with frames of its own. The manifest is there before
    // the first of them: without it they would be nobody's, should this fail.
    void begin_branch(const Simulation& simulation) {
        require_tables_of_other_run(settings_, simulation.next_step());
        remove_earlier_run(folder_);
        write_manifest(false, 0);
        copy_tables_of_other_run(settings_, folder_, simulation.next_step());
        statistics_ = StatisticsFile::resume(
            folder_.statistics(), simulation.next_step(),
            [this](std::uint64_t, std::string_view, const StateHash& hash) { state_.state_hash = hash.hex(); });
        for (const LayerOptions& layer : settings_.scene.layers)
            layer_statistics_.push_back(StatisticsFile::resume(folder_.statistics(layer.name), simulation.next_step(),
                                                               {}, kLayerStatisticsHeader));
        state_.steps_reported = simulation.next_step();
        write_manifest(false, 0);
    }

    // Takes over what an earlier run reported up to where `simulation` goes on, and checks that it is all
    // there.
    void take_over(const Simulation& simulation) {
        int number = settings_.range.first_frame;
        const auto record_frames_of = [&](std::uint64_t step, std::string_view, const StateHash& hash) {
            state_.state_hash = hash.hex();
            for (; number < simulation.next_frame(); ++number) {
                if (moment_of_frame(settings_.scene, number - 1).step != step) return;
                const double time_s = frame_time_s(settings_.scene.frames, number - 1);
                state_.frames.push_back({number, time_s, step, hash, {}});
            }
        };
        const EarlierRun earlier = read_manifest(folder_.manifest());
        require_table_of_run(folder_.statistics(), earlier.steps_reported, earlier.state_hash, kStartAnew);
        // Frames before the first row of their step cannot be: a range of frames reports every step from 0.
        statistics_ = StatisticsFile::resume(folder_.statistics(), simulation.next_step(), record_frames_of);
        frames_done_ = int(state_.frames.size());
        for (const LayerOptions& layer : settings_.scene.layers) {
            layer_statistics_.push_back(StatisticsFile::resume(
                folder_.statistics(layer.name), simulation.next_step(), {}, kLayerStatisticsHeader));
        }
        if (!settings_.scene.layers.empty()) state_.rain = read_rain(folder_.manifest());
        std::erase_if(state_.rain, [&](const auto& rain) { return rain.first >= simulation.next_frame(); });
        state_.steps_reported = simulation.next_step();
        require_frames("is missing, although the checkpoint is past it");
        std::map<int, std::vector<FileRecord>> files = read_frame_files(folder_.manifest());
        for (FrameRecord& frame : state_.frames) {
            frame.files = std::move(files[frame.number]);
            if (frame.files.empty()) frame.files = digests_of_frame(frame.number);
            for (const FileRecord& file : frame.files) require_size(file);
        }
    }

    // Throws Error(io) when something else has taken the place of a file, or a part of it.
    void require_size(const FileRecord& file) const {
        const std::filesystem::path path = folder_.folder / file.path;
        std::error_code error;
        const bool is_file = std::filesystem::is_regular_file(path, error);
        if (!error && is_file && std::filesystem::file_size(path, error) == file.digest.bytes) return;
        throw Error(
            ErrorCode::io,
            fmt::format("{}: is not the file of {} bytes that was written: start anew with --overwrite",
                        path.string(), file.digest.bytes));
    }

    // Throws Error(io) when a file of a frame that is done is not there.
    void require_frames(const std::string& what) const {
        for (const RunFiles& files : frame_files()) {
            for (const std::filesystem::path& file : files.files) {
                std::error_code error;
                const auto type = std::filesystem::status(file, error).type();
                if (type == std::filesystem::file_type::none)
                    throw Error(ErrorCode::io, file.string() + ": cannot examine: " + error.message());
                if (type != std::filesystem::file_type::not_found) continue;
                throw Error(ErrorCode::io, file.string() + ": " + what + ": start anew with --overwrite");
            }
        }
    }

    // Frames and statistics first: what the checkpoint goes on from is then always there. So are the manifest's rain
    // and digests, which no other file has.
    void save(Simulation& simulation, double wall_s, bool with_checkpoint = true) {
        output_.finish();
        statistics_->save();
        for (StatisticsFile& file : layer_statistics_) file.save();
        write_manifest(false, wall_s);
        if (with_checkpoint) write_checkpoint(folder_.checkpoint(), simulation.save());
    }

    // After a failure: lists every frame that is there, beside the steps of the last save(). A manifest that
    // cannot be written either is no news, and the old one is still right.
    void list_finished_frames(double wall_s) noexcept {
        output_.finish_quietly();
        try {
            ManifestState state = state_;
            state.steps_reported = steps_saved_;
            state.state_hash = hash_saved_;
            state.wall_s = wall_s;
            nephos::write_manifest(settings_, state);
        } catch (const std::exception&) {
        }
    }

    void write_manifest(bool complete, double wall_s) {
        state_.complete = complete;
        state_.run_files.clear();
        if (complete) {
            for (const std::filesystem::path& path : run_files())
                state_.run_files.push_back({relative(path), file_digest(path), {}});
        }
        state_.wall_s = wall_s;
        nephos::write_manifest(settings_, state_);
        steps_saved_ = state_.steps_reported;
        hash_saved_ = state_.state_hash;
    }

    // The files are as they should be, and stay.
    void leave_complete() { state_.complete = true; }

    // The video of all frames, unless it is there already. One of a shorter run is made anew.
    void start_video(const Simulation& simulation) {
        if (!settings_.render || !wants_video(settings_.scene)) return;
        std::error_code error;
        if (simulation.next_frame() <= settings_.range.last_frame &&
            !std::filesystem::remove(folder_.video(), error) && error)
            throw Error(ErrorCode::io, folder_.video().string() + ": cannot remove: " + error.message());
        if (!std::filesystem::exists(folder_.video())) output_.start_video();
    }
    bool makes_video() const { return output_.makes_video(); }
    void finish_video() { output_.finish_video(); }

    std::vector<RunFiles> frame_files() const {
        RunFiles density{"density", {}}, png{"png", {}}, exr{"exr", {}};
        for (const FrameRecord& frame : state_.frames) {
            for (std::filesystem::path& file : density_files(folder_, settings_.scene, frame.number))
                density.files.push_back(std::move(file));
            if (!settings_.render) continue;
            for (std::filesystem::path& file : picture_files(folder_, settings_.scene, frame.number))
                (file.extension() == ".png" ? png : exr).files.push_back(std::move(file));
        }
        std::vector<RunFiles> all{std::move(density), std::move(png), std::move(exr)};
        std::erase_if(all, [](const RunFiles& files) { return files.files.empty(); });
        return all;
    }

    const ManifestState& state() const { return state_; }
    const RunFolder& folder() const { return folder_; }

  private:
    std::string relative(const std::filesystem::path& path) const {
        return path.lexically_relative(settings_.folder).generic_string();
    }

    // Of the files that belong to no frame, all but the manifest.
    std::vector<std::filesystem::path> run_files() const {
        std::vector<std::filesystem::path> files{folder_.statistics()};
        for (const LayerOptions& layer : settings_.scene.layers)
            files.push_back(folder_.statistics(layer.name));
        if (settings_.checkpoint) files.push_back(folder_.checkpoint());
        if (settings_.render && wants_video(settings_.scene)) files.push_back(folder_.video());
        return files;
    }

    // For frames of a run whose manifest, of an earlier version, names no digests.
    std::vector<FileRecord> digests_of_frame(int number) const {
        std::vector<FileRecord> files;
        for (const std::filesystem::path& path : density_files(folder_, settings_.scene, number))
            files.push_back({relative(path), file_digest(path), voxel_digest(read_density(path))});
        if (!settings_.render) return files;
        for (const std::filesystem::path& path : picture_files(folder_, settings_.scene, number))
            files.push_back({relative(path), file_digest(path), {}});
        return files;
    }

    // By the thread that writes.
    void note(const FrameResult& frame, std::vector<WrittenFile> written) {
        std::vector<FileRecord> files;
        for (WrittenFile& file : written)
            files.push_back({relative(file.path), std::move(file.digest), std::move(file.voxels)});
        state_.frames.push_back({frame.number, frame.time_s, frame.step, frame.hash, std::move(files)});
        if (std::vector<RainRecord> rain = rain_of(frame); !rain.empty())
            state_.rain[frame.number] = std::move(rain);
        frames_done_ = int(state_.frames.size());
    }

    const RunSettings& settings_;
    RunFolder folder_;
    std::optional<StatisticsFile> statistics_;  // from begin() or take_over() on
    std::vector<StatisticsFile> layer_statistics_;
    ManifestState state_;  // while frames are under way, `frames` and `rain` belong to the thread that writes
    std::atomic<int> frames_done_ = 0;
    std::uint64_t steps_saved_ = 0;  // as the manifest names them
    std::string hash_saved_;
    FrameOutput output_;  // last: ends first
};

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

RunReport report_of(const Recorder& recorder, const RunSettings& settings, const Simulation& simulation) {
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

void report_progress(const RunObserver& observer, const Simulation& simulation, const Recorder& recorder,
                     const RunSettings& settings, std::string_view phase) {
    if (!observer.progress) return;
    observer.progress({simulation.steps_taken(), simulation.steps_in_all(), recorder.frames_done(),
                       settings.range.last_frame - settings.range.first_frame + 1, phase});
}

// Up to the end or until it is stopped; leaves a checkpoint, at the end only where one is wanted.
void simulate(Simulation& simulation, Recorder& recorder, const RunSettings& settings,
              const RunObserver& observer, const FolderLock& lock, Clock::time_point begin) {
    Clock::time_point saved = Clock::now(), looked = saved;
    lock.require_in_place();
    while (!simulation.finished() && !stopped(observer)) {
        simulation.advance(recorder);
        report_progress(observer, simulation, recorder, settings, "simulating");
        const Clock::time_point now = Clock::now();
        const bool is_due = seconds_between(saved, now) >= settings.checkpoint_every_s;
        // Not after each of many short steps: it asks the system twice.
        if (is_due || seconds_between(looked, now) >= kLookEvery_s) {
            lock.require_in_place();
            looked = now;
        }
        if (!is_due) continue;
        recorder.save(simulation, seconds_since(begin));
        saved = Clock::now();
    }
    lock.require_in_place();
    recorder.save(simulation, seconds_since(begin), settings.checkpoint || !simulation.finished());
    report_progress(observer, simulation, recorder, settings, "simulating");
}

// The report of a run that was complete before and has no checkpoint that could be read: of statistics alone.
RunReport report_of_complete(const RunSettings& settings, const RunFolder& folder) {
    RunReport report = report_head(settings);
    report.complete = report.skipped = true;
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
bool encode(const Simulation& simulation, Recorder& recorder, const RunSettings& settings,
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

RunReport run_scene(RunSettings settings, const RunObserver& observer) {
    const Clock::time_point begin = Clock::now();
    if (settings.statistics_only) settings.range = {settings.scene.steps, 1, 0};
    settings.render = settings.render && wants_pictures(settings.scene) &&
                      settings.range.last_frame >= settings.range.first_frame;
    const RunFolder folder{settings.folder, settings.scene.name};
    if (settings.render && wants_video(settings.scene)) require_ffmpeg();
    const bool may_resume = settings.resume;
    const auto found = [&] {
        return may_resume ? find_resumption(settings, folder) : Resumption::nothing_there;
    };
    if (found() == Resumption::complete) return report_of_complete(settings, folder);
    std::optional<Simulation> made;  // outlives the recorder, whose threads draw what is in it
    Recorder recorder(settings);     // opens the device

    const FolderLock lock(folder.folder, "run");
    const Resumption resumption = found();  // once more: another run may have been at work until now
    if (resumption == Resumption::complete) return report_of_complete(settings, folder);
    settings.resume = resumption == Resumption::go_on;
    std::vector<RunInput> inputs = inputs_of(settings);
    if (!settings.resume) {
        refuse_to_remove_inputs(folder, inputs);
        if (!settings.overwrite) refuse_to_lose(folder, settings, inputs, resumption);
    }
    if (lock.held()) remove_leftovers(folder);
    Simulation& simulation =
        made.emplace(settings.resume   ? resumed_simulation(settings, folder, inputs)
                     : settings.branch ? branched_simulation(settings, folder)
                                       : Simulation(settings.scene, settings.range, settings.simulation_hash,
                                                    std::move(settings.initial), settings.results()));
    // Refuses a mixture: the simulation, the pictures and the checksums read the files at different times.
    if (const auto changed = first_changed(settings.stamps))
        throw Error(ErrorCode::io,
                    changed->string() + ": was changed while the run began: give the same command again");
    recorder.set_inputs(std::move(inputs));
    const std::uint64_t first_step = simulation.steps_taken();
    if (settings.resume) {
        recorder.take_over(simulation);
        if (!simulation.finished()) recorder.write_manifest(false, seconds_since(begin));
    } else if (settings.branch) {
        recorder.begin_branch(simulation);
    } else {
        remove_earlier_run(folder);
        recorder.begin();
    }
    recorder.start_video(simulation);
    const bool was_complete =
        settings.resume && simulation.finished() && read_manifest(folder.manifest()).complete;
    if (was_complete && settings.checkpoint && !recorder.makes_video()) {
        recorder.leave_complete();
        RunReport report = report_of(recorder, settings, simulation);
        report.first_step = first_step;
        report.skipped = true;
        return report;
    }

    try {
        simulate(simulation, recorder, settings, observer, lock, begin);
    } catch (...) {
        // What failed in a folder that is gone failed for that; and in a new one of its name another run may be at work.
        lock.require_in_place();
        recorder.list_finished_frames(seconds_since(begin));
        throw;
    }
    const bool complete = simulation.finished() && encode(simulation, recorder, settings, observer);
    if (complete) {
        lock.require_in_place();
        recorder.require_frames("was removed while the run was writing");
        recorder.write_manifest(true, seconds_since(begin));
        if (!settings.checkpoint) remove_checkpoint(folder);
    }
    RunReport report = report_of(recorder, settings, simulation);
    report.first_step = first_step;
    report.restarted = resumption == Resumption::start_anew;
    return report;
}

}  // namespace nephos
