// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/subject.h"

#include <utility>

#include "scenes/format/reader.h"
#include "simulation/frame_detail.h"
#include "simulation/simulation.h"

namespace nephos::bench {
namespace {

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

DetailedVoxels voxels_of(const Scene& scene, const FrameResult& frame) {
    DetailedVoxels voxels;
    voxels.density = frame.density;
    voxels.moisture = frame.moisture;
    voxels.setting = detail_setting(scene, std::nullopt, frame.density, frame.time_s);
    return voxels;
}

Subject subject_of(const Scene& scene, const FrameResult& frame, bool with_detail) {
    const double radius = scene.density.metaball_radius_cells;
    Subject subject{scene.name, metaballs(frame.density, radius), scene.density.extinction_per_m, scene.render, radius};
    if (with_detail) {
        subject.detailed.push_back(voxels_of(scene, frame));
        subject.detailed.back().count = subject.balls.size();
    }
    return subject;
}

Subject last_frame_of(const std::filesystem::path& file) {
    const Scene scene = read_scene(file);
    const int last = full_range(scene).last_frame;
    Subject subject = subject_of(scene, frames_of(scene, last, last).back(), false);
    subject.name = file.filename().string();
    subject.options.camera.width = 640;
    subject.options.camera.height = 480;
    return subject;
}

}  // namespace nephos::bench
