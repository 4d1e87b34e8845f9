// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Order from the sun, last: metaballs on the shadow map (sort_for_light() of cloud_preparation.h), the tiles that they
// touch, and as keys the tiles that their centres are in (bin_centres()).
#include "render/vulkan/order.glsl"
#include "render/vulkan/exact_distance.glsl"
#include "render/vulkan/sun.glsl"

layout(local_size_x = kSortGroup) in;

// Stores the tiles of the map that a splat touches.
void store_box(uint k, vec2 centre, vec2 radii) {
    ivec2 size = ivec2(step.width, step.height);
    ivec2 first = max(ivec2(clamp(floor(centre - radii), vec2(-1.0e6), vec2(1.0e6))), ivec2(0));
    ivec2 end = min(ivec2(clamp(ceil(centre + radii), vec2(-1.0e6), vec2(1.0e6))), size);
    uvec2 low = uvec2(0u), high = uvec2(0u), tile = uvec2(kTileWidth, kTileHeight);
    if (first.x < end.x && first.y < end.y) {
        low = uvec2(first) / tile;
        high = (uvec2(end) + tile - 1u) / tile;
    }
    boxes[k] = uvec2(low.x | low.y << 16, high.x | high.y << 16);
}

void main() {
    uint k = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (k >= counts.visible) return;
    uint i = values_from[k];
    CloudBall ball = cloud[i];
    vec3 offset = offset_from_corner(ball);
    vec2 centre = vec2(dot(sun.u.xyz, offset), dot(sun.v.xyz, offset)), texel_m = vec2(sun.u.w, sun.v.w);
    // A metaball smaller than a texel is widened, with the same product of optical depth and area.
    vec2 radii = max(ball.radius / texel_m, vec2(kMinRadiusPixels)), thinning = ball.radius / (radii * texel_m);
    uint packed = packHalf2x16(radii);
    splats[k] = LightSplat(centre.x, centre.y, packed, ball.depth_scale * thinning.x * thinning.y);
    places[k] = LightPlace(uintBitsToFloat(keys_from[k]), 1.0 / ball.radius);
    sources[k] = i;
    store_box(k, centre, unpackHalf2x16(packed));
    uvec2 own = uvec2(clamp(centre, vec2(0.0), vec2(step.width, step.height) - 1.0)) / uvec2(kTileWidth, kTileHeight);
    keys_to[k] = own.y * step.columns + own.x;
    values_to[k] = k;
}
