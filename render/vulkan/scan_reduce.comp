// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Prefix sums of a table, first: the sum of each block.
#include "render/vulkan/order.glsl"
#include "render/vulkan/group_sum.glsl"

layout(local_size_x = kSortGroup) in;

void main() {
    uint size = table_size(), block = work_group();
    if (block >= groups_of(size, kSortBlock)) return;
    uint mine = 0u, total;
    for (uint at = block * kSortBlock + gl_LocalInvocationID.x, n = 0u; n < kSortBlock; at += kSortGroup, n += kSortGroup) {
        if (at < size) mine = add_up(mine, table[at]);
    }
    sum_before(mine, total);
    if (gl_LocalInvocationID.x == 0u) sums[block] = total;
}
