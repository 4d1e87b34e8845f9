// SPDX-License-Identifier: Apache-2.0
#pragma once

// The skies, the rain and the ground of a scene at any moment, without its density: what a picture of a density
// file of that scene shows beside the file's voxels.

#include <optional>

#include "scenes/format/scene.h"
#include "simulation/simulation.h"

namespace nephos {

class SceneMoment {
  public:
    // Simulates the scene's skies from their start to `time_s`, and automata only where rain is looked for in
    // them; nothing where the scene's pictures show none of it. Throws Error(usage) when the time is negative,
    // not finite or beyond kMaxSteps steps, and as Simulation.
    SceneMoment(const Scene& scene, double time_s);
    SceneMoment(const SceneMoment&) = delete;
    SceneMoment& operator=(const SceneMoment&) = delete;

    // Returns a frame without density; it stays valid while this object lives. Its number is that of the scene's frame
    // at that time, 0 where there is none.
    const FrameResult& frame() const { return frame_; }

  private:
    std::optional<Simulation> simulation_;  // has the skies that the frame refers to
    FrameResult frame_;
};

}  // namespace nephos
