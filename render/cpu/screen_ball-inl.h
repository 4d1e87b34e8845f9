// SPDX-License-Identifier: Apache-2.0

// Projects metaballs from camera space to the screen: position, shape, fit and light, a vector of metaballs
// at a time (render/vulkan/view_project.comp and lighting.glsl).

#if defined(NEPHOS_RENDER_SCREEN_BALL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_SCREEN_BALL_INL_H_
#undef NEPHOS_RENDER_SCREEN_BALL_INL_H_
#else
#define NEPHOS_RENDER_SCREEN_BALL_INL_H_
#endif

#include <algorithm>
#include <bit>
#include <cstdint>
#include <iterator>
#include <span>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/cpu/screen_ball.h"
#include "render/frame/scattering_table.h"
#include "render/shading/background-inl.h"
#include "render/shading/formulas-inl.h"
#include "render/shading/shells-inl.h"
#include "render/shared/shared.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

inline constexpr std::size_t kMaxLanes = 2 * shader::kTileWidth;

// Balls of one vector, turned from rows into columns.
struct BallColumns {
    HWY_ALIGN float x[kMaxLanes], y[kMaxLanes], z[kMaxLanes], radius[kMaxLanes], least_radius[kMaxLanes],
        depth_scale[kMaxLanes], sun_depth[kMaxLanes], often_depth[kMaxLanes], height[kMaxLanes], flash[kMaxLanes];

    BallColumns(std::span<const shader::ViewBall> balls, const PictureFrame& frame) {
        const std::size_t lanes = hn::Lanes(Lanes());
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const shader::ViewBall& ball = balls[std::min(lane, balls.size() - 1)];
            x[lane] = ball.x;
            y[lane] = ball.y;
            z[lane] = ball.z;
            radius[lane] = ball.radius;
            const bool widens = (ball.flags & shader::kAround) == 0;
            least_radius[lane] = widens ? shader::kMinRadiusPixels / frame.up.w : 0.0f;
            depth_scale[lane] = ball.depth_scale;
            const SunDepths depths = depths_of(ball.sun_depth);
            sun_depth[lane] = depths.once;
            often_depth[lane] = depths.often;
            height[lane] = ball.height;
            flash[lane] = float(ball.flags >> 16) * (1.0f / 65535.0f);
        }
    }
};

// The light that a metaball scatters towards the eye (render/shading/lighting.glsl).
struct Scattered {
    Floats3 diffuse;  // radiance that does not depend on the ray
    Floats3 direct;   // radiance per light that is scattered once
};

HWY_INLINE Scattered scattered_light(const BallColumns& ball, const Floats3& centre, Floats distance,
                                     const PictureFrame& frame) {
    const Lanes d;
    const Floats one = set(1.0f), sun_depth = hn::Load(d, ball.sun_depth);
    const Floats3 ray = times(hn::Div(one, hn::Max(distance, set(1.0e-6f))), centre);
    const Floats height = hn::Load(d, ball.height), albedo = set(frame.ambient_top.w);
    const Floats3 sunlight = sunlight_at(frame, centre.z);
    Floats3 arriving =
        times_add(scattered_often(frame, ray, hn::Load(d, ball.often_depth)), sunlight,
                  mix(set3(frame.ambient_base), set3(frame.ambient_top), {height, height, height}));
    if (frame.flash.w > 0) {
        const Floats3 way = subtract(set3(frame.flash), centre);
        const Floats fraction = hn::Mul(set(frame.flash.w), hn::Load(d, ball.flash));
        arriving =
            times_add(hn::Mul(fraction, flash_falloff(dot(way, way))), set3(frame.flash_colour), arriving);
    }
    const Floats3 beta = air_transmittance(frame, ray, distance);
    const Floats light = hn::Exp(d, hn::Neg(sun_depth));
    return {add(each_times(beta, times(albedo, arriving)), air_light(frame, ray, distance, beta)),
            each_times(times(hn::Mul(albedo, light), beta), sunlight)};
}

