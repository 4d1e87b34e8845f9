// SPDX-License-Identifier: Apache-2.0
#pragma once

// What happens to a cloud of metaballs before the device sees it: checks, optical depth scales, bounds, the
// frame of the shadow map, and the order from the sun (that from the eye: view_sorting.h). No Vulkan here.
// Private to the module.
//
// The order is total: equal distances are ordered by index, so a picture never depends on how a sort is done.

#include <cstdint>
#include <span>
#include <vector>

#include "render/cloud/splats.h"
#include "render/image/picture.h"
#include "render/shared/shared.h"

namespace nephos {

// The metaballs that draw anything.
struct PreparedCloud {
    std::span<const Metaball> metaballs;
    std::vector<std::uint32_t> visible;  // indices into metaballs, rising
    std::vector<float> depth_scale;      // one for each of `visible`: extinction at the centre * radius
    double base_m = 0, top_m = 0;        // world z of the lowest and highest centre
};

// Throws Error(usage) when a metaball is not finite, has no radius, or there are more than 2^31 of them.
PreparedCloud prepare(const MetaballCloud& cloud);

// The smallest frame along the sun's rays around all visible metaballs, with a margin of two texels.
ShadowFrame shadow_frame(const PreparedCloud& cloud, const Vec3& to_sun, int shadow_size);

// Metaballs as the shadow map sees them, nearest to the sun first.
struct LightSortedSplats {
    std::vector<shader::LightSplat> splats;
    std::vector<shader::LightPlace> places;  // of the same metaballs
    std::vector<std::uint32_t> source;       // index into cloud.visible
    float largest_radius = 0;                // metres
};

LightSortedSplats sort_for_light(const PreparedCloud& cloud, const ShadowFrame& frame, int shadow_size);

}  // namespace nephos
