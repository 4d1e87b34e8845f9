// SPDX-License-Identifier: Apache-2.0
#pragma once

// From a scene to its frames, without files, devices or a command line. A frame is the density at one moment here;
// it is drawn by frame_painter.h.
//
//     step of every layer -> history of the last states -> density q at steps -> frames between steps
//
// hum, act and cld are the automaton's bit planes: vapour, phase transition, cloud (docs/model.md). q is cld
// smoothed in space and over 2 t0 + 1 steps (SmoothingOptions), so q at step s needs the states s-t0 .. s+t0, and a
// frame between two steps needs q at both. The history keeps exactly the states that something still needs; the
// automaton runs up to t0 steps ahead of the results, also beyond the scene's last step. A frame therefore never
// depends on where the run ends.
//
//     Simulation simulation(scene);
//     while (!simulation.finished()) simulation.advance(sink);
//
// Between any two calls of advance() the simulation can be saved; one that is restored goes on with the same
// results.

#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "automaton/automaton.h"
#include "automaton/checkpoint.h"
#include "density/density_grid.h"
#include "density/statistics.h"
#include "scenes/format/scene.h"
#include "seeds/ground_cover.h"
#include "simulation/layer_simulation.h"

namespace nephos {

// Returns the version of nephos: "0.1.0".
std::string version();

class ByteReader;

// One layer after a step; a row of its own file of statistics.
struct LayerStep {
    std::string name;
    double state = 0;        // of the atmosphere, 0..1
    std::size_t clouds = 0;  // in the sky, those that form or dissolve included
    std::size_t rain_areas = 0;
    double rain_mm_per_h = 0;  // the strongest of them
    // Of a veil, of its voxels; of clouds drawn directly all 0, with the heights NaN.
    CloudStatistics statistics;
    StateHash hash;
};

// One row of statistics.csv: the state after `step` steps.
struct StepResult {
    std::uint64_t step = 0;
    double time_s = 0;
    // mean_density and optical_cover are those of q at this step, NaN where no density is made (SimulationResults). Of several layers:
    // sums of cells; 1 - prod(1 - cover), which assumes random overlap; lowest base; highest top; mean density of
    // all boxes; NaN for the means over columns and the perimeter, which belong to one lattice.
    CloudStatistics statistics;
    StateHash hash;
    std::vector<LayerStep> layers;  // none in a scene without layers
};

// One layer in a frame.
struct LayerFrame {
    std::string name;
    DensityGrid density;    // one voxel a cell, also of a veil; empty if `direct`
    Boundaries boundaries;  // of the density's box
    // Smoothed fraction of cells with hum or act set, 0..1: clouds grow where it exceeds its mean, and dissolve
    // where it is lower (density/detail.h). None without automaton, and where the scene has no detail.
    std::optional<DensityGrid> moisture;
    StateHash hash;
    std::optional<BitPlaneView> hum, act, cld;  // as in FrameResult
    std::shared_ptr<const Lattice> planes;      // storage that the views point into
    // Null without clouds of its own; lives as long as the simulation. It has already advanced to a later step: use
    // it only for shapes and models.
    const SkySimulation* sky = nullptr;
    std::vector<SkyCloud> clouds;  // of the sky, at the frame's time
    bool direct = false;           // there is no density: clouds are drawn as billboards
    std::vector<RainArea> rain;    // at the frame's time
};

// One frame: density at a moment that need not be a step. q of the steps before and after it is carried to where the
// wind has taken the air by then (simulation/motion.h) and mixed; a veil is evaluated at the time. A copy is cheap, shares voxels and planes, and stays valid while the simulation lives; another thread may
// use it while the simulation advances.
struct FrameResult {
    int number = 1;  // as in file names, counted from 1; 0: a moment that is no frame of the scene
    double time_s = 0;
    DensityGrid density;  // one voxel a cell (not refined); of layers, all together (density/combine.h)
    std::optional<DensityGrid> moisture;  // as in LayerFrame; a scene with layers has it in these
    std::uint64_t step = 0;  // the last at or before time_s: hash and planes are those of its state
    StateHash hash;
    // Only when the scene writes the state. A scene with layers has them in these.
    std::optional<BitPlaneView> hum, act, cld;
    std::shared_ptr<const Lattice> planes;         // storage that the views point into
    std::vector<LayerFrame> layers;                // none in a scene without layers
    std::shared_ptr<const GroundCoverMap> ground;  // at time_s; null when the scene does not ask for it
};

// Returns whether a simulation of the scene keeps hum and act of past states beside cld: for files, or for
// LayerFrame::moisture.
inline bool remembers_whole_state(const Scene& scene) {
    return scene.density.write_state || count_detailed(scene) > 0;
}

// Selects what a simulation computes from the states.
enum class SimulationResults {
    everything,  // the density of every step and frame
    statistics,  // rows of statistics from the bits alone: no density but that of veils, and no frames
    // Frames without density: clouds of the skies, rain and ground. Automata are stepped only where rain is looked
    // for in them; statistics and state hashes are those of this part, and do not match those of a full run.
    weather,
};

// Receives steps in order and frames in order. A frame arrives after both steps that it is interpolated from, and
// before the step that follows these.
class SimulationSink {
  public:
    virtual ~SimulationSink() = default;
    virtual void step(const StepResult& result) = 0;
    virtual void frame(const FrameResult& result) = 0;
};

// Which part of the scene is produced. Frames by their number, counted from 1; an empty range (last < first)
// means no frame at all.
struct SimulationRange {
    std::uint64_t last_step = 0;  // steps 0..last_step are reported
    int first_frame = 1, last_frame = 0;
    bool has_frames() const { return last_frame >= first_frame; }
    bool operator==(const SimulationRange&) const = default;
};

// Return all steps and frames of the scene, or a range of frames and the steps up to the last of them. `last` =
// kLastFrame is the last that there is; throws Error(usage) when the scene has no such frame.
inline constexpr int kLastFrame = std::numeric_limits<int>::max();
SimulationRange full_range(const Scene& scene);
SimulationRange range_of_frames(const Scene& scene, int first, int last);

// Where the simulation that saved a checkpoint went on from: the first step and frame that it had not reported yet.
struct SavedPoint {
    std::uint64_t next_step = 0;
    int next_frame = 1;
};

// Throws Error(io) when the checkpoint is damaged or of another version.
SavedPoint saved_point(const Checkpoint& checkpoint);

// How a simulation starts from a checkpoint.
enum class Restart {
    same,    // the scene is that of the simulation that saved it
    branch,  // it has changed: the state goes on under the new scene, whose lattices, layers, skies and numbers of
             // ellipsoids, smoothing window and kept bits are the same
};

// Not thread-safe: one call at a time. Works in parallel itself; results do not depend on the number of threads.
class Simulation {
  public:
    // Simulates all of full_range() from the scene's initial state on. Throws as Automaton and read_state().
    explicit Simulation(const Scene& scene);
    // Starts at step 0: from the scene's own initial state, or from `initial`. Throws as Automaton; Error(usage) when
    // a frame of the range lies after its last step, or frames are wanted of SimulationResults::statistics.
    Simulation(const Scene& scene, const SimulationRange& range, std::string simulation_hash,
               std::optional<Lattice> initial = {},
               SimulationResults results = SimulationResults::everything);
    // Starts where `checkpoint` was saved. The range may end later than that of the simulation that saved it, with
    // frames that follow those it had. Throws Error(usage) when the checkpoint belongs to another simulation,
    // other results, another smoothing window or another range, or does not hold the states that a longer
    // range goes on from; Error(io) when its content is damaged. A branch begins with the checkpoint's next frame;
    // Error(usage) when the scene has changed so much that its state does not fit.
    Simulation(const Scene& scene, const SimulationRange& range, std::string simulation_hash,
               const Checkpoint& checkpoint, SimulationResults results = SimulationResults::everything,
               Restart restart = Restart::same);

