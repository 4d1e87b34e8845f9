// SPDX-License-Identifier: Apache-2.0

// water.h for vectors of pixels.

#if defined(NEPHOS_RENDER_WATER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_WATER_INL_H_
#undef NEPHOS_RENDER_WATER_INL_H_
#else
#define NEPHOS_RENDER_WATER_INL_H_
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/ground/country-inl.h"
#include "render/ground/ground_pass-inl.h"
#include "render/ground/ripples-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// Returns the slopes of the waves that a pixel resolves, and the variance of the others on one axis. A wave fades out
// between 3.5 and 1.5 pixels a wavelength, in its own direction.
HWY_INLINE Slopes waves_at(const Water& water, const Floats3& point, const Footprint& print, Floats strength) {
    const Lanes d;
    const Floats zero = hn::Zero(d);
    constexpr float kTurn = 6.2831853f;
    Slopes sum{zero, zero, set(water.slope_variance)};
    const Floats across = hn::Sqrt(hn::MulAdd(print.across_x, print.across_x, hn::Mul(print.across_y, print.across_y)));
    for (const WaterWave& wave : water.waves) {
        const Floats length = set(wave.wavelength_m);
        if (hn::AllFalse(d, hn::Gt(length, hn::Mul(set(1.5f), across)))) break;  // the next ones are shorter still
        const float per = wave.wavelength_m / kTurn;
        const auto covers = [&](Floats x, Floats y) {
            return hn::Abs(hn::MulAdd(set(per * wave.x), x, hn::Mul(set(per * wave.y), y)));
        };
        const Floats wide = hn::Max(hn::Add(covers(print.along_x, print.along_y), covers(print.across_x, print.across_y)),
                                    set(1.0e-4f));
        const Floats seen = smooth_step(set(1.5f), set(3.5f), hn::Div(length, wide));
        if (hn::AllTrue(d, hn::Eq(seen, zero))) continue;
        const Floats phase = hn::MulAdd(set(wave.x), point.x, hn::MulAdd(set(wave.y), point.y, set(wave.phase)));
        // In the first turn, where cos() is exact.
        const Floats turns = hn::Round(hn::Mul(phase, set(1 / kTurn)));
        const Floats cosine = hn::Cos(d, hn::NegMulAdd(turns, set(kTurn), phase));
        sum.x = hn::MulAdd(hn::Mul(seen, set(wave.slope_x)), cosine, sum.x);
        sum.y = hn::MulAdd(hn::Mul(seen, set(wave.slope_y)), cosine, sum.y);
        sum.variance = hn::NegMulAdd(hn::Mul(seen, seen), set(wave.variance), sum.variance);
    }
    sum.x = hn::Mul(strength, sum.x);
    sum.y = hn::Mul(strength, sum.y);
    sum.variance = hn::Mul(hn::Mul(strength, strength), hn::Max(sum.variance, zero));
    return sum;
}

// How an eye sees slopes that differ by a variance from those that it resolves. With t the slope towards the eye and e
// the tangent of the eye's elevation, a facet is seen in proportion to max(0, e + t). For t normally distributed around
// t0 that has the integral sigma g(u), u = (e + t0) / sigma, and facets have the mean t0 + sigma g'(u) / g(u), where
// g(u) = u Phi(u) + phi(u) is near (u + sqrt(u^2 + 2 / pi)) / 2.
struct SeenSlopes {
    Floats area;   // of the facets seen, as a multiple of the cosine of the eye's elevation
    Floats mean;   // of their slope towards the eye
    Floats sigma;  // its standard deviation
};

HWY_INLINE SeenSlopes seen_slopes(Floats elevation, Floats towards, Floats sigma) {
    constexpr float kTwoOverPi = 0.63661977f;
    const Floats u = hn::Max(hn::Div(hn::Add(elevation, towards), sigma), set(-3.0f));
    const Floats root = hn::Sqrt(hn::MulAdd(u, u, set(kTwoOverPi)));
    const Floats squared = hn::Mul(u, u);
    const Floats narrowed = hn::Sqrt(hn::Div(hn::Add(squared, set(0.43f)), hn::Add(squared, set(1.0f))));
    return {hn::Mul(hn::Mul(set(0.5f), sigma), hn::Add(u, root)), hn::Add(towards, hn::Div(sigma, root)),
            hn::Mul(sigma, narrowed)};
}

// Radiance of the sun in water, per irradiance on a surface that faces it; `to_eye` and the result lie above the water.
HWY_INLINE Floats glint(const Floats3& to_eye, const Floats3& to_sun, const Slopes& slopes, Floats variance, Floats seen_area) {
    const Lanes d;
    const Floats3 both = add(to_eye, to_sun);
    const Floats3 half = times(hn::Div(set(1.0f), hn::Sqrt(hn::Max(dot(both, both), set(1.0e-6f)))), both);
    const Floats up = hn::Max(half.z, set(0.05f));
    const Floats x = hn::Sub(hn::Div(hn::Neg(half.x), up), slopes.x), y = hn::Sub(hn::Div(hn::Neg(half.y), up), slopes.y);
    const Floats square = hn::Div(hn::MulAdd(x, x, hn::Mul(y, y)), hn::Add(variance, variance));
    const Floats density = hn::Div(hn::Exp(d, hn::Max(hn::Neg(square), set(-80.0f))), hn::Mul(set(6.2831853f), variance));
    const Floats reflectance = water_reflectance(hn::Min(dot(half, to_eye), set(1.0f)), hn::Zero(d));
    const Floats fourth = hn::Mul(hn::Mul(up, up), hn::Mul(up, up));
    return hn::Div(hn::Mul(reflectance, density), hn::Mul(hn::Mul(set(4.0f), fourth), seen_area));
}

