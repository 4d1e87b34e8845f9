// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// The shadow map: optical depth of all metaballs along the light through each texel. A sum, so order does not matter.
#include "render/gpu/tiles.glsl"

layout(set = 0, binding = 2, std430) readonly buffer Splats {
    uvec4 splats[];  // LightSplat
};
layout(set = 0, binding = 8, std430) buffer Depths {
    float depths[];
};
layout(set = 0, binding = 10, r32f) uniform writeonly image2D map;

float sums[kRows];

void add_splat(vec4 splat, float depth_scale, vec2 texel) {
    float dx = texel.x - splat.x, dy = texel.y - splat.y;
    float square = splat.z * dx * dx + splat.w * dy * dy;
    float step = splat.w * (2.0 * dy + 1.0), bend = 2.0 * splat.w;
    [[unroll]] for (uint row = 0u; row < kRows; ++row) {
        float w = max(1.0 - square, 0.0);
        sums[row] += depth_scale * line_integral(w, sqrt(w));
        square += step;
        step += bend;
    }
}

void main() {
    uint tile = work_group();
    if (tile >= step.tile_count) return;
    uvec2 first = first_pixel(tile);
    vec2 texel = vec2(first) + 0.5;
    [[unroll]] for (uint row = 0u; row < kRows; ++row) sums[row] = 0.0;
    TileRange range = ranges[tile];
    for (uint base = range.begin; base < range.end; base += 8u) {
        if (kShared) {
            uint at = base + gl_SubgroupInvocationID % 8u;
            uvec4 words = splats[list[min(at, range.end - 1u)]];
            vec4 splat = light_splat(words);
            float depth_scale = at < range.end ? uintBitsToFloat(words.w) : 0.0;
            [[unroll]] for (uint k = 0u; k < 8u; ++k)
                add_splat(subgroupBroadcast(splat, k), subgroupBroadcast(depth_scale, k), texel);
        } else {
            for (uint i = base; i < min(base + 8u, range.end); ++i) {
                uvec4 words = splats[list[i]];
                add_splat(light_splat(words), uintBitsToFloat(words.w), texel);
            }
        }
    }
    [[unroll]] for (uint row = 0u; row < kRows; ++row) {
        uvec2 at = first + uvec2(0u, row);
        if (at.x < step.width && at.y < step.height) {
            uint index = at.y * step.width + at.x;
            float sum = sums[row] + (step.first_batch != 0u ? 0.0 : depths[index]);
            depths[index] = step.last_batch != 0u ? exp(-sum) : sum;
            if (step.last_batch != 0u) imageStore(map, ivec2(at), vec4(exp(-sum)));
        }
    }
}
