// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_recorder.h"

#include <exception>
#include <map>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "core/paths.h"
#include "density/vdb/vdb_file.h"
#include "density/voxel_digest.h"
#include "scenes/format/writer.h"
#include "simulation/branch.h"
#include "simulation/earlier_run.h"
#include "simulation/own_files.h"

namespace nephos {

RunRecorder::RunRecorder(const RunSettings& settings)
    : settings_(settings),
      folder_{settings.folder, settings.scene.name},
      output_(settings, [this](const FrameResult& frame, std::vector<WrittenFile> files) {
          note(frame, std::move(files));
      }) {
    state_.backend = output_.backend_name();
    state_.device = output_.device_name();
}

void RunRecorder::step(const StepResult& result) {
    output_.check();
    statistics_->add(statistics_row(result));
    for (std::size_t n = 0; n < result.layers.size(); ++n) {
        layer_statistics_[n].add(statistics_row(result, result.layers[n]));
    }
    state_.state_hash = result.hash.hex();
    state_.steps_reported = result.step + 1;
}

void RunRecorder::set_guard(std::function<void()> guard) {
    guard_ = guard;
    output_.set_guard(std::move(guard));
}

void RunRecorder::begin() {
    write_manifest(false, 0);
    const PublishCheck check(guard_);
    statistics_ = StatisticsFile::create(folder_.statistics());
    if (!settings_.scene.layers.empty()) create_folders(folder_.folder / "statistics");
    for (const LayerOptions& layer : settings_.scene.layers) {
        layer_statistics_.push_back(
            StatisticsFile::create(folder_.statistics(layer.name), kLayerStatisticsHeader));
    }
}

void RunRecorder::begin_branch(const Simulation& simulation, const HeldFolders& held,
                               const std::vector<std::filesystem::path>& replaced) {
    std::vector<OtherTable> tables = tables_of_other_run(settings_, folder_, simulation.next_step());
    held.remove(replaced);
    write_manifest(false, 0);
    const PublishCheck check(guard_);
    copy_rows(tables, simulation.next_step());
    statistics_ = StatisticsFile::resume(
        folder_.statistics(), simulation.next_step(),
        [this](std::uint64_t, std::string_view, const StateHash& hash) { state_.state_hash = hash.hex(); });
    for (const LayerOptions& layer : settings_.scene.layers)
        layer_statistics_.push_back(StatisticsFile::resume(
            folder_.statistics(layer.name), simulation.next_step(), {}, kLayerStatisticsHeader));
    state_.steps_reported = simulation.next_step();
    note_tables();
    write_manifest(false, 0);
}

void RunRecorder::take_over(const Simulation& simulation) {
    int number = settings_.range.first_frame;
    const auto record_frames_of = [&](std::uint64_t step, std::string_view, const StateHash& hash) {
        state_.state_hash = hash.hex();
        for (; number < simulation.next_frame(); ++number) {
            if (moment_of_frame(settings_.scene, number - 1).step != step) return;
            const double time_s = frame_time_s(settings_.scene.frames, number - 1);
            state_.frames.push_back({number, time_s, step, hash, {}});
        }
    };
    const PublishCheck check(guard_);
    const EarlierRun earlier = read_manifest(folder_.manifest());
    require_tables_of_run(folder_, earlier, kStartAnew);
    if (earlier.complete) require_nothing_appended(folder_, earlier);
    // Frames before the first row of their step cannot be: a range of frames reports every step from 0.
    statistics_ = StatisticsFile::resume(folder_.statistics(), simulation.next_step(), record_frames_of);
    frames_done_ = int(state_.frames.size());
    for (const LayerOptions& layer : settings_.scene.layers) {
        layer_statistics_.push_back(StatisticsFile::resume(
            folder_.statistics(layer.name), simulation.next_step(), {}, kLayerStatisticsHeader));
    }
    note_tables();
    if (!settings_.scene.layers.empty()) state_.rain = read_rain(folder_.manifest());
    std::erase_if(state_.rain, [&](const auto& rain) { return rain.first >= simulation.next_frame(); });
    state_.steps_reported = simulation.next_step();
    require_frames("is missing, although the checkpoint is past it");
    std::map<int, std::vector<FileRecord>> files = read_frame_files(folder_.manifest());
    for (FrameRecord& frame : state_.frames) {
        frame.files = std::move(files[frame.number]);
        if (frame.files.empty()) frame.files = digests_of_frame(frame.number);
        for (const FileRecord& file : frame.files) {
            require_size(file);
            const bool names_state = file.path.ends_with(".vdb") && settings_.scene.layers.empty();
            if (names_state && !names_hash(folder_.folder / file.path, frame.state_hash.hex()))
                throw Error(ErrorCode::io,
                            fmt::format("{}: is of another state than the frame that was written: start anew "
                                        "with --overwrite",
                                        (folder_.folder / file.path).string()));
        }
    }
}

void RunRecorder::require_size(const FileRecord& file) const {
    const std::filesystem::path path = folder_.folder / file.path;
    std::error_code error;
    if (type_behind(path) == std::filesystem::file_type::regular) {
        const std::uintmax_t size = std::filesystem::file_size(path, error);
        if (error) throw ReadFailure(path, error.message(), "examine");
        if (size == file.digest.bytes) return;
    }
    throw Error(ErrorCode::io,
                fmt::format("{}: is not the file of {} bytes that was written: start anew with --overwrite",
                            path.string(), file.digest.bytes));
}

void RunRecorder::require_frames(const std::string& what) const {
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

void RunRecorder::save(Simulation& simulation, double wall_s, bool with_checkpoint) {
    output_.finish();
    statistics_->save();
    for (StatisticsFile& file : layer_statistics_) file.save();
    note_tables();
    write_manifest(false, wall_s);
    const PublishCheck check(guard_);
    if (with_checkpoint) write_checkpoint(folder_.checkpoint(), simulation.save());
}

void RunRecorder::list_finished_frames(double wall_s) noexcept {
    output_.finish_quietly();
    try {
        ManifestState state = state_;
        state.steps_reported = steps_saved_;
        state.state_hash = hash_saved_;
        state.wall_s = wall_s;
        const PublishCheck check(guard_);
        nephos::write_manifest(settings_, state);
    } catch (const std::exception&) {
    }
}

void RunRecorder::write_manifest(bool complete, double wall_s) {
    state_.complete = complete;
    state_.run_files.clear();
    if (complete) {
        for (const std::filesystem::path& path : run_files())
            state_.run_files.push_back({relative(path), digest_of_run_file(path), {}});
    }
    state_.wall_s = wall_s;
    const PublishCheck check(guard_);
    nephos::write_manifest(settings_, state_);
    steps_saved_ = state_.steps_reported;
    hash_saved_ = state_.state_hash;
}

void RunRecorder::require_tables() const {
    const auto require = [](const std::filesystem::path& path, const StatisticsFile& table) {
        if (file_digest(path) != table.content())
            throw Error(ErrorCode::io, path.string() + ": was changed while the run was writing it");
    };
    require(folder_.statistics(), *statistics_);
    for (std::size_t n = 0; n < layer_statistics_.size(); ++n)
        require(folder_.statistics(settings_.scene.layers[n].name), layer_statistics_[n]);
}

void RunRecorder::start_video(const Simulation& simulation, std::function<bool()> stop) {
    if (!settings_.render || !wants_video(settings_.scene)) return;
    std::error_code error;
    if (guard_) guard_();
    // One of an earlier version does not name its scene, by which it is known while the run is not complete.
    const bool is_to_be_made = simulation.next_frame() <= settings_.range.last_frame ||
                               !names_hash(folder_.video(), frames_hash(settings_.scene));
    if (is_to_be_made && !std::filesystem::remove(folder_.video(), error) && error)
        throw Error(ErrorCode::io, folder_.video().string() + ": cannot remove: " + error.message());
    if (!std::filesystem::exists(folder_.video())) output_.start_video(std::move(stop));
}

std::vector<RunFiles> RunRecorder::frame_files() const {
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

std::string RunRecorder::relative(const std::filesystem::path& path) const {
    return path.lexically_relative(settings_.folder).generic_string();
}

void RunRecorder::cut_tables() {
    statistics_->cut();
    for (StatisticsFile& file : layer_statistics_) file.cut();
}

void RunRecorder::note_tables() {
    state_.tables = {{relative(folder_.statistics()), statistics_->content(), {}}};
    for (std::size_t n = 0; n < layer_statistics_.size(); ++n)
        state_.tables.push_back({relative(folder_.statistics(settings_.scene.layers[n].name)),
                                 layer_statistics_[n].content(),
                                 {}});
}

std::vector<std::filesystem::path> RunRecorder::run_files() const {
    std::vector<std::filesystem::path> files{folder_.statistics()};
    for (const LayerOptions& layer : settings_.scene.layers) files.push_back(folder_.statistics(layer.name));
    if (settings_.checkpoint) files.push_back(folder_.checkpoint());
    if (settings_.render && wants_video(settings_.scene)) files.push_back(folder_.video());
    return files;
}

// Returns of a table what was written, and not what may have become of it since.
FileDigest RunRecorder::digest_of_run_file(const std::filesystem::path& path) const {
    if (path == folder_.statistics()) return statistics_->content();
    for (std::size_t n = 0; n < layer_statistics_.size(); ++n)
        if (path == folder_.statistics(settings_.scene.layers[n].name)) return layer_statistics_[n].content();
    return file_digest(path);
}

std::vector<FileRecord> RunRecorder::digests_of_frame(int number) const {
    std::vector<FileRecord> files;
    for (const std::filesystem::path& path : density_files(folder_, settings_.scene, number))
        files.push_back({relative(path), file_digest(path), voxel_digest(read_density(path))});
    if (!settings_.render) return files;
    for (const std::filesystem::path& path : picture_files(folder_, settings_.scene, number))
        files.push_back({relative(path), file_digest(path), {}});
    return files;
}

void RunRecorder::note(const FrameResult& frame, std::vector<WrittenFile> written) {
    std::vector<FileRecord> files;
    for (WrittenFile& file : written)
        files.push_back({relative(file.path), std::move(file.digest), std::move(file.voxels)});
    state_.frames.push_back({frame.number, frame.time_s, frame.step, frame.hash, std::move(files)});
    if (std::vector<RainRecord> rain = rain_of(frame); !rain.empty())
        state_.rain[frame.number] = std::move(rain);
    frames_done_ = int(state_.frames.size());
}

}  // namespace nephos
