// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Tiles, second: the splats of a tile, front to back, until it is opaque:
//
//     sum += transmittance * opacity * radiance          transmittance *= 1 - opacity
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/integral.glsl"
#include "render/shading/air.glsl"
#include "render/shading/scattering.glsl"
#include "render/shading/shells.glsl"
#include "render/shading/lighting.glsl"
#include "render/gpu/tiles.glsl"
#include "render/vulkan/parts.glsl"

#include "render/vulkan/tile_splats.glsl"

// Whether some splats are not fitted. Without them nothing in the loop depends on the lane, which lavapipe would answer
// with a mask on every value that the loop changes.
layout(constant_id = 3) const bool kMixed = false;
layout(constant_id = 8) const bool kBillboards = false;  // some splats are T's billboards

bool is_opaque() {
    float most = -1.0;
    [[unroll]] for (uint row = 0u; row < kRows; ++row) most = max(most, transmittance[row] - opaque[row]);
    return kShared ? subgroupAll(most < 0.0) : most < 0.0;
}

// Eight splats that are all fitted, one of each lane in turn.
void add_shared(Splat mine, vec2 pixel) {
    [[unroll]] for (uint k = 0u; k < 8u; ++k) {
        Splat splat;
        splat.pixel = subgroupBroadcast(mine.pixel, k);
        splat.form = subgroupBroadcast(mine.form, k);
        splat.low = subgroupBroadcast(mine.low, k);
        splat.high = subgroupBroadcast(mine.high, k);
        splat.colour = subgroupBroadcast(mine.colour, k);
        splat.distance = subgroupBroadcast(mine.distance, k);
        add_fitted(splat, pixel);
    }
}

// Eight splats at a time: each lane fetches one. Lanes beyond the end of the list fetch splats without opacity.
void add_all(TileRange range, vec2 pixel) {
    for (uint base = range.begin; base < range.end; base += 8u) {
        uint end = min(base + 8u, range.end);
        bool fitted = kShared;
        if (kShared) {
            uint at = base + gl_SubgroupInvocationID % 8u;
            uint index = list[min(at, end - 1u)];
            Splat mine = unpack(splats[index], tails[index]);
            if (kMixed) fitted = subgroupAll(mine.distance > 0.0);
            if (at >= end) {
                mine.low = vec3(0.0);
                mine.high = vec3(0.0);
            }
            if (!kMixed || fitted) add_shared(mine, pixel);
        }
        if (!kShared || (kMixed && !fitted)) {
            for (uint i = base; i < end; ++i) add_splat(list[i], pixel);
        }
        if (is_opaque()) break;
    }
}

#include "render/vulkan/add_billboard.glsl"

bool is_billboard(uint entry) { return unpackHalf2x16(tails[list[entry]]).y < 0.0; }

// Metaballs up to the next billboard, billboards up to the next metaball, and so on. In loops, because lavapipe works
// through both sides of a branch.
void add_all_and_billboards(TileRange range, vec2 pixel) {
    uint i = range.begin;
    while (i < range.end && !is_opaque()) {
        while (i < range.end && !is_billboard(i) && !is_opaque()) add_splat(list[i++], pixel);
        while (i < range.end && is_billboard(i) && !is_opaque()) add_billboard(splats[list[i++]].x, pixel);
    }
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
    load_sums(first);
    vec2 pixel = vec2(first) + 0.5;
    if (kBillboards) {
        add_all_and_billboards(range, pixel);
    } else {
        add_all(range, pixel);
    }
    store_sums(first);
}