    bool finished() const;

    // Does the smallest piece of work that is due: reports one step or one frame, or lets the automaton take
    // a step. Precondition: not finished().
    void advance(SimulationSink& sink);

    // Instead of advance(): takes the steps up to `step`, and leaves all results of those before it unmade, until they are
    // asked for by the functions below. Precondition: next_step() <= step <= last step of the range, no frames in it.
    void go_to(std::uint64_t step);
    // Return what a sink gets of next_step(), the present. Without `density` there is none but that of veils, which takes
    // most of the time, and mean_density is NaN. The frame's number is 0. Precondition: after go_to().
    StepResult present_step(bool density);
    FrameResult present_frame();
    // Returns the density of a layer at next_step(), or of all together; an empty grid where there is none.
    // Precondition: after go_to().
    DensityGrid present_density(std::optional<std::size_t> layer = {});
    // Returns a layer's planes at next_step(), hum and act only where remembers_whole_state(); null without automaton.
    // Precondition: after go_to(), SimulationResults::everything.
    std::shared_ptr<const Lattice> present_planes(std::size_t layer) const;
    // The layers as they are after steps_taken() steps, which may be later than next_step().
    std::span<const LayerSimulation> layers() const { return layers_; }

    // Returns the complete state. First frees the cached densities, to make room for it; they are computed again when
    // they are needed.
    Checkpoint save();

