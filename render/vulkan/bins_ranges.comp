// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Lists of the tiles, last: where each tile's entries begin and end among those sorted by tile.
#include "render/vulkan/order.glsl"

layout(local_size_x = kSortGroup) in;

uint entries_before(uint tile) {
    uint begin = 0u, end = counts.entries;
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
    if (tile >= step.tiles) return;
    ranges[tile] = TileRange(entries_before(tile), entries_before(tile + 1u));
}
