// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_folder.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <system_error>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "density/vdb/vdb_file.h"
#include "render/image/video.h"
#include "scenes/format/writer.h"
#include "simulation/folder_lock.h"
#include "simulation/frame_output.h"
#include "simulation/manifest.h"
#include "simulation/statistics_file.h"

namespace nephos {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

void make_folder(const std::filesystem::path& folder) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw Error(ErrorCode::io, folder.string() + ": cannot make the folder: " + error.message());
}

// Turns results into files: statistics and manifest here, those of frames beside the simulation.
class Recorder : public PipelineSink {
  public:
    explicit Recorder(const RunSettings& settings)
        : settings_(settings),
          folder_{settings.folder, settings.scene.name},
          output_(settings, [this](const FrameResult& frame) { note(frame); }) {
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

    // Frames whose files are all there.
    int frames_done() const { return frames_done_; }

    // The files of a run that begins. A folder that cannot be written to is found now.
    void begin() {
        write_manifest(false, 0);
        statistics_ = StatisticsFile::create(folder_.statistics());
        if (!settings_.scene.layers.empty()) make_folder(folder_.folder / "statistics");
        for (const LayerOptions& layer : settings_.scene.layers) {
            layer_statistics_.push_back(
                StatisticsFile::create(folder_.statistics(layer.name), kLayerStatisticsHeader));
        }
    }

    // Takes over what an earlier run reported up to where `pipeline` goes on, and checks that it is all
    // there.
    void take_over(const Pipeline& pipeline) {
        int number = settings_.range.first_frame;
        const auto record_frames_of = [&](std::uint64_t step, std::string_view, const StateHash& hash) {
            state_.state_hash = hash.hex();
            for (; number < pipeline.next_frame(); ++number) {
                if (moment_of_frame(settings_.scene, number - 1).step != step) return;
                const double time_s = frame_time_s(settings_.scene.frames, number - 1);
                state_.frames.push_back({number, time_s, step, hash});
            }
        };
        // Frames before the first row of their step cannot be: a range of frames reports every step from 0.
        statistics_ = StatisticsFile::resume(folder_.statistics(), pipeline.next_step(), record_frames_of);
        frames_done_ = int(state_.frames.size());
        for (const LayerOptions& layer : settings_.scene.layers) {
            layer_statistics_.push_back(StatisticsFile::resume(
                folder_.statistics(layer.name), pipeline.next_step(), {}, kLayerStatisticsHeader));
        }
        if (!settings_.scene.layers.empty()) state_.rain = read_rain(folder_.manifest());
        std::erase_if(state_.rain, [&](const auto& rain) { return rain.first >= pipeline.next_frame(); });
        state_.steps_reported = pipeline.next_step();
        for (const RunFiles& files : frame_files()) {
            for (const std::filesystem::path& file : files.files) {
                if (std::filesystem::exists(file)) continue;
                throw Error(ErrorCode::io,
                            file.string() +
                                ": is missing, although the checkpoint is past it: start anew with "
                                "--overwrite");
            }
        }
    }

    // Frames and statistics first: what the checkpoint goes on from is then always there. So is the
    // manifest's rain, which no other file has.
    void save(Pipeline& pipeline, double wall_s) {
        output_.finish();
        statistics_->save();
        for (StatisticsFile& file : layer_statistics_) file.save();
        if (!state_.rain.empty()) write_manifest(false, wall_s);
        write_checkpoint(folder_.checkpoint(), pipeline.save());
        write_manifest(false, wall_s);
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
        state_.wall_s = wall_s;
        nephos::write_manifest(settings_, state_);
        steps_saved_ = state_.steps_reported;
        hash_saved_ = state_.state_hash;
    }

    void encode_video() const {
        std::vector<std::filesystem::path> pictures;
        for (const FrameRecord& frame : state_.frames)
            pictures.push_back(folder_.picture(frame.number, ".png"));
        encode_mp4(folder_.video(), pictures, settings_.scene.frames.per_second);
    }

    std::vector<RunFiles> frame_files() const {
        RunFiles density{"density", {}}, png{"png", {}}, exr{"exr", {}};
        for (const FrameRecord& frame : state_.frames) {
            if (has_density(settings_.scene)) density.files.push_back(folder_.density(frame.number));
            for (const LayerOptions& layer : settings_.scene.layers) {
                if (has_density(layer)) density.files.push_back(folder_.density(frame.number, layer.name));
            }
            if (!settings_.render) continue;
            if (wants_png(settings_.scene)) png.files.push_back(folder_.picture(frame.number, ".png"));
            if (settings_.scene.frames.exr) exr.files.push_back(folder_.picture(frame.number, ".exr"));
        }
        std::vector<RunFiles> all{std::move(density), std::move(png), std::move(exr)};
        std::erase_if(all, [](const RunFiles& files) { return files.files.empty(); });
        return all;
    }

    const ManifestState& state() const { return state_; }
    const RunFolder& folder() const { return folder_; }

  private:
    // By the thread that writes.
    void note(const FrameResult& frame) {
        state_.frames.push_back({frame.number, frame.time_s, frame.step, frame.hash});
        if (std::string rain = rain_text(frame); !rain.empty()) state_.rain[frame.number] = std::move(rain);
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

bool is_frame_of(const std::string& file, const std::string& name) {
    if (!file.starts_with(name + "_")) return false;
    const std::size_t dot = file.rfind('.');
    const std::string extension = dot == file.npos ? "" : file.substr(dot);
    if (extension != ".vdb" && extension != ".png" && extension != ".exr") return false;
    const std::string number = file.substr(name.size() + 1, dot - name.size() - 1);
    return number.size() >= 4 &&
           std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
}

void remove_file(const std::filesystem::path& path) {
    std::error_code error;
    std::filesystem::remove(path, error);
    if (error) throw Error(ErrorCode::io, path.string() + ": cannot remove: " + error.message());
}

// Names of the files in a part of the folder ("." for itself); none when it is not there.
std::vector<std::string> names_in(const RunFolder& folder, const std::string& part) {
    std::vector<std::string> names;
    std::error_code error;
    for (std::filesystem::directory_iterator at(folder.folder / part, error), end; !error && at != end;
         at.increment(error)) {
        names.push_back(at->path().filename().string());
    }
    std::sort(names.begin(), names.end());
    return names;
}

// Parts of the folder that hold frames: a folder of its own for the densities of each layer.
std::vector<std::string> frame_parts(const RunFolder& folder) {
    std::vector<std::string> parts{"density", "frames"};
    for (const std::string& name : names_in(folder, "density")) {
        std::error_code error;
        const auto type = std::filesystem::symlink_status(folder.folder / "density" / name, error).type();
        if (type == std::filesystem::file_type::directory) parts.push_back("density/" + name);
    }
    return parts;
}

// What a run of this name writes and finds there already, the manifest last: as long as it is there, the rest
// is known to be of a run.
std::vector<std::filesystem::path> earlier_files(const RunFolder& folder) {
    std::vector<std::filesystem::path> files;
    for (const std::string& part : frame_parts(folder)) {
        for (const std::string& name : names_in(folder, part)) {
            if (is_frame_of(name, folder.name)) files.push_back(folder.folder / part / name);
        }
    }
    for (const std::string& name : names_in(folder, "statistics")) {
        const std::filesystem::path path = folder.folder / "statistics" / name;
        if (is_statistics(path, kLayerStatisticsHeader)) files.push_back(path);
    }
    for (const std::filesystem::path& path :
         {folder.checkpoint(), folder.statistics(), folder.video(), folder.manifest()}) {
        std::error_code error;
        if (std::filesystem::symlink_status(path, error).type() != std::filesystem::file_type::not_found) {
            files.push_back(path);
        }
    }
    return files;
}

// An earlier run's files of the same name must not stay between those of the new one. Nothing else is
// touched.
void remove_earlier_run(const RunFolder& folder) {
    for (const std::filesystem::path& path : earlier_files(folder)) remove_file(path);
}

// Temporary files of a run that was killed. Only for the holder of the folder's lock: to nobody else are they
// leftovers.
void remove_leftovers(const RunFolder& folder) {
    const auto remove_if = [&](const std::string& part, const auto& is_ours) {
        for (const std::string& name : names_in(folder, part)) {
            const std::string published = published_name(name);
            if (!published.empty() && is_ours(published)) remove_file(folder.folder / part / name);
        }
    };
    remove_if(".", [&](const std::string& name) {
        return name == folder.manifest().filename() || name == folder.checkpoint().filename();
    });
    const auto is_frame = [&](const std::string& name) {
        return is_frame_of(name, folder.name) || name == folder.video().filename();
    };
    for (const std::string& part : frame_parts(folder)) remove_if(part, is_frame);
}

[[noreturn]] void refuse(const RunFolder& folder, const std::string& reason) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: nothing was written, because {}: choose another --out, or give --overwrite",
                            folder.folder.string(), reason));
}

