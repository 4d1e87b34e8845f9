// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Light at the centres, first: how many items of work each tile has (the table), then, with the sums of those before,
// the items themselves. Keys are the tiles of the centres, sorted.
#include "render/vulkan/order.glsl"
#include "render/vulkan/exact_distance.glsl"
#include "render/vulkan/sun.glsl"

layout(local_size_x = kSortGroup) in;
layout(constant_id = 0) const bool kWrite = false;

uint centres_before(uint tile) {
    uint begin = 0u, end = counts.visible;
    while (begin < end) {
        uint middle = (begin + end) / 2u;
        if (keys_from[middle] < tile) {
            begin = middle + 1u;
        } else {
            end = middle;
        }
    }
    return begin;
}

void main() {
    uint tile = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (kWrite && tile == 0u) counts.items = dispatch_of(counts.total);
    if (tile >= step.tiles) return;
    uint first = centres_before(tile), end = centres_before(tile + 1u);
    if (!kWrite) {
        table[tile] = groups_of(end - first, step.per_item);
        return;
    }
    for (uint n = table[tile]; first < end; ++n, first += step.per_item)
        items[n] = LightItem(tile, first, min(step.per_item, end - first), 0u);
}
