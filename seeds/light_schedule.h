// SPDX-License-Identifier: Apache-2.0
#pragma once

// In which frames of a film the absorption factor of a cloud follows a moving light, so that a frame costs a
// bounded number of clouds (T: one). A function of the frame's number and the cloud's slot alone: a frame has
// the same light whether it is drawn by itself, after others or by a run that goes on from a checkpoint.
//
// With period P, a cloud in slot s is refreshed in the frames s mod P, s mod P + P, ... and keeps the light
// of the last of them; before the first it has the light of frame 0.
//
// Bound: P = ceil(room / clouds_per_frame), where room is the largest number of clouds of the layer's skies
// and a quarter more for clouds that dissolve. New clouds take the lowest free slots (SkyCloud::slot). So
// when frames are drawn in their order, at most clouds_per_frame of the clouds that the frame before had are
// due in one, as long as no more than room of them were ever there at once; beyond that, ceil(slots / P) are.
// Clouds that enter come on top (they are computed once, with the light of their slot), and so do all clouds
// in the first frame that a run draws.

#include <cstdint>

#include "seeds/sky.h"

namespace nephos {

class LightSchedule {
  public:
    // clouds_per_frame >= 0; 0: all clouds in every frame.
    LightSchedule(const SkyOptions& sky, int clouds_per_frame);

    int period() const { return period_; }  // in frames, >= 1

    // The frame, 0..frame, whose light the cloud in `slot` has in `frame`; frames count from 0.
    int frame_of_light(std::uint32_t slot, int frame) const;

  private:
    int period_ = 1;
};

}  // namespace nephos