// An interrupted run may hold hours of work, a run of another scene cannot be had again by this one, and a
// file that no run wrote is somebody else's: nothing of it is thrown away without being asked.
void refuse_to_lose(const RunFolder& folder, const std::string& scene_hash) {
    const std::vector<std::filesystem::path> files = earlier_files(folder);
    if (files.empty()) return;
    if (files.back() != folder.manifest()) {
        refuse(folder, fmt::format("there is {}, but no manifest.json that says that it is of a run",
                                   files.back().lexically_relative(folder.folder).string()));
    }
    EarlierRun earlier;
    try {
        earlier = read_manifest(folder.manifest());
    } catch (const Error& reason) {
        refuse(folder,
               fmt::format("the folder holds a manifest.json that is not of a run ({})", reason.what()));
    }
    const auto is_there = [&](const std::filesystem::path& file) {
        return std::ranges::count(files, file) > 0;
    };
    if (is_there(folder.statistics()) && !is_statistics(folder.statistics())) {
        refuse(folder, "the folder holds a statistics.csv that is not of a run");
    }
    if (earlier.scene_hash != scene_hash) {
        refuse(folder, fmt::format("it holds a run of '{}' with another scene or seed", earlier.name));
    }
    if (!is_there(folder.checkpoint())) return;
    if (!is_checkpoint(folder.checkpoint())) {
        refuse(folder, "the folder holds a checkpoint.nephos that is not of a run");
    }
    if (earlier.complete) return;
    throw Error(
        ErrorCode::usage,
        fmt::format("{}: holds an interrupted run of '{}' ({} of {} steps): give --resume to go on, or "
                    "--overwrite to start anew",
                    folder.folder.string(), earlier.name,
                    earlier.steps_reported == 0 ? 0 : earlier.steps_reported - 1, earlier.range.last_step));
}

