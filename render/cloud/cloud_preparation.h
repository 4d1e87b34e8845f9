// SPDX-License-Identifier: Apache-2.0
#pragma once

// Preparation of a cloud of metaballs for all back-ends: validation, optical depth scales, bounds, the frame
// of the shadow map, and sorting by distance from the sun (from the camera: render/frame/view_sorting.h).
// Private to the module.
//
// The order is total: equal distances are ordered by index, so images do not depend on the sort algorithm.

#include <cstdint>
#include <span>
#include <vector>

#include "render/cloud/splats.h"
#include "render/image/picture.h"
#include "render/shared/order.h"
#include "render/shared/shared.h"

namespace nephos {

// Values of PreparedCloud::detailed, beside 0: metaballs that take over far away from voxels that are marched, and those
// of voxels that are marched to the horizon.
inline constexpr std::uint8_t kSplattedFarAway = 1, kNeverSplatted = shader::kNeverSplattedBall;

// The metaballs of a cloud with a non-zero extinction.
struct PreparedCloud {
    std::span<const Metaball> metaballs;
    std::vector<std::uint32_t> visible;  // indices into metaballs, rising
    std::vector<float> depth_scale;      // one for each of `visible`: extinction at the centre * radius
    // Likewise: whether it stands for DetailedVoxels; empty: none does.
    std::vector<std::uint8_t> detailed;
    std::uint8_t detail_of(std::size_t i) const { return detailed.empty() ? std::uint8_t{0} : detailed[i]; }
    bool is_detailed(std::size_t i) const { return detail_of(i) != 0; }
    double base_m = 0, top_m = 0;        // world z of the lowest and highest centre
};

// Selects and validates the metaballs. Throws Error(usage) when a metaball is not finite, has no radius, or
// there are more than 2^31 of them.
PreparedCloud prepare(const MetaballCloud& cloud);

// What casts shadows without being a metaball: a sphere around it, and how much of the shade there is its.
struct ShadowCaster {
    Vec3 centre_m{};  // world
    double radius_m = 1;
    double weight = 1;  // opacity times area, m^2
};

// Returns the axes of a shadow map: to the right, which is level (east with the sun in the zenith), and up, as seen from
// the sun.
struct ShadowAxes {
    Vec3 right{1, 0, 0}, up{0, 1, 0};
};
ShadowAxes shadow_axes(const Vec3& to_sun);

// Returns the smallest frame along the sun's rays around all visible metaballs and other casters, with a margin of two
// texels.
ShadowFrame shadow_frame(const PreparedCloud& cloud, const Vec3& to_sun, int shadow_size,
                         std::span<const ShadowCaster> others = {});

// Metaballs projected to the shadow map, nearest to the sun first.
struct LightSortedSplats {
    std::vector<shader::LightSplat> splats;
    std::vector<shader::LightPlace> places;  // of the same metaballs
    std::vector<std::uint32_t> source;       // index into cloud.visible
    float largest_radius = 0;                // metres
};

LightSortedSplats sort_for_light(const PreparedCloud& cloud, const ShadowFrame& frame, int shadow_size);

}  // namespace nephos
