// SPDX-License-Identifier: Apache-2.0
#pragma once

// Times of the stages of a frame, for measurements (./bench).

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>

namespace nephos {

enum class DrawStage {
    prepare,       // hash of the cloud; validation, optical depths, bounds, merging
    view_sorting,  // culling and sorting by distance from the camera
    eye_bins,      // screen-space boxes, shapes of the splats, lists of the tiles
    look,          // visibility pre-pass of metaballs and ground
    sun_order,     // sorting by distance from the sun
    sun_bins,      // boxes on the shadow map, lists of its tiles
    light,         // the shadow map, and the light at the centres
    colour,        // radiance that the metaballs scatter towards the eye
    view,          // compositing, and the background; on a device all stages after sorting
};
inline constexpr std::size_t kDrawStages = 9;

struct StageTime {
    double wall_ms = 0;
    double processor_ms = 0;  // of all threads of the program
    std::uint64_t bytes = 0;  // least memory traffic, read and written; 0: not counted
    std::uint64_t pairs = 0;  // number of evaluated (splat, pixel), (splat, texel) or (splat, centre)
};

struct StageTimes {
    std::array<StageTime, kDrawStages> stages;
    StageTime& operator[](DrawStage stage) { return stages[std::size_t(stage)]; }
    const StageTime& operator[](DrawStage stage) const { return stages[std::size_t(stage)]; }
};

// Adds the time between its construction and destruction to a stage. `times` may be null.
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