std::string range_text(const EarlierRun& run) {
    return fmt::format("frames {}..{}{}", run.range.first_frame, run.range.last_frame,
                       run.render ? "" : ", without pictures");
}

void require_checkpoint(const RunFolder& folder) {
    if (std::filesystem::exists(folder.checkpoint())) return;
    throw Error(ErrorCode::io, folder.checkpoint().string() +
                                   ": is not there, so there is nothing to resume: run without --resume");
}

// What makes the scene another one than that of the earlier run.
std::string difference(const EarlierRun& earlier, const RunSettings& settings) {
    Scene other_video = settings.scene;
    other_video.frames.video = !other_video.frames.video;
    if (earlier.scene_hash == scene_hash(other_video)) {
        return settings.scene.frames.video ? "only the video differs: the first call was without --video"
                                           : "only the video differs: the first call was with --video";
    }
    return earlier.simulation_hash == settings.simulation_hash
               ? "the simulation is the same, density, frames or pictures differ"
               : "the simulation itself differs";
}

Pipeline resumed_pipeline(const RunSettings& settings, const RunFolder& folder) {
    const EarlierRun earlier = read_manifest(folder.manifest());
    if (earlier.simulation_hash != settings.simulation_hash || earlier.scene_hash != settings.scene_hash) {
        throw Error(
            ErrorCode::usage,
            fmt::format("{}: was started with another scene (hash {}, now {}; {}). Resume with the scene, "
                        "--seed, --set and --video of the first call (manifest.json has the scene under "
                        "\"scene_text\"), or start anew with --overwrite",
                        folder.folder.string(), earlier.scene_hash, settings.scene_hash,
                        difference(earlier, settings)));
    }
    const EarlierRun now{false, "", "", "", settings.render, settings.range, 0};
    if (earlier.range != settings.range || earlier.render != settings.render) {
        throw Error(
            ErrorCode::usage,
            fmt::format("{}: was started for {}, now it is {}: resume with the same --frames and --no-render",
                        folder.folder.string(), range_text(earlier), range_text(now)));
    }
    const Checkpoint checkpoint = read_checkpoint(folder.checkpoint());
    try {
        return Pipeline(settings.scene, settings.range, settings.simulation_hash, checkpoint);
    } catch (const Error& error) {
        throw Error(error.code(), folder.checkpoint().string() + ": " + error.what());
    }
}

