// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Lists of the tiles, third: a pair of tile and splat for each entry, in the order of the splats. An invocation has one
// entry, however many tiles a splat touches; it looks for the splat among those of its work group.
#include "render/vulkan/order.glsl"

layout(local_size_x = kSortGroup) in;
shared uint group_ends[2];

// The splat of an entry, from `begin` to `end` - 1: the last whose entries begin there or before.
uint splat_of(uint entry, uint begin, uint end) {
    while (begin + 1u < end) {
        uint middle = (begin + end) / 2u;
        if (table[middle] <= entry) {
            begin = middle;
        } else {
            end = middle;
        }
    }
    return begin;
}

void main() {
    uint lane = gl_LocalInvocationID.x, first = work_group() * kSortGroup;
    if (first >= counts.entries) return;
    if (lane < 2u) {
        uint entry = min(first + lane * (kSortGroup - 1u), counts.entries - 1u);
        group_ends[lane] = splat_of(entry, 0u, counts.visible);
    }
    barrier();
    uint entry = first + lane;
    if (entry >= counts.entries) return;
    uint splat = splat_of(entry, group_ends[0], group_ends[1] + 1u), place = entry - table[splat];
    uvec2 box = boxes[splat];
    uint x = box.x & 0xffffu, y = box.x >> 16, columns = (box.y & 0xffffu) - x;
    keys_to[entry] = (y + place / columns) * step.columns + x + place % columns;
    values_to[entry] = splat;
}
