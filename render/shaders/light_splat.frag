// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.h"
// Step 1: multiplies the light behind a metaball by its transmittance.
#include "attenuation.glsl"

// Metaballs denser than the last texture: their rim would be narrower than a texel.
layout(constant_id = 0) const bool kExact = false;

layout(location = 0) in vec2 point;
layout(location = 1) flat in vec2 depth_scale_and_level;

layout(location = 0) out vec4 transmittance;

void main() {
    float opacity = kExact ? 1.0 - exp(-depth_scale_and_level.x * column(max(1.0 - dot(point, point), 0.0)))
                           : billboard_opacity(point, depth_scale_and_level.y);
    transmittance = vec4(1.0 - opacity);
}
