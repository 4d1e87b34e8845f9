// SPDX-License-Identifier: Apache-2.0
#include "apps/run_folder.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <system_error>

#include <fmt/format.h>

#include "apps/manifest.h"
#include "apps/statistics_file.h"
#include "apps/version.h"
#include "automaton/atomic_file.h"
#include "automaton/error.h"
#include "automaton/random.h"
#include "density/metaballs.h"
#include "density/vdb_file.h"
#include "render/image_file.h"
#include "render/renderer.h"
#include "render/video.h"

namespace nephos {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

bool wants_png(const Scene& scene) { return scene.frames.png || scene.frames.video; }
bool wants_pictures(const Scene& scene) { return wants_png(scene) || scene.frames.exr; }

// Turns results into files; keeps in memory what statistics.csv and the manifest are written from.
class Recorder : public PipelineSink {
  public:
    explicit Recorder(const RunSettings& settings)
        : settings_(settings), folder_{settings.folder, settings.scene.name}, rows_(kStatisticsHeader) {
        if (settings.render) renderer_ = std::make_unique<Renderer>();
        if (renderer_) state_.device = renderer_->device_name();
    }

    void step(const StepResult& result) override {
        const std::string row = statistics_row(result);
        rows_ += row;
        state_.state_hash = hash_in_row(row);
        state_.steps_reported = result.step + 1;
    }

    void frame(const FrameResult& result) override {
        write_density(result);
        if (renderer_) draw(result);
        state_.frames.push_back({result.number, result.time_s, result.step, result.hash.hex()});
    }

