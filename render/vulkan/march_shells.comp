// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
#include "render/shared/march.h"
// view_shells.comp where rays march through clouds with detail: up to the end of each shell, before it.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/detail.glsl"
#include "render/shading/air.glsl"
#include "render/shading/scattering.glsl"
#include "render/shading/shells.glsl"
#include "render/shading/march.glsl"

layout(local_size_x = kComputeGroup) in;
layout(set = 0, binding = 8, std430) buffer Radiance {
    vec4 radiance[];  // w: transmittance
};
layout(set = 0, binding = 9, std430) buffer Depth {
    float depth[];
};
layout(push_constant) uniform Step {
    TileStep step;
};
#include "render/vulkan/parts.glsl"
#include "render/vulkan/march_state.glsl"

void main() {
    uint index = gl_GlobalInvocationID.y * (kGroupRow * kComputeGroup) + gl_GlobalInvocationID.x;
    if (index >= step.width * step.height) return;
    vec4 sum = radiance[index];
    uvec2 pixel = uvec2(index % step.width, index / step.width);
    vec3 ray = pixel_ray(vec2(pixel) + 0.5);
    float opaque = opaque_along(ray);
    if (sum.a < opaque) return;
    terrain_end = terrain_at(vec2(pixel));
    SunlitAir sunlit = sunlit_air(ray);
    pixel += uvec2(frame.picture.zw);
    float sum_distance = step.distances != 0u ? depth[index] : 0.0;
    MarchState state = load_march(index);
    vec2 part = part_with_air(ray);
    uvec2 drawn = drawn_shells();
    uint first = max(drawn.x, shells_before(part.x));
    uint last = part.x < part.y ? min(drawn.y, shells_before(part.y) + 1u) : drawn.x;
    float end = march_end(ray);
    uint k = drawn.x;
    while (k < drawn.y) {
        // Air alone, up to the shell with the next sample.
        bool marches = state.distance < end && sum.a > kMarchOpaqueFactor * opaque;
        uint next = marches ? max(k, min(shells_before(state.distance), drawn.y)) : drawn.y;
        for (uint n = max(k, first); n < min(next, last); ++n) {
            AirLayer air = air_shell(n, sunlit, ray, pixel);
            sum_distance += sum.a * (1.0 - air.transmittance) * air.distance;
            sum.rgb += sum.a * air.light;
            sum.a *= air.transmittance;
        }
        k = next;
        if (k < drawn.y) march_to(min(end, shell_end(k)), ray, opaque, state, sum, sum_distance);
    }
    store_march(index, state);
    radiance[index] = sum;
    if (step.distances != 0u) depth[index] = sum_distance;
}
