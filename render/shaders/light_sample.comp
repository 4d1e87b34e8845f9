// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.h"
// Step 1, between two slabs: reads the light under the centres of the slab that was just drawn (first .. middle) and
// of the one that is drawn next (middle .. end). A metaball is read on both occasions; the optical depth at its centre
// is interpolated between them, so the light falls off continuously through a slab instead of in steps.

layout(local_size_x = kComputeGroup) in;
layout(set = 0, binding = 1, std430) readonly buffer Balls {
    LightBall balls[];
};
layout(set = 0, binding = 2, std430) buffer Light {
    float light[];
};
layout(set = 0, binding = 4) uniform sampler2D map;
layout(push_constant) uniform Step {
    LightStep step;
};

// Below this, optical depth 69, light is as good as none; log() stays finite.
const float kDark = 1.0e-30;

void main() {
    uint index = step.first + gl_GlobalInvocationID.x;
    if (index >= step.end) return;
    LightBall ball = balls[index];
    vec2 position = vec2(ball.u, ball.v) * vec2(step.clip_per_metre_u, step.clip_per_metre_v);
    float here = max(textureLod(map, 0.5 * position + 0.5, 0.0).r, kDark);
    light[index] = index < step.middle ? exp(mix(log(light[index]), log(here), ball.fraction)) : here;
}
