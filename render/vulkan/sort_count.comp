// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// A pass of the radix sort, first: how often each digit is in each block; digits before blocks.
#include "render/vulkan/order.glsl"

layout(local_size_x = kSortGroup) in;
shared uint digits[kSortGroup];

void main() {
    uint elements = sorted_elements(), blocks = groups_of(elements, kSortBlock);
    uint block = work_group(), lane = gl_LocalInvocationID.x;
    if (block >= blocks) return;
    digits[lane] = 0u;
    barrier();
    for (uint at = block * kSortBlock + lane, n = 0u; n < kSortBlock; at += kSortGroup, n += kSortGroup) {
        if (at < elements) atomicAdd(digits[keys_from[at] >> step.shift & (kSortGroup - 1u)], 1u);
    }
    barrier();
    table[lane * blocks + block] = digits[lane];
}
