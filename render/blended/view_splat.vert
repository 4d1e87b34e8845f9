// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// Step 2: the billboard of a metaball facing the eye, and the light that it scatters.
#include "render/blended/attenuation.glsl"
#include "render/blended/quad.glsl"
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/air.glsl"
#include "render/shading/scattering.glsl"
#include "render/shading/shells.glsl"
#include "render/shading/lighting.glsl"

layout(set = 0, binding = 1, std430) readonly buffer Balls {
    ViewBall balls[];
};

layout(location = 0) out vec2 point;              // on the billboard, in radii
layout(location = 1) flat out vec3 diffuse;       // radiance that does not depend on the ray
layout(location = 2) flat out vec3 direct;        // radiance per light that is scattered once
layout(location = 3) flat out vec4 shape;         // depth scale, level, (radius / distance)^2, distance
layout(location = 4) flat out vec4 centre_radius;

// Two unit vectors perpendicular to n and to each other; steady everywhere but at n.z = 0, where they only turn about n.
void perpendicular(vec3 n, out vec3 u, out vec3 v) {
    float sign_z = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (sign_z + n.z);
    float b = n.x * n.y * a;
    u = vec3(1.0 + sign_z * n.x * n.x * a, sign_z * b, -sign_z * n.x);
    v = vec3(b, sign_z + n.y * n.y * a, -n.y);
}

vec4 clip_position(vec3 position, float radius) {
    float depth = dot(frame.forward.xyz, position);
    vec2 picture = vec2(dot(frame.right.xyz, position) / dot(frame.right.xyz, frame.right.xyz),
                        -dot(frame.up.xyz, position) / dot(frame.up.xyz, frame.up.xyz));
    vec2 tile = picture * frame.part.xy + depth * frame.part.zw;
    // z keeps what is closer than a tiny fraction of the radius to the eye's plane out of the division.
    return vec4(tile, 0.5 * (depth - 1.0e-4 * radius), depth);
}

void main() {
    ViewBall ball = balls[gl_VertexIndex / 6];
    vec2 corner = square_corner(uint(gl_VertexIndex));
    vec3 centre = vec3(ball.x, ball.y, ball.z);
    float distance = length(centre);
    centre_radius = vec4(centre, ball.radius);
    Scattered light = seen_through_shell(scattered_light(ball, distance), centre, distance);
    diffuse = light.diffuse;
    direct = light.direct;
    if ((ball.flags & kAround) != 0u) {
        // There is no useful plane: the whole picture asks for the integral.
        point = corner;
        shape = vec4(ball.depth_scale, 0.0, 1.0, distance);
        gl_Position = vec4(corner, 0.5, 1.0);
        return;
    }
    // Widen what is smaller than a pixel and thin it out: its optical depth times area stays.
    float radius = drawn_radius(ball, distance);
    float thinning = ball.radius / radius;
    float depth_scale = ball.depth_scale * thinning * thinning;
    centre_radius.w = radius;
    float ratio = radius / distance;
    if ((ball.flags & kIntegrate) == 0u) {  // so small that one phase serves for all rays
        diffuse = radiance_of_disc(light, centre / distance, ratio);
        direct = vec3(0.0);
    }
    // Seen from a finite distance the ball's outline is a circle a little larger than its radius.
    float outline = inversesqrt(max(1.0 - ratio * ratio, 0.1));
    vec3 u, v;
    perpendicular(centre / distance, u, v);
    point = corner * outline;
    shape = vec4(depth_scale, level_of(depth_scale), ratio * ratio, distance);
    gl_Position = clip_position(centre + radius * (point.x * u + point.y * v), radius);
}
