// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// Step 2, T's billboards: their corners, and T's light at each of them.
#include "render/blended/quad.glsl"
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/air.glsl"
#include "render/shading/scattering.glsl"
#include "render/shading/shells.glsl"
#include "render/shading/billboards.glsl"

layout(set = 0, binding = 1, std430) readonly buffer ViewBillboards {
    ViewBillboard billboards[];
};
layout(set = 0, binding = 2, std430) readonly buffer Clouds {
    ViewCloud clouds[];
};

layout(location = 0) out vec2 coordinate;
layout(location = 1) out vec3 lit;  // radiance of the cloud, times what the air lets through and opacity
layout(location = 2) flat out vec4 veil;          // radiance of the air, times opacity; opacity
layout(location = 3) flat out vec3 layer_level_distance;

void main() {
    ViewBillboard billboard = billboards[gl_VertexIndex / 6];
    vec2 corner = square_corner(uint(gl_VertexIndex));
    vec3 centre = vec3(billboard.x, billboard.y, billboard.z);
    float distance = length(centre);
    // Parallel to the picture's plane: all corners have the depth of the centre.
    BillboardAxes axes = billboard_axes();
    vec2 reach = corner * unpackHalf2x16(billboard.half_size);
    float depth = dot(frame.forward.xyz, centre);
    vec2 picture = axes.per_metre * (vec2(dot(axes.right, centre), dot(axes.up, centre)) + reach) * vec2(1.0, -1.0);
    gl_Position = vec4(picture * frame.part.xy + depth * frame.part.zw, 0.5 * depth, depth);

    vec3 position = centre + reach.x * axes.right + reach.y * axes.up;
    BillboardAir air = billboard_air(billboard, centre, distance);
    coordinate = billboard_coordinate(corner, billboard.texture_bits >> 8 & 15u);
    lit = air.transmitted * billboard_light_at(position, billboard, clouds[billboard.cloud]);
    veil = vec4(air.veil, billboard.opacity);
    layer_level_distance = vec3(uvec2(billboard.texture_bits & 255u, billboard.texture_bits >> 12 & 15u), distance);
}
