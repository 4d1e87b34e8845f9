// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Tiles, first: each metaball as a splat on the screen, with its light.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/air.glsl"
#include "render/shading/scattering.glsl"
#include "render/shading/shells.glsl"
#include "render/shading/lighting.glsl"

layout(local_size_x = kComputeGroup) in;
layout(set = 0, binding = 1, std430) readonly buffer Balls {
    ViewBall balls[];
};
layout(set = 0, binding = 2, std430) writeonly buffer Splats {
    ViewSplat splats[];
};
layout(set = 0, binding = 7, std430) writeonly buffer Tails {
    SplatTail tails[];
};
layout(push_constant) uniform Step {
    TileStep step;
};
layout(constant_id = 8) const bool kBillboards = false;  // some splats are T's billboards
#include "render/vulkan/project_billboard.glsl"

void main() {
    uint index = gl_GlobalInvocationID.y * (kGroupRow * kComputeGroup) + gl_GlobalInvocationID.x;
    if (index >= step.tile_count) return;
    ViewBall ball = balls[index];
    if (kBillboards && (ball.flags & kBillboardFlag) != 0u) {
        project_billboard(index, ball.flags >> 4);
        return;
    }
    vec3 centre = vec3(ball.x, ball.y, ball.z);
    float distance = length(centre);
    float radius = drawn_radius(ball, distance);
    float thinning = ball.radius / radius;
    float depth_scale = ball.depth_scale * thinning * thinning;

    float depth = dot(frame.forward.xyz, centre);
    float radius_pixels = radius * frame.up.w / depth;
    Scattered light = seen_through_shell(scattered_light(ball, distance), centre, distance);
    vec3 radiance = clamp(radiance_of_disc(light, centre / distance, radius / distance), vec3(-60000.0), vec3(60000.0));
    vec2 plane = vec2(dot(frame.right.xyz, centre) / dot(frame.right.xyz, frame.right.xyz),
                      dot(frame.up.xyz, centre) / dot(frame.up.xyz, frame.up.xyz)) / depth;
    vec2 pixel = (0.5 * vec2(plane.x, -plane.y) + 0.5) * frame.picture.xy - frame.picture.zw;
    splats[index] = ViewSplat(pixel.x, pixel.y, packHalf2x16(vec2(radius_pixels, sqrt(depth_scale))),
                              packHalf2x16(radiance.rg));
    tails[index] = packHalf2x16(vec2(radiance.b, (ball.flags & kNotFitted) != 0u ? 0.0 : distance / kDistanceUnit));
}
