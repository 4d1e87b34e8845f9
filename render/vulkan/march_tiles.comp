// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
#include "render/shared/march.h"
// view_tiles.comp where rays march through clouds with detail between the splats. An invocation has one pixel: a march
// takes many turns of loops, of which lavapipe allows few.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/detail.glsl"
#include "render/shading/integral.glsl"
#include "render/shading/air.glsl"
#include "render/shading/scattering.glsl"
#include "render/shading/shells.glsl"
#include "render/shading/lighting.glsl"
#include "render/shading/march.glsl"
#include "render/gpu/tiles.glsl"
#include "render/vulkan/parts.glsl"
#include "render/vulkan/tile_splats.glsl"
#include "render/vulkan/add_billboard.glsl"
#include "render/vulkan/march_state.glsl"

layout(constant_id = 8) const bool kBillboards = false;  // some splats are T's billboards

float distance_of(uint index) {
    ViewBall splat = balls[index];
    return length(vec3(splat.x, splat.y, splat.z));
}

void main() {
    uint tile = work_group();
    if (tile >= step.tile_count) return;
    TileRange range = ranges[tile];
    if (kShells) {  // only those between two shells
        uvec2 drawn = drawn_splats();
        range = TileRange(entry_of(drawn.x, range), entry_of(drawn.y, range));
    }
    if (range.begin == range.end && step.first_batch == 0u) return;
    uvec2 first = first_pixel(tile);
    if (first.x >= step.width || first.y >= step.height) return;
    load_sums(first);
    vec2 pixel = vec2(first) + 0.5;
    vec3 ray = pixel_ray(pixel);
    terrain_end = ends[0];
    uint at = first.y * step.width + first.x;
    MarchState state = begin_march(ray);
    if (step.first_batch == 0u) state = load_march(at);
    float end = march_end(ray);
    uint i = range.begin;
    while (i < range.end && transmittance[0] >= opaque[0]) {
        // Splats alone, up to that behind the next sample.
        float limit_m = min(end, distance_of(list[i]));
        while (i < range.end && transmittance[0] >= opaque[0] &&
               (state.distance >= limit_m || transmittance[0] <= kMarchOpaqueFactor * opaque[0])) {
            uint index = list[i++];
            if (kBillboards && unpackHalf2x16(tails[index]).y < 0.0) {
                add_billboard(splats[index].x, pixel);
            } else {
                add_splat(index, pixel);
            }
            if (i < range.end) limit_m = min(end, distance_of(list[i]));
        }
        if (i < range.end && transmittance[0] > kMarchOpaqueFactor * opaque[0]) {
            vec4 sum = vec4(red[0], green[0], blue[0], transmittance[0]);
            march_to(limit_m, ray, opaque[0], state, sum, mean_distance[0]);
            red[0] = sum.r;
            green[0] = sum.g;
            blue[0] = sum.b;
            transmittance[0] = sum.a;
        }
    }
    store_sums(first);
    store_march(at, state);
}
