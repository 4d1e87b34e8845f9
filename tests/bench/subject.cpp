// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/subject.h"

#include <utility>

#include "scenes/format/reader.h"
#include "simulation/frame_detail.h"
#include "simulation/simulation.h"

namespace nephos::bench {
namespace {

// The last density that a simulation hands out.
struct LastFrame : SimulationSink {
    DensityGrid density;
    void step(const StepResult&) override {}
    void frame(const FrameResult& result) override { density = result.density; }
};

struct Kept : SimulationSink {
    std::vector<FrameResult> frames;
    void step(const StepResult&) override {}
    void frame(const FrameResult& result) override { frames.push_back(result); }
};

}  // namespace

std::vector<FrameResult> frames_of(const Scene& scene, int first, int last) {
    Kept kept;
    Simulation simulation(scene, range_of_frames(scene, first, last), {});
    while (!simulation.finished()) simulation.advance(kept);
    return std::move(kept.frames);
}

Subject subject_of(const Scene& scene, const FrameResult& frame, bool with_detail) {
    const double radius = scene.density.metaball_radius_cells;
    Subject subject{scene.name, metaballs(frame.density, radius), scene.density.extinction_per_m, scene.render, radius};
    if (with_detail)
        subject.detailed.push_back({.density = frame.density,
                                    .moisture = frame.moisture,
                                    .setting = detail_setting(scene, std::nullopt, frame.density, frame.time_s),
                                    .first = 0,
                                    .count = subject.balls.size()});
    return subject;
}

Subject last_frame_of(const std::filesystem::path& file) {
    const Scene scene = read_scene(file);
    const int last = full_range(scene).last_frame;
    Simulation simulation(scene, range_of_frames(scene, last, last), {});
    LastFrame frame;
    while (!simulation.finished()) simulation.advance(frame);
    const double radius = scene.density.metaball_radius_cells;
    Subject subject{file.filename().string(), metaballs(frame.density, radius),
                    scene.density.extinction_per_m, scene.render, radius};
    subject.options.camera.width = 640;
    subject.options.camera.height = 480;
    return subject;
}

}  // namespace nephos::bench
