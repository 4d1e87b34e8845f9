// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.h"
// Step 2, first: what lies behind the clouds.
#include "frame.glsl"
#include "ray.glsl"
#include "air.glsl"
#include "background.glsl"

layout(location = 0) out vec4 radiance;  // alpha: transmittance of the clouds, none so far
layout(location = 1) out vec4 depth;

void main() {
    radiance = vec4(background(pixel_ray(gl_FragCoord.xy)), 1.0);
    depth = vec4(0.0, 0.0, 0.0, 1.0);
}
