// SPDX-License-Identifier: Apache-2.0
#include "render/veil/veil_air.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/veil/veil_air.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include "render/shading/background-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

constexpr std::size_t kPadding = hn::MaxLanes(Lanes());

HWY_INLINE Floats3 ray_at(const RowRays& rays, std::size_t x) {
    const Lanes d;
    return {hn::LoadU(d, &rays.x[x]), hn::LoadU(d, &rays.y[x]), hn::LoadU(d, &rays.z[x])};
}

HWY_INLINE void store_colours(const Floats3& colour, std::size_t x, RowColours& to) {
    const Lanes d;
    hn::StoreU(colour.x, d, &to[0][x]);
    hn::StoreU(colour.y, d, &to[1][x]);
    hn::StoreU(colour.z, d, &to[2][x]);
}

RowRays rays_of_row(const PictureFrame& frame, std::size_t y, std::size_t width) {
    const Lanes d;
    RowRays rays;
    for (auto* of : {&rays.x, &rays.y, &rays.z, &rays.ground_m}) of->resize(width + kPadding);
    for (std::size_t x = 0; x < width; x += hn::Lanes(d)) {
        const Floats3 direction =
            pixel_direction(frame, hn::Add(hn::Iota(d, float(x)), set(0.5f)), set(float(y) + 0.5f));
        const Floats3 ray = times(hn::Div(set(1.0f), hn::Sqrt(dot(direction, direction))), direction);
        hn::StoreU(ray.x, d, &rays.x[x]);
        hn::StoreU(ray.y, d, &rays.y[x]);
        hn::StoreU(ray.z, d, &rays.z[x]);
        hn::StoreU(ground_distance(frame, ray.z), d, &rays.ground_m[x]);
    }
    return rays;
}

RowAir air_of_row(const PictureFrame& frame, const RowRays& rays, const std::vector<float>& distance_m) {
    const Lanes d;
    const std::size_t width = rays.x.size() - kPadding;
    RowAir air;
    for (std::size_t c = 0; c < 3; ++c) {
        air.beta[c].resize(width + kPadding);
        air.light[c].resize(width + kPadding);
    }
    for (std::size_t x = 0; x < width; x += hn::Lanes(d)) {
        const Floats3 ray = ray_at(rays, x);
        const Floats distance = hn::Max(hn::LoadU(d, &distance_m[x]), set(1.0f));
        const Floats3 beta = air_transmittance(frame, ray, distance);
        store_colours(beta, x, air.beta);
        store_colours(air_light(frame, ray, distance, beta), x, air.light);
    }
    return air;
}

RowColours background_of_row(const PictureFrame& frame, const RowRays& rays, const float* shadow,
                             int shadow_size) {
    const std::size_t width = rays.x.size() - kPadding;
    RowColours colours;
    for (auto& of : colours) of.resize(width + kPadding);
    for (std::size_t x = 0; x < width; x += hn::Lanes(Lanes()))
        store_colours(background(frame, {shadow, shadow_size}, ray_at(rays, x)), x, colours);
    return colours;
}

void sunlight_of_height(const PictureFrame& frame, float height_m, float* to) {
    const Floats3 sun = sunlight_at(frame, set(height_m));
    to[0] = hn::GetLane(sun.x);
    to[1] = hn::GetLane(sun.y);
    to[2] = hn::GetLane(sun.z);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(rays_of_row);
HWY_EXPORT(air_of_row);
HWY_EXPORT(background_of_row);
HWY_EXPORT(sunlight_of_height);

RowRays row_rays(const PictureFrame& frame, std::size_t y, std::size_t width) {
    return HWY_DYNAMIC_DISPATCH(rays_of_row)(frame, y, width);
}

RowAir row_air(const PictureFrame& frame, const RowRays& rays, const std::vector<float>& distance_m) {
    return HWY_DYNAMIC_DISPATCH(air_of_row)(frame, rays, distance_m);
}

RowColours row_background(const PictureFrame& frame, const RowRays& rays, const float* shadow,
                          int shadow_size) {
    return HWY_DYNAMIC_DISPATCH(background_of_row)(frame, rays, shadow, shadow_size);
}

Rgb sunlight_at_height(const PictureFrame& frame, double height_m) {
    float sun[3];
    HWY_DYNAMIC_DISPATCH(sunlight_of_height)(frame, float(height_m), sun);
    return {double(sun[0]), double(sun[1]), double(sun[2])};
}

}  // namespace nephos
#endif
