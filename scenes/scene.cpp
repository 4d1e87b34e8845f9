// SPDX-License-Identifier: Apache-2.0
#include "scenes/scene.h"

namespace nephos {

double simulated_time_s(const Scene& scene) { return double(scene.steps) * scene.automaton.time_step_s; }

double frame_time_s(const FrameOptions& frames, int index) {
    return frames.start_s + double(index) * frames.time_scale / frames.per_second;
}

int frame_count(const Scene& scene) {
    if (scene.frames.count > 0) return scene.frames.count;
    const double end_s = simulated_time_s(scene);
    // The quotient is only a first guess: the frame that it names is accepted or refused by its own time, so
    // that this function and a check of frame_time_s() against the end never disagree by a rounding.
    const double guess = (end_s - scene.frames.start_s) * scene.frames.per_second / scene.frames.time_scale;
    if (!(guess > -1.0)) return 0;
    if (guess >= double(kMaxFrames)) return kMaxFrames;
    int last = int(guess) + 1;
    while (last >= 0 && frame_time_s(scene.frames, last) > end_s) --last;
    return last + 1 < kMaxFrames ? last + 1 : kMaxFrames;
}

}  // namespace nephos