RunReport report_of(const Recorder& recorder, const RunSettings& settings, const Pipeline& pipeline) {
    const ManifestState& state = recorder.state();
    RunReport report;
    report.complete = state.complete;
    report.steps_taken = pipeline.steps_taken();
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
    RunFiles statistics{"statistics", {folder.statistics()}};
    for (const LayerOptions& layer : settings.scene.layers) {
        statistics.files.push_back(folder.statistics(layer.name));
    }
    report.files.push_back(std::move(statistics));
    report.files.push_back({"manifest", {folder.manifest()}});
    report.files.push_back({"checkpoint", {folder.checkpoint()}});
    return report;
}

bool stopped(const RunObserver& observer) { return observer.stop && observer.stop(); }

void report_progress(const RunObserver& observer, const Pipeline& pipeline, const Recorder& recorder,
                     const RunSettings& settings, std::string_view phase) {
    if (!observer.progress) return;
    observer.progress({pipeline.steps_taken(), pipeline.steps_in_all(), recorder.frames_done(),
                       settings.range.last_frame - settings.range.first_frame + 1, phase});
}

// Up to the end or until it is stopped; leaves a checkpoint in both cases.
void simulate(Pipeline& pipeline, Recorder& recorder, const RunSettings& settings,
              const RunObserver& observer, Clock::time_point begin) {
    Clock::time_point saved = Clock::now();
    while (!pipeline.finished() && !stopped(observer)) {
        pipeline.advance(recorder);
        report_progress(observer, pipeline, recorder, settings, "simulating");
        if (seconds_since(saved) < settings.checkpoint_every_s) continue;
        recorder.save(pipeline, seconds_since(begin));
        saved = Clock::now();
    }
    recorder.save(pipeline, seconds_since(begin));
    report_progress(observer, pipeline, recorder, settings, "simulating");
}

// The video, when there is to be one and it is not there yet; false when it was stopped.
bool encode(const Pipeline& pipeline, const Recorder& recorder, const RunSettings& settings,
            const RunObserver& observer) {
    if (!settings.render || !wants_video(settings.scene) ||
        std::filesystem::exists(recorder.folder().video())) {
        return true;
    }
    report_progress(observer, pipeline, recorder, settings, "encoding");
    try {
        recorder.encode_video();
    } catch (const Error&) {
        // Ctrl-C in a terminal reaches ffmpeg too; then it is the end that was asked for, and resuming
        // encodes.
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

std::filesystem::path RunFolder::video() const { return folder / "frames" / (name + ".mp4"); }

bool wants_pictures(const Scene& scene) { return wants_png(scene) || scene.frames.exr; }
bool wants_video(const Scene& scene) { return scene.frames.video; }

RunReport run_scene(const RunSettings& given, const RunObserver& observer) {
    const Clock::time_point begin = Clock::now();
    RunSettings settings = given;
    settings.render =
        given.render && wants_pictures(given.scene) && given.range.last_frame >= given.range.first_frame;
    const RunFolder folder{settings.folder, settings.scene.name};
    if (settings.render && wants_video(settings.scene)) require_ffmpeg();
    if (settings.resume) require_checkpoint(folder);
    Recorder recorder(settings);  // opens the device

    const FolderLock lock(folder.folder);
    if (!settings.resume && !settings.overwrite) refuse_to_lose(folder, settings.scene_hash);
    if (lock.held()) remove_leftovers(folder);
    Pipeline pipeline = settings.resume ? resumed_pipeline(settings, folder)
                                        : Pipeline(settings.scene, settings.range, settings.simulation_hash,
                                                   settings.initial);
    const std::uint64_t first_step = pipeline.steps_taken();
    if (settings.resume) {
        recorder.take_over(pipeline);
    } else {
        remove_earlier_run(folder);
        recorder.begin();
    }

    try {
        simulate(pipeline, recorder, settings, observer, begin);
    } catch (...) {
        recorder.list_finished_frames(seconds_since(begin));
        throw;
    }
    const bool complete = pipeline.finished() && encode(pipeline, recorder, settings, observer);
    if (complete) recorder.write_manifest(true, seconds_since(begin));
    RunReport report = report_of(recorder, settings, pipeline);
    report.first_step = first_step;
    return report;
}

}  // namespace nephos
