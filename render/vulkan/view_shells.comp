// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Tiles, between the splats: shells of air, front to back.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/air.glsl"
#include "render/shading/scattering.glsl"
#include "render/shading/shells.glsl"

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

void main() {
    uint index = gl_GlobalInvocationID.y * (kGroupRow * kComputeGroup) + gl_GlobalInvocationID.x;
    if (index >= step.width * step.height) return;
    vec4 sum = radiance[index];
    uvec2 pixel = uvec2(index % step.width, index / step.width);
    vec3 ray = pixel_ray(vec2(pixel) + 0.5);
    if (sum.a < opaque_along(ray)) return;
    terrain_end = terrain_at(vec2(pixel));
    SunlitAir sunlit = sunlit_air(ray);
    pixel += uvec2(frame.picture.zw);
    float sum_distance = kFog && step.distances != 0u ? depth[index] : 0.0;
    // Without these bounds masked lanes would take as long as others.
    vec2 part = part_with_air(ray);
    uvec2 drawn = drawn_shells();
    uint last = part.x < part.y ? min(drawn.y, shells_before(part.y) + 1u) : drawn.x;
    for (uint k = max(drawn.x, shells_before(part.x)); k < last; ++k) {
        AirLayer air = air_shell(k, sunlit, ray, pixel);
        sum_distance += sum.a * (1.0 - air.transmittance) * air.distance;
        sum.rgb += sum.a * air.light;
        sum.a *= air.transmittance;
    }
    radiance[index] = sum;
    if (kFog && step.distances != 0u) depth[index] = sum_distance;
}
