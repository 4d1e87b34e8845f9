// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/march.h"
// view_finish.comp where rays march through clouds with detail: to their ends, before the background.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/detail.glsl"
#include "render/shading/air.glsl"
#include "render/shading/background.glsl"
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

#include "render/vulkan/march_state.glsl"

void main() {
    uint index = gl_GlobalInvocationID.y * (kGroupRow * kComputeGroup) + gl_GlobalInvocationID.x;
    if (index >= step.width * step.height) return;
    vec2 pixel = vec2(index % step.width, index / step.width) + 0.5;
    vec4 clouds = radiance[index];
    vec3 ray = pixel_ray(pixel);
    float opaque = opaque_along(ray);
    if (clouds.a < opaque) return;
    terrain_end = terrain_at(pixel);
    MarchState state = load_march(index);
    float sum_distance = step.distances != 0u ? depth[index] : 0.0;
    march_to(march_end(ray), ray, opaque, state, clouds, sum_distance);
    if (clouds.a < opaque) clouds.a = 0.0;
    clouds.rgb += clouds.a * background(ray);
    radiance[index] = clouds;
    if (step.distances != 0u) depth[index] = sum_distance;
}
