// SPDX-License-Identifier: Apache-2.0
// view_project.comp for T's billboards, where a picture has some. As a splat a billboard has the index of four further
// vectors behind the last splat that there is room for:
//
//     centre, pixels; 1 / half size, pixels
//     halves: l0 l0 l0 l1 l1 l1 l2 l2
//     halves: l2 l3 l3 l3, radiance of the air (3), 0
//     opacity, distance in metres, texture_bits, 0
//
// With s and t from -1 to 1 across it, to the right and up, its light is l0 + s l1 + t l2 + max(t - s, 0) l3: that of its
// corners over two triangles.
#include "render/shading/billboards.glsl"

layout(set = 0, binding = 16, std430) readonly buffer Billboards {
    SeenBillboard billboards[];
};
layout(set = 0, binding = 17, std430) readonly buffer Clouds {
    ViewCloud clouds[];
};
layout(set = 0, binding = 2, std430) writeonly buffer BillboardSplats {
    uvec4 billboard_splats[];
};

uint bounded_halves(float low, float high) {
    return packHalf2x16(clamp(vec2(low, high), vec2(-60000.0), vec2(60000.0)));
}

// `index`: of the splat; `number`: of the billboard.
void project_billboard(uint index, uint number) {
    ViewBillboard billboard = billboards[number].billboard;
    ViewCloud cloud = clouds[billboard.cloud];
    BillboardAxes axes = billboard_axes();
    vec3 centre = vec3(billboard.x, billboard.y, billboard.z);
    float distance = length(centre);
    vec2 half_picture = 0.5 * frame.picture.xy;
    vec2 to_pixels = axes.per_metre * half_picture / dot(frame.forward.xyz, centre);
    vec2 pixel = half_picture + vec2(dot(axes.right, centre), -dot(axes.up, centre)) * to_pixels - frame.picture.zw;
    vec2 reach = unpackHalf2x16(billboard.half_size);
    vec3 right = reach.x * axes.right, up = reach.y * axes.up;

    BillboardAir air = billboard_air(billboard, centre, distance);
    vec3 low = air.transmitted * billboard_light_at(centre - right - up, billboard, cloud);
    vec3 beside = air.transmitted * billboard_light_at(centre + right - up, billboard, cloud);
    vec3 high = air.transmitted * billboard_light_at(centre + right + up, billboard, cloud);
    vec3 above = air.transmitted * billboard_light_at(centre - right + up, billboard, cloud);
    vec3 l0 = 0.5 * (low + high), l1 = 0.5 * (beside - low), l2 = 0.5 * (high - beside);
    vec3 l3 = 0.5 * (above - low + beside - high);

    uint at = step.tile_count + 4u * number;
    billboard_splats[index] = uvec4(at, 0u, 0u, 0u);
    tails[index] = packHalf2x16(vec2(0.0, -1.0));
    billboard_splats[at] = uvec4(floatBitsToUint(pixel), floatBitsToUint(1.0 / (reach * to_pixels)));
    billboard_splats[at + 1u] = uvec4(bounded_halves(l0.r, l0.g), bounded_halves(l0.b, l1.r), bounded_halves(l1.g, l1.b),
                                 bounded_halves(l2.r, l2.g));
    billboard_splats[at + 2u] = uvec4(bounded_halves(l2.b, l3.r), bounded_halves(l3.g, l3.b),
                                 bounded_halves(air.veil.r, air.veil.g), bounded_halves(air.veil.b, 0.0));
    billboard_splats[at + 3u] = uvec4(floatBitsToUint(billboard.opacity), floatBitsToUint(distance), billboard.texture_bits, 0u);
}
