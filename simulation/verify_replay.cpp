// SPDX-License-Identifier: Apache-2.0
#include "simulation/verify_replay.h"

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "density/voxel_digest.h"
#include "scenes/format/errors.h"
#include "simulation/branch.h"
#include "simulation/run_inputs.h"
#include "simulation/scene_place.h"
#include "simulation/verify_problems.h"

namespace nephos {
namespace {

// Compares frames that are simulated anew with those of the manifest. Voxels of refined files are the same on processors of one
// kind alone (docs/determinism.md), so that they say nothing of the run.
class Replay : public SimulationSink {
  public:
    explicit Replay(const RunListing& run) {
        for (const ListedFrame& frame : run.frames) frames_[frame.number] = &frame;
        is_refined_ = run.scene.density.refine > 1;
        half_ = run.scene.density.half;
        folder_ = {run.folder, run.scene.name};
    }
    void step(const StepResult&) override {}
    void frame(const FrameResult& frame) override {
        const auto found = frames_.find(frame.number);
        if (found == frames_.end()) return;
        ++count;
        if (found->second->state_hash != frame.hash.hex())
            return problems.add(fmt::format("frame {}: state {}, {} in the manifest", frame.number,
                                            frame.hash.hex(), found->second->state_hash));
        if (is_refined_) return;
        const auto name = [&](const std::filesystem::path& path) {
            return path.lexically_relative(folder_.folder).generic_string();
        };
        std::map<std::string, const DensityGrid*> densities{
            {name(folder_.density(frame.number)), &frame.density}};
        for (const LayerFrame& layer : frame.layers)
            if (!layer.direct) densities[name(folder_.density(frame.number, layer.name))] = &layer.density;
        for (const FileRecord& file : found->second->files) {
            const auto density = densities.find(file.path);
            if (density == densities.end() || file.voxels.empty()) continue;
            ++files;
            if (file.voxels != voxel_digest(*density->second, half_))
                problems.add(fmt::format("{}: other voxels", file.path));
        }
    }
    // Says what was compared, of frames that agree.
    std::string text() const {
        std::string text = fmt::format("{} frames simulated anew have the same states", count);
        if (files > 0) text += fmt::format(", and {} files of them the same voxels", files);
        if (is_refined_) text += "; voxels of refined files are not compared (density.refine above 1)";
        return text;
    }
    Problems problems;
    int count = 0;
    std::size_t files = 0;

  private:
    std::map<int, const ListedFrame*> frames_;
    RunFolder folder_;
    bool is_refined_ = false, half_ = false;
};

// Returns the simulation of a branch as it began.
Simulation branch_anew(const RunListing& run, const Scene& scene) {
    const BranchPoint& point = *run.branch;
    const std::filesystem::path file = point.place.empty() ? point.checkpoint : point.place;
    if (!is_there(file))
        throw Error(ErrorCode::io,
                    fmt::format("{}: the checkpoint that the run branched off is not there any more",
                                point.checkpoint.string()));
    const Checkpoint checkpoint = read_checkpoint(file);
    if (!is_branch_point(checkpoint, point, scene, run.simulation_hash))
        throw Error(
            ErrorCode::io,
            fmt::format(
                "{}: is not the checkpoint any more that the run branched off, but one after {} steps of a "
                "run that went on or began anew",
                point.checkpoint.string(), checkpoint.steps));
    return {scene,          run.range, run.simulation_hash, checkpoint, SimulationResults::everything,
            Restart::branch};
}

// Returns the simulation of frames from step 0 on.
Simulation run_anew(const RunListing& run, const Scene& scene, const SimulationRange& range) {
    SimulationStart start = simulation_start(scene);
    if (start.simulation_hash != run.simulation_hash) {
        const std::vector<RunInput> now =
            inputs_of(scene, run.folder, {.first_states = true, .pictures = false});
        const std::string changed =
            changed_inputs(run.inputs, now, {FileKind::first_state, FileKind::simulation});
        if (!changed.empty()) throw Error(ErrorCode::io, "the content is not as it was: " + changed);
        if (run.inputs.empty() && !now.empty())
            throw Error(ErrorCode::io,
                        "the files that the scene names are others than those of the run, whose manifest is "
                        "of an earlier version and does not say which");
    }
    return {scene, range, run.simulation_hash, std::move(start.initial)};
}

}  // namespace

Check replay_frames(const RunListing& run, int count) {
    Replay sink(run);
    try {
        if (run.frames.empty()) return {"replay", false, "there is no frame to simulate", {}, false};
        const int first = run.frames.front().number;
        const int last = std::min(run.frames.back().number, first + count - 1);
        Scene scene = run.scene;
        locate_inputs(scene, run.folder, run.inputs);
        Simulation simulation =
            run.branch ? branch_anew(run, scene) : run_anew(run, scene, range_of_frames(scene, first, last));
        while (!simulation.finished() && simulation.next_frame() <= last) simulation.advance(sink);
    } catch (const Error& error) {
        const auto* errors = dynamic_cast<const SceneErrors*>(&error);
        const std::string text = errors != nullptr ? errors->problems().front().message : error.what();
        if (error.code() != ErrorCode::io) return {"replay", false, text};
        return {"replay", false, text, {}, false};
    }
    return sink.problems.check("replay", sink.text());
}

}  // namespace nephos
