// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// Tiles, last: what is seen of the background behind the clouds.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/air.glsl"
#include "render/shading/background.glsl"

layout(local_size_x = kComputeGroup) in;
layout(set = 0, binding = 8, std430) buffer Radiance {
    vec4 radiance[];  // w: transmittance
};
layout(push_constant) uniform Step {
    TileStep step;
};

void main() {
    uint index = gl_GlobalInvocationID.y * (kGroupRow * kComputeGroup) + gl_GlobalInvocationID.x;
    if (index >= step.width * step.height) return;
    vec2 pixel = vec2(index % step.width, index / step.width) + 0.5;
    vec4 clouds = radiance[index];
    terrain_end = terrain_at(pixel);
    if (clouds.a > 0.0) radiance[index].rgb = clouds.rgb + clouds.a * background(pixel_ray(pixel));
}