    // Takes over what an earlier run reported up to where `pipeline` goes on, and checks that it is all
    // there.
    void take_over(const Pipeline& pipeline) {
        rows_ = read_statistics(folder_.statistics(), pipeline.next_step());
        state_.steps_reported = pipeline.next_step();
        std::vector<std::string_view> hashes;
        for (std::size_t begin = kStatisticsHeader.size(); begin < rows_.size();) {
            const std::size_t end = rows_.find('\n', begin);
            hashes.push_back(hash_in_row(std::string_view(rows_).substr(begin, end - begin)));
            begin = end + 1;
        }
        if (!hashes.empty()) state_.state_hash = hashes.back();
        for (int number = settings_.range.first_frame; number < pipeline.next_frame(); ++number) {
            const double time_s = frame_time_s(settings_.scene.frames, number - 1);
            const std::uint64_t step = moment_of(time_s, settings_.scene.automaton.time_step_s).step;
            state_.frames.push_back({number, time_s, step, std::string(hashes.at(std::size_t(step)))});
        }
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

    // Statistics and manifest first: what the checkpoint goes on from is then always there.
    void save(Pipeline& pipeline, bool complete, double wall_s) {
        write_atomically(folder_.statistics(), rows_);
        write_checkpoint(folder_.checkpoint(), pipeline.save());
        write_manifest(complete, wall_s);
    }

    void write_manifest(bool complete, double wall_s) {
        state_.complete = complete;
        state_.wall_s = wall_s;
        write_atomically(folder_.manifest(), manifest_text(settings_, state_));
    }

    void encode_video() {
        std::vector<std::filesystem::path> pictures;
        for (const FrameRecord& frame : state_.frames)
            pictures.push_back(folder_.picture(frame.number, ".png"));
        encode_mp4(folder_.video(), pictures, settings_.scene.frames.per_second);
    }

    std::vector<RunFiles> frame_files() const {
        RunFiles density{"density", {}}, png{"png", {}}, exr{"exr", {}};
        for (const FrameRecord& frame : state_.frames) {
            density.files.push_back(folder_.density(frame.number));
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
    void write_density(const FrameResult& result) {
        const Scene& scene = settings_.scene;
        const DensityOptions& options = scene.density;
        const DensityGrid written =
            options.refine > 1 ? resample(result.density, options.refine, options.metaball_radius_cells)
                               : result.density;
        VdbContent content;
        content.density = &written;
        content.half = options.half;
        content.hum = result.hum;
        content.act = result.act;
        content.cld = result.cld;
        content.cells = scene.automaton.placement;
        if (options.write_velocity) content.wind = &scene.automaton.wind;
        VdbMetadata metadata;
        metadata.extinction_per_m = options.extinction_per_m;
        metadata.time_s = result.time_s;
        metadata.time_step_s = scene.automaton.time_step_s;
        metadata.frames_per_second = scene.frames.per_second / scene.frames.time_scale;
        metadata.seed = scene.automaton.seed;
        metadata.scene_hash = settings_.scene_hash;
        metadata.state_hash = result.hash.hex();
        metadata.nephos_version = version();
        metadata.random_stream_version = int(kRandomStreamVersion);
        write_vdb(folder_.density(result.number), content, metadata);
    }

    void draw(const FrameResult& result) {
        const Scene& scene = settings_.scene;
        const double radius = scene.density.metaball_radius_cells;
        const std::vector<Metaball> balls = metaballs(result.density, radius);
        const MetaballCloud cloud{balls, scene.density.extinction_per_m, metaball_normalisation(radius)};
        const Picture picture = renderer_->draw(cloud, scene.render);
        PictureMetadata metadata;
        metadata.scene = scene.name;
        metadata.seed = scene.automaton.seed;
        metadata.scene_hash = settings_.scene_hash;
        metadata.state_hash = result.hash.hex();
        metadata.version = version();
        metadata.time_s = result.time_s;
        metadata.frames_per_second = scene.frames.per_second;
        metadata.extinction_per_m = scene.density.extinction_per_m;
        if (scene.frames.exr)
            write_exr(folder_.picture(result.number, ".exr"), picture, scene.render, metadata);
        if (wants_png(scene))
            write_png(folder_.picture(result.number, ".png"), picture, scene.render, metadata);
    }

    const RunSettings& settings_;
    RunFolder folder_;
    std::unique_ptr<Renderer> renderer_;
    std::string rows_;
    ManifestState state_;
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

// An earlier run's files of the same name must not stay between those of the new one. Nothing else is
// touched.
void remove_earlier_run(const RunFolder& folder) {
    for (const char* part : {"density", "frames"}) {
        std::error_code error;
        std::vector<std::filesystem::path> old;
        for (std::filesystem::directory_iterator at(folder.folder / part, error), end; !error && at != end;
             at.increment(error)) {
            if (is_frame_of(at->path().filename().string(), folder.name)) old.push_back(at->path());
        }
        for (const std::filesystem::path& path : old) remove_file(path);
    }
    for (const std::filesystem::path& path :
         {folder.checkpoint(), folder.manifest(), folder.statistics(), folder.video()}) {
        remove_file(path);
    }
}

// An interrupted run may hold hours of work, and a manifest may be somebody else's: neither is thrown away
// without being asked.
void refuse_to_lose(const RunFolder& folder) {
    std::error_code error;
    if (!std::filesystem::exists(folder.manifest(), error)) return;
    EarlierRun earlier;
    try {
        earlier = read_manifest(folder.manifest());
    } catch (const Error& reason) {
        throw Error(ErrorCode::usage,
                    fmt::format("{}: nothing was written, because the folder holds a manifest.json that is "
                                "not of a run ({}): choose another --out, or give --overwrite",
                                folder.folder.string(), reason.what()));
    }
    if (earlier.complete || !std::filesystem::exists(folder.checkpoint(), error)) return;
    throw Error(
        ErrorCode::usage,
        fmt::format("{}: holds an interrupted run of '{}' ({} of {} steps): give --resume to go on, or "
                    "--overwrite to start anew",
                    folder.folder.string(), earlier.name, earlier.steps_reported,
                    earlier.range.last_step + 1));
}

std::string range_text(const EarlierRun& run) {
    return fmt::format("frames {}..{}{}", run.range.first_frame, run.range.last_frame,
                       run.render ? "" : ", without pictures");
}

Pipeline resumed_pipeline(const RunSettings& settings, const RunFolder& folder) {
    if (!std::filesystem::exists(folder.checkpoint())) {
        throw Error(ErrorCode::io, folder.checkpoint().string() +
                                       ": is not there, so there is nothing to resume: run without --resume");
    }
    const EarlierRun earlier = read_manifest(folder.manifest());
    if (earlier.simulation_hash != settings.simulation_hash || earlier.scene_hash != settings.scene_hash) {
        const bool same_clouds = earlier.simulation_hash == settings.simulation_hash;
        throw Error(
            ErrorCode::usage,
            fmt::format("{}: was started with another scene (hash {}, now {}; {}). Resume with the scene, "
                        "--seed and --set of the first call (manifest.json has the scene under "
                        "\"scene_text\"), or start anew with --overwrite",
                        folder.folder.string(), earlier.scene_hash, settings.scene_hash,
                        same_clouds ? "the simulation is the same, density, frames or pictures differ"
                                    : "the simulation itself differs"));
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
    report.device = state.device;
    report.files = recorder.frame_files();
    const RunFolder& folder = recorder.folder();
    if (state.complete && settings.render && settings.scene.frames.video) {
        report.files.push_back({"video", {folder.video()}});
    }
    report.files.push_back({"statistics", {folder.statistics()}});
    report.files.push_back({"manifest", {folder.manifest()}});
    report.files.push_back({"checkpoint", {folder.checkpoint()}});
    return report;
}

}  // namespace

std::filesystem::path RunFolder::density(int frame) const {
    return frame_path(folder / "density", name, frame);
}

std::filesystem::path RunFolder::picture(int frame, std::string_view extension) const {
    return frame_path(folder / "frames", name, frame).replace_extension(extension);
}

std::filesystem::path RunFolder::video() const { return folder / "frames" / (name + ".mp4"); }

RunReport run_scene(const RunSettings& given, const RunObserver& observer) {
    const Clock::time_point begin = Clock::now();
    RunSettings settings = given;
    settings.render =
        given.render && wants_pictures(given.scene) && given.range.last_frame >= given.range.first_frame;
    const RunFolder folder{settings.folder, settings.scene.name};
    if (!settings.resume && !settings.overwrite) refuse_to_lose(folder);

    Recorder recorder(settings);
    Pipeline pipeline = settings.resume ? resumed_pipeline(settings, folder)
                                        : Pipeline(settings.scene, settings.range, settings.simulation_hash,
                                                   settings.initial);
    const std::uint64_t first_step = pipeline.steps_taken();
    if (settings.resume) {
        recorder.take_over(pipeline);
    } else {
        remove_earlier_run(folder);
        recorder.write_manifest(false, 0);  // a folder that cannot be written to is found now
    }

    const auto stopped = [&] { return observer.stop && observer.stop(); };
    const auto report_progress = [&](std::string_view phase) {
        if (!observer.progress) return;
        observer.progress({pipeline.steps_taken(), pipeline.steps_in_all(),
                           int(recorder.state().frames.size()),
                           settings.range.last_frame - settings.range.first_frame + 1, phase});
    };
    Clock::time_point saved = Clock::now();
    while (!pipeline.finished() && !stopped()) {
        pipeline.advance(recorder);
        report_progress("simulating");
        if (seconds_since(saved) >= settings.checkpoint_every_s) {
            recorder.save(pipeline, false, seconds_since(begin));
            saved = Clock::now();
        }
    }
    recorder.save(pipeline, false, seconds_since(begin));
    bool complete = pipeline.finished();
    if (complete && settings.render && settings.scene.frames.video &&
        !std::filesystem::exists(folder.video())) {
        report_progress("encoding");
        try {
            recorder.encode_video();
        } catch (const Error&) {
            // Ctrl-C in a terminal reaches ffmpeg too; then it is the end that was asked for, and resuming
            // encodes.
            if (!stopped()) throw;
            complete = false;
        }
    }
    if (complete) recorder.write_manifest(true, seconds_since(begin));
    RunReport report = report_of(recorder, settings, pipeline);
    report.first_step = first_step;
    return report;
}

}  // namespace nephos
