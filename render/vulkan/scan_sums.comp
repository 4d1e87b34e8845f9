// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Prefix sums of a table, second: one work group replaces the sums of the blocks by those of the blocks before.
#include "render/vulkan/order.glsl"
#include "render/vulkan/group_sum.glsl"

layout(local_size_x = kSortGroup) in;

void main() {
    uint blocks = groups_of(table_size(), kSortBlock), lane = gl_LocalInvocationID.x;
    uint before = 0u;
    for (uint first = 0u; first < blocks; first += kSortGroup) {
        uint at = first + lane, total;
        uint mine = sum_before(at < blocks ? sums[at] : 0u, total);
        if (at < blocks) sums[at] = add_up(before, mine);
        before = add_up(before, total);
    }
    if (lane == 0u) counts.total = before;
}
