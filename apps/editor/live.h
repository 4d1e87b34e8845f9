// SPDX-License-Identifier: Apache-2.0
#pragma once

// A scene that runs and is drawn beside the window, which never waits for either:
//
//     window --(scene, speed, goal)--> simulation thread --(newest frame)--> drawing thread --(picture)--> window
//            --(camera, size)--------------------------------------------->
//
// Pictures while something moves are small drafts without detail. When nothing does, another thread draws the picture
// with its detail: that takes long, and a draft of the next change does not wait for it.
//
// One frame a step. Frames and pictures that nobody has taken are replaced by newer ones. Steps that are asked for
// again are simulated from the nearest of the checkpoints that are kept in memory.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "density/statistics.h"
#include "scenes/format/scene.h"
#include "simulation/frame_painter.h"
#include "simulation/simulation.h"

namespace nephos {

// Tells what a new text of a scene changes: nothing, its pictures alone, or the simulation. Pure.
enum class SceneChange { none, picture, simulation };
SceneChange change_between(const Scene& before, const Scene& after);

// Returns the frames that the window shows: one a step. A run with these frames has the same pictures, also of clouds that
// follow a moving sun in turn (light.cfa_clouds_per_frame).
FrameOptions film_of_steps(const Scene& scene);

// Holds what the plots show of a step.
struct LiveStep {
    double time_s = 0;
    CloudStatistics statistics;
    StateHash hash;
    std::vector<LayerStep> layers;
};

// The probability field that a lattice's next step has.
struct LiveField {
    std::vector<ActiveEllipsoid> ellipsoids;
    Probabilities background;
};

// A step's density and clouds, and the simulation that the clouds' shapes belong to.
struct LiveFrame {
    std::shared_ptr<const Simulation> simulation;
    FrameResult frame;
    std::vector<LiveField> fields;        // of each layer; empty ones without automaton
    std::uint64_t simulation_number = 0;  // rises with every scene that is simulated anew
};

// Names what pictures show, in the order of the keys 1 to 6.
inline constexpr const char* kViewModes[] = {"beauty",     "density",   "transmittance",
                                             "light only", "wireframe", "voxels"};
enum ViewMode { kBeauty, kDensityMode, kTransmittanceMode, kLightOnly, kWireframe, kVoxels };

// Says how a picture is drawn.
struct LiveView {
    Camera camera;                  // of the window: without path; above the ground until a picture knows it
    int width = 640, height = 360;  // of the picture when nothing moves, pixels
    bool detail = true;             // procedural detail when nothing moves
    int mode = kBeauty;             // a ViewMode, index of kViewModes
    bool hum = false, act = true, cld = true;  // cells that are cubes in the mode voxels
    double slab_low = 0, slab_high = 1;       // fractions of a lattice's height: only cells between them are
    DebugView debug;
    std::vector<bool> hidden;  // layers that are not drawn; shorter than their number: the others are
    bool operator==(const LiveView&) const = default;
};

struct LivePicture {
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgba;  // row 0 at the top
    std::uint64_t step = 0;
    double time_s = 0;
    LiveView view;                  // that it was asked for with
    Vec3 position_m{}, target_m{};  // of its camera, in the world
    bool refined = false;           // at the full size, with detail
    double draw_ms = 0;
    std::uint64_t number = 0;        // rises
    std::uint64_t scene_number = 0;  // of the scene that it was drawn with, LiveStatus::scenes then
};

struct LiveStatus {
    bool running = false;
    std::uint64_t step = 0;         // of the newest frame
    std::uint64_t goal = 0;         // step that is being simulated to
    std::uint64_t steps_taken = 0;  // by the automata: a change of the scene acts from this step on
    std::uint64_t scenes = 0;       // that were started, changed to or redrawn
    std::uint64_t rows = 0;         // steps whose statistics are known, from 0 on
    std::uint64_t rows_version = 0; // rises when rows that were known are not those of the scene any more
    double step_ms = 0;             // mean wall time of a step
    std::size_t checkpoints = 0, checkpoint_bytes = 0;
    std::string failure;  // what ended the simulation, or the last picture; empty: nothing
    std::string device;   // that draws
};

class LiveScene {
  public:
    explicit LiveScene(DeviceOptions device = {});
    ~LiveScene();
    LiveScene(const LiveScene&) = delete;
    LiveScene& operator=(const LiveScene&) = delete;

