// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// Light at the centres of metaballs: the optical depth of the part of every metaball that lies between a centre and the
// sun, exact for each (partial_line_integral). A work group has centres of one tile; splats and centres come in order from the sun.
#include "render/gpu/tiles.glsl"

layout(set = 0, binding = 1, std430) buffer Queries {
    vec4 queries[];  // LightQuery
};
layout(set = 0, binding = 2, std430) readonly buffer Splats {
    uvec4 splats[];  // LightSplat
};
layout(set = 0, binding = 7, std430) readonly buffer Items {
    LightItem items[];
};
layout(set = 0, binding = 9, std430) readonly buffer Places {
    vec2 places[];  // LightPlace
};

vec3 centres[kQueriesPerLane];
float depths[kQueriesPerLane];

void add_splat(vec4 splat, float depth_scale, vec2 place) {
    [[unroll]] for (uint n = 0u; n < kQueriesPerLane; ++n) {
        float dx = centres[n].x - splat.x, dy = centres[n].y - splat.y;
        float w = max(1.0 - (splat.z * dx * dx + splat.w * dy * dy), 0.0);
        float half_chord = sqrt(w);
        float end = clamp((centres[n].z - place.x) * place.y, -half_chord, half_chord);
        float whole = line_integral(w, half_chord);
        depths[n] += depth_scale * (0.5 * whole + partial_line_integral(w, end));
    }
}

void main() {
    uint number = work_group();
    if (number >= step.tile_count) return;
    LightItem item = items[number];
    if (item.count == 0u) return;  // the device's own lists of items end with such
    uint lanes = gl_WorkGroupSize.x;
    [[unroll]] for (uint n = 0u; n < kQueriesPerLane; ++n) {
        centres[n] = queries[item.first + min(n * lanes + gl_LocalInvocationID.x, item.count - 1u)].xyz;
        depths[n] = 0.0;
    }
    float farthest = queries[item.first + item.count - 1u].z + step.largest_radius;
    TileRange range = ranges[item.tile];
    for (uint base = range.begin; base < range.end; base += 8u) {
        uint end = min(base + 8u, range.end);
        if (kShared) {
            uint at = base + gl_SubgroupInvocationID % 8u;
            uint index = list[min(at, end - 1u)];
            vec2 place = places[index];
            if (subgroupBroadcast(place.x, 0u) > farthest) break;
            uvec4 words = splats[index];
            vec4 splat = light_splat(words);
            float depth_scale = at < end ? uintBitsToFloat(words.w) : 0.0;
            [[unroll]] for (uint k = 0u; k < 8u; ++k)
                add_splat(subgroupBroadcast(splat, k), subgroupBroadcast(depth_scale, k), subgroupBroadcast(place, k));
        } else {
            if (places[list[base]].x > farthest) break;
            for (uint i = base; i < end; ++i) {
                uvec4 words = splats[list[i]];
                add_splat(light_splat(words), uintBitsToFloat(words.w), places[list[i]]);
            }
        }
    }
    [[unroll]] for (uint n = 0u; n < kQueriesPerLane; ++n) {
        uint mine = n * lanes + gl_LocalInvocationID.x;
        if (mine < item.count) queries[item.first + mine].w += depths[n];
    }
}
