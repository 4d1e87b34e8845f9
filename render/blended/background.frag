// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// Step 2, first: what lies behind the clouds.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/air.glsl"
#include "render/shading/background.glsl"

layout(location = 0) out vec4 radiance;  // alpha: transmittance of the clouds, none so far
layout(location = 1) out vec4 depth;

void main() {
    terrain_end = terrain_at(gl_FragCoord.xy);
    radiance = vec4(background(pixel_ray(gl_FragCoord.xy)), 1.0);
    depth = vec4(0.0, 0.0, 0.0, 1.0);
}