    std::uint64_t steps_taken() const { return layers_.front().steps(); }
    std::uint64_t next_step() const { return next_step_; }  // the first that was not reported yet
    int next_frame() const { return next_frame_; }          // the first that was not reported yet
    // Total number of steps of the automaton, the look-ahead of t0 after the last step included.
    std::uint64_t steps_in_all() const;

  private:
    Simulation(const Scene& scene, SimulationStart start);

    // A past state of a layer, as much of it as is still needed.
    struct PastLayer {
        CloudStatistics statistics;
        StateHash hash;
        double state = 0;
        // Never null; all are empty without an automaton or its density, hum and act unless the scene writes
        // the state or draws detail.
        std::shared_ptr<const Lattice> planes;
        std::vector<SkyCloud> clouds;
        std::vector<RainArea> rain;
    };
    struct Past {
        std::uint64_t step = 0;
        StateHash hash;
        std::vector<PastLayer> layers;
        std::shared_ptr<const GroundCoverMap> ground;  // null without ground cover
    };
    // q of all layers at a step, or the density of a veil; empty grids where no density is made.
    struct Densities {
        std::uint64_t step = 0;
        std::vector<DensityGrid> layers;
        // Of each layer, once a frame has asked for them: moisture, and the sums of gradients of the frame on this step.
        std::vector<std::optional<DensityGrid>> moisture;
        std::vector<std::optional<std::vector<Vec2>>> gradients;
    };

    void step();
    void remember();
    void expose_ground(Past& state);
    PastLayer past_of(std::size_t layer) const;
    void forget();
    bool density_is_due(std::uint64_t step) const;
    const std::vector<DensityGrid>& densities_at_step(std::uint64_t step);
    DensityGrid density_of(std::size_t layer, std::uint64_t step) const;
    double time_s(const Moment& moment) const;
    DensityGrid density_at(std::size_t layer, const Moment& moment);
    DensityGrid carried_to(std::size_t layer, const Moment& moment, const DensityGrid& before,
                           const DensityGrid& after) const;
    const std::vector<Vec2>& gradients_at_step(std::size_t layer, std::uint64_t step);
    DensityGrid moisture_of(std::size_t layer, std::uint64_t step);
    std::optional<DensityGrid> moisture_at(std::size_t layer, const Moment& moment);
    const Past& past(std::uint64_t step) const;
    StepResult step_result(bool density);
    void report_step(SimulationSink& sink);
    FrameResult frame_at(const Moment& moment, double time_s, int number);
    void report_frame(SimulationSink& sink);
    LayerFrame layer_frame(std::size_t layer, const Moment& moment);
    std::shared_ptr<const GroundCoverMap> ground_at(const Moment& moment) const;
    Moment moment_of_number(int number) const;
    std::uint64_t window() const;
    bool makes_density(std::size_t layer) const;
    bool remembers_planes(std::size_t layer) const;
    std::uint64_t lowest_needed() const;
    void restore(const Checkpoint& checkpoint, Restart restart);
    void restore_layers(const Checkpoint& checkpoint);
    void restore_history(const Checkpoint& checkpoint, Restart restart);
    void restore_ground(ByteReader& reader);

    Scene scene_;
    SimulationRange range_;
    SimulationResults results_;
    std::string simulation_hash_;
    std::vector<LayerSimulation> layers_;  // never empty; the one of a scene without layers has no sky
    std::optional<GroundCover> ground_;    // at the last step taken
    std::deque<Past> history_;             // consecutive steps, the newest last; never empty
    std::vector<Densities> densities_;     // q at steps that are still needed
    std::uint64_t next_step_ = 0;
    int next_frame_ = 1;
};

}  // namespace nephos
