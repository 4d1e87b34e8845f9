// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Prefix sums of a table, last: each number becomes the sum of those before it.
#include "render/vulkan/order.glsl"
#include "render/vulkan/group_sum.glsl"

layout(local_size_x = kSortGroup) in;
const uint kEach = kSortBlock / kSortGroup;  // numbers of an invocation, one after the other

void main() {
    uint size = table_size(), block = work_group();
    if (block >= groups_of(size, kSortBlock)) return;
    uint first = block * kSortBlock + gl_LocalInvocationID.x * kEach;
    uint numbers[kEach], mine = 0u, total;
    for (uint n = 0u; n < kEach; ++n) {
        numbers[n] = first + n < size ? table[first + n] : 0u;
        mine = add_up(mine, numbers[n]);
    }
    uint sum = add_up(sums[block], sum_before(mine, total));
    for (uint n = 0u; n < kEach; ++n) {
        if (first + n < size) table[first + n] = sum;
        sum = add_up(sum, numbers[n]);
    }
}