// Returns the distances at which the metaballs' own shells begin; beyond the last shell, those of the
// metaballs.
HWY_INLINE Floats shell_begins(const shader::Shells& data, Floats distance) {
    const Lanes d;
    HWY_ALIGN float at[kMaxLanes];
    hn::Store(distance, d, at);
    const auto count = std::size_t(data.settings.x);
    for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
        const std::size_t k = shells_before(data, at[lane]);
        if (k < count) at[lane] = k == 0 ? 0.0f : shell_end(data, k - 1);
    }
    return hn::Load(d, at);
}

// The light of metaballs as it arrives at the beginning of their shells.
HWY_INLINE Scattered seen_through_shell(const Scattered& light, const PictureFrame& frame, const Floats3& ray,
                                        Floats distance) {
    const AirLayer layer = layer_in_front(frame, ray, shell_begins(frame.shells->data, distance), distance);
    return {add(times(layer.transmittance, light.diffuse), layer.light),
            times(layer.transmittance, light.direct)};
}

// c0..c5 of the opacity. Plain loops of a fixed length: the compiler makes vectors of them.
inline void fit_opacity(const float* depth_scale, float (*fit)[kMaxLanes]) {
    float s[kMaxLanes];
    for (std::size_t i = 0; i < kMaxLanes; ++i) s[i] = shader::fit_parameter(depth_scale[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[0][i] = shader::opacity_c0(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[1][i] = shader::opacity_c1(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[2][i] = shader::opacity_c2(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[3][i] = shader::opacity_c3(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[4][i] = shader::opacity_c4(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[5][i] = shader::opacity_c5(s[i]);
}

// Distances from the eye of a vector of balls, and what is drawn of their radii: at least a part of a pixel.
struct BallSizes {
    Floats3 centre;
    Floats distance, drawn, thinning;

    explicit BallSizes(const BallColumns& ball) {
        const Lanes d;
        centre = {hn::Load(d, ball.x), hn::Load(d, ball.y), hn::Load(d, ball.z)};
        distance = hn::Sqrt(dot(centre, centre));
        const Floats radius = hn::Load(d, ball.radius);
        drawn = hn::Max(radius, hn::Mul(hn::Load(d, ball.least_radius), distance));
        thinning = hn::Div(radius, drawn);
    }
};

// The shapes of a vector of balls: `screen` gets up to one a lane, `exact` those that are not fitted, whose
// numbers begin with `number`.
inline void shape_vector(std::span<const shader::ViewBall> balls, const PictureFrame& frame,
                         ScreenBall* screen, ExactBall* exact, std::uint32_t number) {
    const Lanes d;
    const BallColumns ball(balls, frame);
    const BallSizes size(ball);
    const Floats3 &centre = size.centre, right = set3(frame.right), up = set3(frame.up);
    const Floats per_radius = hn::Div(set(1.0f), size.drawn);
    const Floats3 in_radii = times(per_radius, centre);
    const Floats3 along_x = cross(in_radii, times(set(2.0f / frame.picture.x), right)),
                  along_y = cross(in_radii, times(set(-2.0f / frame.picture.y), up));
    const Floats depth = dot(set3(frame.forward), centre);
    const Floats across = hn::Div(dot(right, centre), hn::Mul(dot(right, right), depth)),
                 upward = hn::Div(dot(up, centre), hn::Mul(dot(up, up), depth));
    const Floats half_width = set(0.5f * frame.picture.x), half_height = set(0.5f * frame.picture.y);

    HWY_ALIGN float depth_scale[kMaxLanes] = {}, fit[6][kMaxLanes];
    hn::Store(hn::Mul(hn::Load(d, ball.depth_scale), hn::Mul(size.thinning, size.thinning)), d, depth_scale);
    fit_opacity(depth_scale, fit);
    HWY_ALIGN float field[7][kMaxLanes];
    const Floats fields[] = {hn::Sub(hn::MulAdd(across, half_width, half_width), set(frame.picture.z)),
                             hn::Sub(hn::NegMulAdd(upward, half_height, half_height), set(frame.picture.w)),
                             dot(along_x, along_x),
                             hn::Mul(set(2.0f), dot(along_x, along_y)),
                             dot(along_y, along_y),
                             size.distance,
                             per_radius};
    for (std::size_t n = 0; n < std::size(fields); ++n) hn::Store(fields[n], d, field[n]);
    for (std::size_t i = 0; i < balls.size(); ++i) {
        ScreenBall& to = screen[i];
        to.x = field[0][i];
        to.y = field[1][i];
        to.xx = field[2][i];
        to.xy = field[3][i];
        to.yy = field[4][i];
        for (std::size_t n = 0; n < 6; ++n) to.fit[n] = fit[n][i];
        to.distance = field[5][i];
        if ((balls[i].flags & shader::kNotFitted) == 0) continue;
        const float scale = field[6][i];
        exact[number] = {.x = scale * balls[i].x,
                         .y = scale * balls[i].y,
                         .z = scale * balls[i].z,
                         .per_radius = scale,
                         .depth_scale = depth_scale[i],
                         .distance = to.distance,
                         .diffuse = {},
                         .direct = {}};
        to.x = std::bit_cast<float>(number++);
        to.distance = 0.0f;
    }
}

// `number`: of the first of these balls that is not fitted.
inline void shape_balls(std::span<const shader::ViewBall> balls, const PictureFrame& frame,
                        ScreenBall* screen, ExactBall* exact, std::uint32_t number) {
    const std::size_t lanes = hn::Lanes(Lanes());
    for (std::size_t begin = 0; begin < balls.size(); begin += lanes) {
        const auto some = balls.subspan(begin, std::min(lanes, balls.size() - begin));
        shape_vector(some, frame, screen + begin, exact, number);
        for (const shader::ViewBall& ball : some) number += (ball.flags & shader::kNotFitted) != 0 ? 1 : 0;
    }
}

// The light of some balls that have their shapes: `screen` has one for each of `balls`.
inline void light_balls(std::span<const shader::ViewBall> balls, const PictureFrame& frame,
                        ScreenBall* const* screen, ExactBall* exact) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d);
    for (std::size_t begin = 0; begin < balls.size(); begin += lanes) {
        const auto some = balls.subspan(begin, std::min(lanes, balls.size() - begin));
        const BallColumns ball(some, frame);
        const BallSizes size(ball);
        const Floats3 ray = times(hn::Div(set(1.0f), size.distance), size.centre);
        Scattered light = scattered_light(ball, size.centre, size.distance, frame);
        if (frame.shells != nullptr) light = seen_through_shell(light, frame, ray, size.distance);
        const Floats ratio = hn::Div(size.drawn, size.distance);
        const Floats cosine =
            hn::NegMulAdd(hn::Mul(set(shader::kDiscSpread), ratio), ratio, dot(set3(frame.to_sun), ray));
        const Floats3 radiance = each_times_add(scattered_once(frame, cosine), light.direct, light.diffuse);
        HWY_ALIGN float field[9][kMaxLanes];
        const Floats fields[] = {radiance.x,      radiance.y,      radiance.z,
                                 light.diffuse.x, light.diffuse.y, light.diffuse.z,
                                 light.direct.x,  light.direct.y,  light.direct.z};
        for (std::size_t n = 0; n < std::size(fields); ++n) hn::Store(fields[n], d, field[n]);
        for (std::size_t i = 0; i < some.size(); ++i) {
            ScreenBall& to = *screen[begin + i];
            to.red = field[0][i];
            to.green = field[1][i];
            to.blue = field[2][i];
            if (to.distance > 0) continue;
            ExactBall& whole = exact[std::bit_cast<std::uint32_t>(to.x)];
            const bool each_ray = (some[i].flags & shader::kIntegrate) != 0;  // else one phase serves for all
            for (std::size_t c = 0; c < 3; ++c) {
                whole.diffuse[c] = field[(each_ray ? 3 : 0) + c][i];
                whole.direct[c] = each_ray ? field[6 + c][i] : 0.0f;
            }
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
