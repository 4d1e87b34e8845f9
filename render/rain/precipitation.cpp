// SPDX-License-Identifier: Apache-2.0
#include "render/rain/precipitation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <tbb/parallel_for.h>

#include "core/math.h"
#include "core/vec.h"
#include "render/frame/frame_data.h"
#include "render/image/overlay.h"
#include "render/rain/drop_sizes.h"
#include "render/rain/particle_streaks.h"
#include "render/rain/rain_frame.h"
#include "render/rain/precipitation_light.h"
#include "render/rain/rain_shafts.h"
#include "render/rain/splashes.h"

namespace nephos {
namespace {

// The boxes of the particles hold a cylinder, of which the front half counts: so many more are made.
constexpr double kMadePerDrawn = 8 / std::numbers::pi;
// Distance from the perimeter, in depths of the near container, over which near rain fades into far rain.
constexpr double kFadeDepths = 3;
constexpr double kFarDepths = 10;     // depth of the far container in depths of the near one
constexpr double kNearHeight = 1.25;  // height of the near container in depths

}  // namespace

RainFractions rain_fractions(const PrecipitationOptions& p, double outside_m) {
    RainFractions fractions;
    fractions.near = 1 - smoothstep(0, kFadeDepths * p.depth_m, outside_m);
    fractions.far = (1 - fractions.near);
    fractions.far_number = std::clamp(1 - outside_m / p.reach_m, 0.0, 1.0);
    return fractions;
}

std::array<FarWidth, 2> far_widths(double wide_m, double ahead_m) {
    constexpr double kWidest = 64;
    const double level = std::log2(std::clamp(wide_m / ahead_m, 1.0, kWidest)), below = std::floor(level);
    const double scale = std::exp2(below), rest = level - below;
    return {FarWidth{scale, 1 - rest}, FarWidth{2 * scale, rest}};
}

std::vector<ParticlePass> particle_passes(const RenderOptions& options, const CameraFrame& camera,
                                          const Weather& weather, double time_s) {
    const PrecipitationOptions& p = options.precipitation;
    const double far_depth = kFarDepths * p.depth_m;
    std::vector<CurtainTerm> near, far;
    std::vector<RainContainer> outside;
    for (const RainCurtain& curtain : weather.curtains) {
        if (!falls(curtain)) continue;
        const CurtainTerm term{&curtain, size_law(p.kind, p.intensity_scale * curtain.rate_mm_per_h)};
        const RainContainer at = rain_container(curtain, camera, p.margin_m, far_depth);
        if (at.near) {
            near.push_back(term);
        } else if (at.seen && at.outside_m < p.reach_m) {
            far.push_back(term);
            outside.push_back(at);
        }
    }
    const auto pass_of = [&](const RainContainer& at, double depth, double fraction) {
        ParticlePass pass;
        pass.container = at;
        pass.fraction = fraction;
        pass.boxes = {at.centre.x, at.centre.y, camera.position_m.z, weather.carried_x_m, weather.carried_y_m,
                      time_s,      depth,       p.margin_m,          kNearHeight * depth};
        return pass;
    };
    std::vector<ParticlePass> passes;
    if (!near.empty()) {
        passes.push_back(
            pass_of(rain_container(*near.front().curtain, camera, p.margin_m, far_depth), p.depth_m, 1));
        passes.back().rain = near;
    }
    // Where areas overlap the strongest rain counts, so an area adds only what exceeds those before it.
    std::vector<CurtainTerm> before = near;
    for (std::size_t i = 0; i < far.size(); ++i) {
        const RainFractions fractions = rain_fractions(p, outside[i].outside_m);
        const RainCurtain& curtain = *far[i].curtain;
        for (const bool is_far : {false, true}) {
            const double fraction = is_far ? fractions.far : fractions.near;
            if (fraction <= 0) continue;
            const double wide_m = is_far ? std::max(outside[i].width.left_m, outside[i].width.right_m) : 0;
            for (const FarWidth& width : far_widths(wide_m, far_depth)) {
                if (width.weight <= 0) continue;
                ParticlePass pass = pass_of(outside[i], is_far ? width.scale * far_depth : p.depth_m,
                                            width.weight * fraction);
                pass.far = is_far;
                pass.number = is_far ? fractions.far_number : 1;
                if (is_far) {
                    pass.ahead_m = far_depth;
                    pass.boxes.height_m = curtain.base_m - curtain.ground_m;
                    pass.boxes.centre_z_m = 0.5 * (curtain.base_m + curtain.ground_m);
                }
                pass.rain = {far[i]};
                pass.less = before;
                passes.push_back(std::move(pass));
            }
        }
        before.push_back(far[i]);
    }
    return passes;
}

const Particles& PrecipitationPainter::particles(PrecipitationKind kind, std::uint64_t seed,
                                                 std::size_t count) {
    if (!particles_ || particles_->kind != kind || seed_ != seed || particles_->size() != count) {
        particles_ = make_particles(kind, seed, count);
        seed_ = seed;
    }
    return *particles_;
}

std::optional<RainFrame> rain_frame(const Picture& picture, const RenderOptions& options, const Weather& weather,
                                    double time_s) {
    const PrecipitationOptions& p = options.precipitation;
    if (!p.enabled || weather.curtains.empty()) return {};
    check(p);
    RainFrame frame;
    frame.options = options;
    frame.options.camera = camera_at(options.camera, time_s);
    frame.camera = camera_frame(frame.options.camera);
    frame.opening = camera_frame(camera_at(options.camera, time_s - 0.5 * p.exposure_s));
    frame.closing = camera_frame(camera_at(options.camera, time_s + 0.5 * p.exposure_s));
    frame.light = precipitation_light(picture, frame.options, time_s);
    frame.time_s = time_s;
    frame.splashes = streaks_of_splashes(frame, splashes_at(frame, weather));
    if (p.particles == 0 || p.visibility <= 0) return frame;
    frame.particles = std::size_t(std::ceil(kMadePerDrawn * p.particles));
    frame.passes = particle_passes(frame.options, frame.camera, weather, time_s);
    return frame;
}

void PrecipitationPainter::draw(Picture& picture, const RenderOptions& options, const Weather& weather,
                                double time_s) {
    streaks_ = 0;
    const std::optional<RainFrame> frame = rain_frame(picture, options, weather, time_s);
    if (!frame) return;
    draw_shafts(picture, frame->options, frame->camera, weather.curtains, frame->light, time_s, weather.seed);
    draw_streaks(picture, frame->splashes);
    streaks_ += frame->splashes.size();
    if (frame->particles == 0) return;
    const Particles& all = particles(options.precipitation.kind, weather.seed, frame->particles);
    const StreakView view{frame->options, frame->camera,          frame->opening,         frame->closing,
                          frame->light,   weather.wind_x_m_per_s, weather.wind_y_m_per_s, time_s};
    for (const ParticlePass& pass : frame->passes) {
        const std::vector<Streak> streaks = streaks_of(all, pass, view, picture);
        draw_streaks(picture, streaks);
        streaks_ += streaks.size();
    }
}

}  // namespace nephos
