// SPDX-License-Identifier: Apache-2.0
#pragma once

// What `nephos verify` says of the motion of a run: how much its frames differ from one to the next. Private to the module.

#include <optional>
#include <vector>

#include "density/density_grid.h"
#include "simulation/verify.h"

namespace nephos {

// Measures a sequence of frames that are given in order.
class SequenceMotion {
  public:
    void add(const DensityGrid& grid);
    // A frame is missing: the next one is compared with none.
    void skip() { before_.clear(); }
    // Returns the check `motion`: the largest change of a voxel from frame to frame, which must not be above `most` where that
    // is given, and that of the sum of gradients along x, by which pulsing between steps shows.
    Check check(const std::optional<double>& most) const;

  private:
    std::vector<float> before_;  // voxels of the last frame, x fastest
    double sharpness_ = 0, change_ = 0, sharpness_change_ = 0;
};

}  // namespace nephos
