// SPDX-License-Identifier: Apache-2.0
#pragma once

// Keeps what a run leaves in its folder while it goes on: statistics, manifest and checkpoint, beside the files of frames. Private to
// the module.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "simulation/frame_output.h"
#include "simulation/manifest.h"
#include "simulation/run_folder.h"
#include "simulation/run_inputs.h"
#include "simulation/simulation.h"
#include "simulation/statistics_file.h"

namespace nephos {

class HeldFolders;

// Turns results into files: statistics and manifest here, those of frames beside the simulation.
class RunRecorder : public SimulationSink {
  public:
    explicit RunRecorder(const RunSettings& settings);

    void step(const StepResult& result) override;

    void frame(const FrameResult& result) override { output_.add(result); }

    // The files that the scene names, for the manifest.
    void set_inputs(std::vector<RunInput> inputs) { state_.inputs = std::move(inputs); }

    // Calls `guard` before each file that is put into the folder; it throws where that is not the run's any more. What it refers
    // to must outlive this object.
    void set_guard(std::function<void()> guard);

    // Cuts off rows of the tables that are behind those that were taken over.
    void cut_tables();

    // Frames whose files are all there.
    int frames_done() const { return frames_done_; }

    // The files of a run that begins. A folder that cannot be written to is found now.
    void begin();

    // Goes on from the statistics of the run that this one branches off, with frames of its own, in the place of the files `replaced`. The manifest is there before
    // the first of them: without it they would be nobody's, should this fail.
    void begin_branch(const Simulation& simulation, const HeldFolders& held,
                      const std::vector<std::filesystem::path>& replaced);

    // Takes over what an earlier run reported up to where `simulation` goes on, and checks that it is all
    // there.
    void take_over(const Simulation& simulation);

    // Throws Error(io) when a file of a frame that is done is not there.
    void require_frames(const std::string& what) const;

    // Throws Error(io) when a table has other bytes than were written.
    void require_tables() const;

    // Frames and statistics first: what the checkpoint goes on from is then always there. So are the manifest's rain
    // and digests, which no other file has.
    void save(Simulation& simulation, double wall_s, bool with_checkpoint = true);

    // After a failure: lists every frame that is there, beside the steps of the last save(). A manifest that
    // cannot be written either is no news, and the old one is still right.
    void list_finished_frames(double wall_s) noexcept;

    void write_manifest(bool complete, double wall_s);

    // The files are as they should be, and stay.
    void leave_complete() { state_.complete = true; }

    // The video of all frames, unless it is there already. One of a shorter run is made anew. `stop` as
    // VideoOptions::stop.
    void start_video(const Simulation& simulation, std::function<bool()> stop);
    bool makes_video() const { return output_.makes_video(); }
    void finish_video() { output_.finish_video(); }

    std::vector<RunFiles> frame_files() const;

    const ManifestState& state() const { return state_; }
    const RunFolder& folder() const { return folder_; }

  private:
    std::string relative(const std::filesystem::path& path) const;

    // Throws Error(io) when something else has taken the place of a file, or a part of it.
    void require_size(const FileRecord& file) const;

    // Notes what the tables hold, for the manifest.
    void note_tables();

    // Lists the files that belong to no frame, all but the manifest.
    std::vector<std::filesystem::path> run_files() const;

    FileDigest digest_of_run_file(const std::filesystem::path& path) const;

    // For frames of a run whose manifest, of an earlier version, names no digests.
    std::vector<FileRecord> digests_of_frame(int number) const;

    // By the thread that writes.
    void note(const FrameResult& frame, std::vector<WrittenFile> written);

    const RunSettings& settings_;
    RunFolder folder_;
    std::optional<StatisticsFile> statistics_;  // from begin() or take_over() on
    std::vector<StatisticsFile> layer_statistics_;
    ManifestState state_;  // while frames are under way, `frames` and `rain` belong to the thread that writes
    std::atomic<int> frames_done_ = 0;
    std::uint64_t steps_saved_ = 0;  // as the manifest names them
    std::string hash_saved_;
    std::function<void()> guard_;
    FrameOutput output_;  // last: ends first
};

}  // namespace nephos
