// SPDX-License-Identifier: Apache-2.0
#include "seeds/light_schedule.h"

#include <algorithm>

namespace nephos {

LightSchedule::LightSchedule(const SkyOptions& sky, int clouds_per_frame) {
    if (clouds_per_frame == 0) return;
    int most = 0;
    for (const Sky& one : sky.skies) most = std::max(most, one.clouds);
    const int room = most + (most + 3) / 4;
    period_ = std::max(1, room / clouds_per_frame + (room % clouds_per_frame != 0 ? 1 : 0));
}

int LightSchedule::frame_of_light(std::uint32_t slot, int frame) const {
    const int first = int(slot % std::uint32_t(period_));
    return frame < first ? 0 : frame - (frame - first) % period_;
}

}  // namespace nephos
