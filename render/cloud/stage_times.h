// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where the time of a picture goes, for measurements (./bench).

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>

namespace nephos {

enum class DrawStage {
    prepare,       // has the cloud changed? checks, optical depths, bounds
    view_sorting,  // culling, distances and their sort
    eye_bins,      // boxes on the screen, shapes of the balls, lists of the tiles
    look,          // which balls and which of the ground are seen
    sun_order,     // distances from the sun and their sort
    sun_bins,      // boxes on the shadow map, lists of its tiles
    light,         // the shadow map, and the light at the centres
    colour,        // what the balls scatter towards the eye
    view,  // front to back over the pixels, and the background; on a device all from the sorted splats on
};
inline constexpr std::size_t kDrawStages = 9;

struct StageTime {
    double wall_ms = 0;
    double processor_ms = 0;  // of all threads of the program, whatever they do meanwhile
    std::uint64_t bytes = 0;  // that have to be read and written at least; 0: not counted
    std::uint64_t pairs = 0;  // (ball, pixel), (ball, texel) or (ball, centre) that were evaluated
};

struct StageTimes {
    std::array<StageTime, kDrawStages> stages;
    StageTime& operator[](DrawStage stage) { return stages[std::size_t(stage)]; }
    const StageTime& operator[](DrawStage stage) const { return stages[std::size_t(stage)]; }
};

// Adds the time of its life to a stage. `times` may be null.
class StageTimer {
  public:
    StageTimer(StageTimes* times, DrawStage stage) : time_(times != nullptr ? &(*times)[stage] : nullptr) {}
    ~StageTimer() {
        if (time_ == nullptr) return;
        using Milliseconds = std::chrono::duration<double, std::milli>;
        time_->wall_ms += Milliseconds(std::chrono::steady_clock::now() - start_).count();
        time_->processor_ms += 1000.0 * double(std::clock() - clock_) / CLOCKS_PER_SEC;
    }
    StageTimer(const StageTimer&) = delete;
    StageTimer& operator=(const StageTimer&) = delete;

  private:
    StageTime* time_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    std::clock_t clock_ = std::clock();
};

}  // namespace nephos
