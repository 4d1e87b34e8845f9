// SPDX-License-Identifier: Apache-2.0
#pragma once

// What happens to a cloud of metaballs before the device sees it: checks, optical depth scales, bounds, the
// frame of the shadow map, and the order from the sun (that from the eye: eye_order.h). No Vulkan here.
// Private to the module.
//
// The order is total: equal distances are ordered by index, so a picture never depends on how a sort is done.

#include <cstdint>
#include <span>
#include <vector>

#include "render/picture.h"
#include "render/shaders/shared.h"
#include "render/splats.h"

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

// Consecutive metaballs in the order from the sun. Within a slab order does not matter (light is read before
// and behind it); those too dense for the textures come last.
struct Slab {
    std::uint32_t begin = 0, dense = 0, end = 0;  // begin <= dense <= end; [dense, end) are too dense
};

struct SunOrder {
    std::vector<shader::LightBall> balls;  // nearest to the sun first, slab by slab
    std::vector<Slab> slabs;               // none is empty; together they are all of balls
};

// Slabs of equal thickness: half the mean radius, but at most `max_slabs` of them.
SunOrder order_from_sun(const PreparedCloud& cloud, const ShadowFrame& frame, int max_slabs);

}  // namespace nephos