// Returns the surface of the water that a pixel sees at a distance, with this share of the sun's light and this rain, mm/h.
HWY_INLINE Surface water_surface(const GroundPass& pass, const Seen& seen, Floats distance, Floats sun, Floats rain) {
    const Water& water = pass.water;
    const Lanes d;
    const Floats one = set(1.0f), zero = hn::Zero(d);
    const Footprint print = footprint(seen.ray, distance, pass.white.up.w);
    // Gusts roughen the water in patches.
    const ResolvedNoise gusts = resolved_noise(water.gusts, seen.point, print.longest);
    const Floats strength = hn::Max(hn::MulAdd(set(0.2f), gusts.value, one), set(0.3f));
    Slopes slopes = waves_at(water, seen.point, print, strength);
    // The rings of drops run over the waves; half of their variance is on either axis.
    const Slopes rings = ripples_at(pass.ripples, seen.point, seen.pixel_m, rain);
    slopes = {hn::Add(slopes.x, rings.x), hn::Add(slopes.y, rings.y), hn::MulAdd(set(0.5f), rings.variance, slopes.variance)};

    // The eye from the water, whose plane bends away with the Earth.
    const Floats level = hn::Sqrt(hn::Max(hn::MulAdd(seen.ray.x, seen.ray.x, hn::Mul(seen.ray.y, seen.ray.y)), set(1.0e-8f)));
    const Floats per_level = hn::Div(one, level);
    const Floats to_eye_x = hn::Neg(hn::Mul(seen.ray.x, per_level)), to_eye_y = hn::Neg(hn::Mul(seen.ray.y, per_level));
    const Floats bend = pass.white.sky != nullptr ? hn::Mul(set(2 * pass.white.earth.z), hn::Mul(distance, level)) : zero;
    const Floats elevation = hn::Max(hn::NegMulAdd(seen.ray.z, per_level, hn::Neg(bend)), set(1.0e-4f));
    const Floats towards = hn::Neg(hn::MulAdd(slopes.x, to_eye_x, hn::Mul(slopes.y, to_eye_y)));
    constexpr float kSunHalf = 0.0023f;  // the sun is no point: half of its radius, as slopes
    const Floats variance = hn::Add(slopes.variance, set(kSunHalf * kSunHalf));
    const SeenSlopes facets = seen_slopes(elevation, towards, hn::Sqrt(variance));

    // Three facets stand for all: the mean one and two beside it.
    Surface surface;
    surface.reflected = {zero, zero, zero};
    Floats mean = zero;
    constexpr float kAside = 1.2247449f;  // of the standard deviation: with a third of the weight each
    for (const float aside : {-kAside, 0.0f, kAside}) {
        const Floats wanted = hn::MulAdd(set(aside), facets.sigma, facets.mean);
        const Floats slope = hn::Max(wanted, hn::Sub(set(0.01f), elevation));
        const Floats more = hn::Sub(slope, towards);  // tilted towards the eye beyond what is resolved
        const Floats slope_x = hn::NegMulAdd(more, to_eye_x, slopes.x), slope_y = hn::NegMulAdd(more, to_eye_y, slopes.y);
        const Floats length = hn::Sqrt(hn::MulAdd(slope_x, slope_x, hn::MulAdd(slope_y, slope_y, one)));
        const Floats cosine = hn::Div(hn::Mul(level, hn::Add(elevation, slope)), length);
        const Floats reflectance = water_reflectance(hn::Max(hn::Min(cosine, one), zero), zero);
        mean = hn::MulAdd(set(1.0f / 3), reflectance, mean);
        if (pass.mirror == nullptr) continue;
        const Floats3 light = reflected(pass, seen, mirrored_ray(seen.ray, slope_x, slope_y), facets.sigma);
        surface.reflected = times_add(hn::Mul(set(pass.reflection / 3), reflectance), light, surface.reflected);
    }

    const float height = pass.white.to_sun.z;
    constexpr float kSunSets = 0.001f, kSunFades = 0.01f;  // sines of the sun's elevation
    if (height > kSunSets && !hn::AllFalse(d, hn::Gt(sun, zero))) {
        const Floats3 to_eye{hn::Neg(seen.ray.x), hn::Neg(seen.ray.y), hn::Mul(elevation, level)};
        const Floats shine = hn::Mul(sun, glint(to_eye, set3(pass.white.to_sun), slopes, variance, hn::Mul(facets.area, level)));
        constexpr float kPi = 3.14159265f;  // from radiance of white ground to irradiance
        const Floats scale = hn::Mul(shine, set(kPi / height * std::min(1.0f, (height - kSunSets) / kSunFades)));
        surface.reflected = add(surface.reflected, times(scale, each_times(seen.beta, set3(pass.white.ground_sun))));
    }

    const Floats below = hn::Sub(one, mean);
    surface.albedo = times(below, seen.dry);
    if (water.foam_albedo > 0) {
        const Floats foam = part_above(resolved_noise(water.foam, seen.point, print.longest), water.foam_level);
        const Floats white = set(water.foam_albedo);
        surface.albedo = mix(surface.albedo, {white, white, white}, {foam, foam, foam});
        surface.reflected = times(hn::Sub(one, foam), surface.reflected);
    }
    return surface;
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