    // Simulates a scene from its start and shows step `goal` of it, passing through those before it.
    void start(const Scene& scene, std::uint64_t goal);
    // Goes on from the present state with another scene of the same layers and lattices: what a user changed while it
    // runs. Call it between hold() and release().
    void change(const Scene& scene);
    // Draws with the options of another scene; its simulation is that of the last start() or change().
    void redraw(const Scene& scene);
    // Forgets scene, frame and picture: there is nothing to see until the next start().
    void clear();

    // Waits until no step is under way (some milliseconds, a large scene's step at most), keeps it so, and returns the
    // number of steps that were taken: a change of the scene would act from that step on.
    std::uint64_t hold();
    void release();

    void run(bool running);
    void set_speed(double steps_per_second);
    // Shows a step: simulates to it, or goes back to it.
    void seek(std::uint64_t step);
    void set_view(const LiveView& view);
    // Starts or stops drawing pictures; the simulation runs all the same.
    void show(bool shown);
    // Limits the memory of checkpoints; the newest is always kept.
    void keep_at_most(std::size_t checkpoint_bytes);

    // Return the newest; null while there is none, or nothing newer than `than`.
    std::shared_ptr<const LivePicture> picture(std::uint64_t than) const;
    std::shared_ptr<const LiveFrame> frame() const;
    // Returns the newest frame and the scene that it is of, which is not the last one given while that is begun or where it failed.
    struct FrameOfScene {
        std::shared_ptr<const LiveFrame> frame;  // null while there is none
        Scene scene;
    };
    FrameOfScene frame_of_scene() const;
    LiveStatus status() const;
    // Copies the rows of steps from `from` on.
    std::vector<LiveStep> steps(std::uint64_t from = 0) const;

  private:
    using Clock = std::chrono::steady_clock;

    void simulate();
    void draw();
    void refine();
    struct Shown;
    Shown shown_now() const;
    void publish(std::shared_ptr<LivePicture> picture, const Shown& what, const std::string& device,
                 const std::string& failure);
    void take_scene(std::unique_lock<std::mutex>& lock);
    void advance(std::unique_lock<std::mutex>& lock, std::uint64_t goal);
    void go_back(std::uint64_t step);
    bool keep_checkpoint();
    void thin_checkpoints();
    void end_threads();
    void fail(const std::string& what);
    void forget_simulation();

    const DeviceOptions device_;
    mutable std::mutex mutex_;
    std::condition_variable simulation_due_, drawing_due_, held_;

    // Shared, under the mutex.
    bool ended_ = false, running_ = false, hold_ = false, is_held_ = false, shown_ = true;
    bool thins_ = false;  // checkpoints are above what they may have now
    std::size_t most_checkpoint_bytes_ = std::size_t(1024) << 20;
    std::optional<Scene> new_scene_;  // to simulate
    bool keeps_state_ = false;        // new_scene_ goes on from the present state
    bool is_advancing_ = false;       // steps are under way
    bool stops_here_ = false;         // their end is where the pause is
    Scene drawn_scene_;                // of frame_: same layers, same lattices
    std::optional<Scene> next_drawn_;  // takes its place with the simulation that is due; of one that failed never
    bool scene_to_draw_ = false, clear_ = false;
    std::uint64_t scenes_ = 0, drawn_number_ = 0, next_number_ = 0;  // of drawn_scene_ and next_drawn_
    std::uint64_t clears_ = 0;
    std::string draw_failure_;
    double steps_per_second_ = 6;
    std::uint64_t goal_ = 0;
    LiveView view_;
    std::shared_ptr<const LiveFrame> frame_;
    std::shared_ptr<const LivePicture> picture_;
    std::shared_ptr<const LiveFrame> drafted_frame_;  // what the last draft showed
    LiveView drafted_view_;
    bool draft_waits_ = false;  // for its detail
    std::uint64_t drafts_ = 0;
    std::vector<LiveStep> rows_;
    LiveStatus status_;
    std::uint64_t pictures_ = 0;

    // The simulation thread alone uses these.
    Scene scene_;
    std::shared_ptr<Simulation> simulation_;
    std::map<std::uint64_t, Checkpoint> checkpoints_;  // by the next step that they report
    std::uint64_t checkpoint_every_ = 1, simulation_number_ = 0;
    std::size_t checkpoint_bytes_ = 0;

    std::thread simulation_thread_, drawing_thread_, refining_thread_;
};

}  // namespace nephos
