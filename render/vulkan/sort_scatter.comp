// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// A pass of the radix sort, last: each element goes to its place; the table has the first place of each digit and block.
// The places of a digit are given out in the order of the elements, so that the sort is stable: of kSortGroup elements at
// a time, masks tell which of them have the digit, and the bits below an element's own are those before it.
#include "render/vulkan/order.glsl"

layout(local_size_x = kSortGroup) in;
const uint kWords = kSortGroup / 32u;
shared uint masks[kWords * kSortGroup];  // words before digits
shared uint next_place[kSortGroup];

uint take_mask(uint digit) {
    uint found = 0u;
    for (uint word = 0u; word < kWords; ++word) {
        found += bitCount(masks[word * kSortGroup + digit]);
        masks[word * kSortGroup + digit] = 0u;
    }
    return found;
}

void main() {
    uint elements = sorted_elements(), blocks = groups_of(elements, kSortBlock);
    uint block = work_group(), lane = gl_LocalInvocationID.x;
    if (block >= blocks) return;
    next_place[lane] = table[lane * blocks + block];
    for (uint word = 0u; word < kWords; ++word) masks[word * kSortGroup + lane] = 0u;
    barrier();
    uint own_word = lane / 32u, own_bit = 1u << (lane % 32u);
    for (uint at = block * kSortBlock + lane, n = 0u; n < kSortBlock; at += kSortGroup, n += kSortGroup) {
        uint key = 0u, digit = 0u;
        if (at < elements) {
            key = keys_from[at];
            digit = key >> step.shift & (kSortGroup - 1u);
            atomicOr(masks[own_word * kSortGroup + digit], own_bit);
        }
        barrier();
        if (at < elements) {
            uint place = next_place[digit] + bitCount(masks[own_word * kSortGroup + digit] & (own_bit - 1u));
            for (uint word = 0u; word < own_word; ++word) place += bitCount(masks[word * kSortGroup + digit]);
            keys_to[place] = key;
            values_to[place] = values_from[at];
        }
        barrier();
        next_place[lane] += take_mask(lane);
        barrier();
    }
}
