// SPDX-License-Identifier: Apache-2.0
#include "simulation/scene_moment.h"

#include <algorithm>
#include <cmath>

#include "automaton/automaton.h"
#include "core/error.h"
#include "core/text.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

// The last frame that a simulation hands out.
struct FrameKeeper : SimulationSink {
    void step(const StepResult&) override {}
    void frame(const FrameResult& result) override { kept = result; }
    FrameResult kept;
};

// Whether pictures show anything that is neither voxels nor a function of the time alone.
bool shows_more_than_voxels(const Scene& scene) {
    if (scene.ground_cover.enabled) return true;
    if (scene.layers.empty()) return false;
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        if (absorbs_in_voxels(scene, n)) return true;
    return scene.render.precipitation.enabled || scene.render.debug_view.any() ||
           !std::ranges::all_of(scene.layers, [](const LayerOptions& layer) { return has_density(layer); });
}

// The number of the scene's frame at exactly this time; 0 where there is none.
int frame_number_at(const Scene& scene, double time_s) {
    const double frames = (time_s - scene.frames.start_s) * scene.frames.per_second / scene.frames.time_scale;
    if (!(frames > -0.5 && frames < kMaxFrames)) return 0;
    const int index = int(std::lround(frames));
    return index < frame_count(scene) && frame_time_s(scene.frames, index) == time_s ? index + 1 : 0;
}

}  // namespace

SceneMoment::SceneMoment(const Scene& scene, double time_s) {
    frame_.number = frame_number_at(scene, time_s);
    frame_.time_s = time_s;
    if (!shows_more_than_voxels(scene)) return;
    if (!(time_s >= 0) || !(time_s <= double(kMaxSteps) * scene.automaton.time_step_s)) {
        throw Error(ErrorCode::usage, "the scene cannot be simulated to " + number_text(time_s, 9) +
                                          " s: expected a time from 0 on, after at most " +
                                          std::to_string(kMaxSteps) + " steps");
    }
    std::size_t bytes = 0;
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        if (scene.layers[n].automaton && scene.layers[n].rain.find)
            bytes += Automaton::memory_bytes(automaton_options(scene, n));
    }
    require_memory(bytes, scene.name + ": the lattices that rain is looked for in");
    Scene moment = scene;
    moment.frames.enabled = true;
    moment.frames.start_s = time_s;
    moment.frames.count = 1;
    moment.steps = steps_up_to(moment_of_frame(moment, 0));
    simulation_.emplace(moment, range_of_frames(moment, 1, 1), std::string(), std::nullopt,
                        SimulationResults::weather);
    FrameKeeper keeper;
    while (!simulation_->finished()) simulation_->advance(keeper);
    keeper.kept.number = frame_.number;
    frame_ = std::move(keeper.kept);
}

}  // namespace nephos
