// SPDX-License-Identifier: Apache-2.0
#pragma once

// The schedule by which the absorption factors of clouds follow a moving light, so that each frame recomputes
// a bounded number of clouds (T: one). A function of the frame's number and the cloud's slot alone: a frame
// has the same light whether it is drawn by itself, after others or by a resumed run.
//
// With period P, a cloud in slot s is updated in the frames s mod P, s mod P + P, ... and holds the light of
// the last of them; before the first it has the light of frame 0.
//
// Bound: P = ceil(room / clouds_per_frame), where room is the largest number of clouds of the layer's skies
// plus a quarter for clouds that dissolve. New clouds take the lowest free slots (SkyCloud::slot). When
// frames are drawn in their order, each updates at most clouds_per_frame of the clouds of the frame before as
// long as there were never more than `room` clouds at once, else ceil(slots / P). In addition each frame
// computes the clouds that enter (once, with the light of their slot), those that form or dissolve, and the first frame
// of a run computes all.

#include <algorithm>
#include <cstdint>

#include "seeds/sky.h"

namespace nephos {

class LightSchedule {
  public:
    // Computes the period for a layer; clouds_per_frame >= 0, 0 = all clouds in every frame.
    LightSchedule(const SkyOptions& sky, int clouds_per_frame) {
        if (clouds_per_frame == 0) return;
        int most = 0;
        for (const Sky& one : sky.skies) most = std::max(most, one.clouds);
        const int room = most + (most + 3) / 4;
        period_ = std::max(1, room / clouds_per_frame + (room % clouds_per_frame != 0 ? 1 : 0));
    }

    int period() const { return period_; }  // in frames, >= 1

    // Returns the frame, 0..frame, whose light the cloud in `slot` has in `frame`; frames count from 0.
    int frame_of_light(std::uint32_t slot, int frame) const {
        const int first = int(slot % std::uint32_t(period_));
        return frame < first ? 0 : frame - (frame - first) % period_;
    }

  private:
    int period_ = 1;
};

}  // namespace nephos
