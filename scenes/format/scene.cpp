// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/scene.h"

#include <cmath>
#include <limits>

namespace nephos {

double simulated_time_s(const Scene& scene) { return double(scene.steps) * scene.automaton.time_step_s; }

double frame_time_s(const FrameOptions& frames, int index) {
    return frames.start_s + double(index) * frames.time_scale / frames.per_second;
}

Moment moment_of(double time_s, double time_step_s) {
    constexpr double kTolerance = 4 * std::numeric_limits<double>::epsilon(), kMostSteps = 0x1p63;
    const double steps = time_s / time_step_s;
    if (!(steps < kMostSteps)) return {std::uint64_t(kMostSteps), 0};
    const double nearest = std::round(steps);
    if (std::abs(steps - nearest) <= kTolerance * nearest) return {std::uint64_t(nearest), 0};
    const double whole = std::floor(steps);
    return {std::uint64_t(whole), steps - whole};
}

Moment moment_of_frame(const Scene& scene, int index) {
    return moment_of(frame_time_s(scene.frames, index), scene.automaton.time_step_s);
}

std::uint64_t steps_up_to(const Moment& moment) { return moment.step + (moment.fraction > 0 ? 1 : 0); }

int frame_count(const Scene& scene) {
    if (!scene.frames.enabled) return 0;
    if (scene.frames.count > 0) return scene.frames.count;
    // Every operation up to the moment is monotonic, so those that fit come before those that do not.
    int fit = 0, most = kMaxFrames;
    while (fit < most) {
        const int middle = fit + (most - fit) / 2;
        if (steps_up_to(moment_of_frame(scene, middle)) <= scene.steps) {
            fit = middle + 1;
        } else {
            most = middle;
        }
    }
    return fit;
}

Sun turned_sun_at(const Sun& sun, std::span<const SunKey> path, double heading_deg, double time_s) {
    Sun now = sun_at(sun, path, time_s);
    const bool from_date = path.empty() && !sun.date.empty();
    if (from_date && heading_deg != 0) {
        const double azimuth = now.azimuth_deg - heading_deg;
        now.azimuth_deg = azimuth - 360 * std::floor(azimuth / 360);
    }
    return now;
}

Sun scene_sun_at(const Scene& scene, double time_s) {
    const Georeference& place = scene.georeference;
    return turned_sun_at(scene.render.sun, scene.sun_path, place.given ? place.heading_deg : 0, time_s);
}

}  // namespace nephos
