// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.h"
// Step 1: the billboard of a metaball, seen from the sun.
#include "attenuation.glsl"
#include "billboard.glsl"

layout(set = 0, binding = 1, std430) readonly buffer Balls {
    LightBall balls[];
};
layout(push_constant) uniform Step {
    LightStep step;
};

layout(location = 0) out vec2 point;
layout(location = 1) flat out vec2 depth_scale_and_level;

void main() {
    LightBall ball = balls[gl_VertexIndex / 6];
    vec2 corner = square_corner(uint(gl_VertexIndex));
    // Optical depth times area is what a widened billboard keeps.
    vec2 size = max(vec2(ball.radius), vec2(step.min_radius_u, step.min_radius_v));
    float depth_scale = ball.depth_scale * ball.radius * ball.radius / (size.x * size.y);
    point = corner;
    depth_scale_and_level = vec2(depth_scale, level_of(depth_scale));
    vec2 position = (vec2(ball.u, ball.v) + corner * size) * vec2(step.clip_per_metre_u, step.clip_per_metre_v);
    gl_Position = vec4(position, 0.5, 1.0);
}
