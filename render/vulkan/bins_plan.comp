// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Lists of the tiles, second: whether they fit, how many work groups the passes to come need, and which splats of the
// batch and which shells of air are drawn one after the other (air_shells.h). Shells are drawn by the batch that has the
// last splat in front of them.
#include "render/vulkan/order.glsl"

layout(local_size_x = kSortGroup) in;
shared uint in_front[kMaxShells + 1u];  // of each shell, and the last of fog: splats, nearest first

float shell_end(uint k) { return shells.ends[k / 4u][k % 4u]; }

uint nearer_than(float distance) {
    uint begin = 0u, end = counts.visible;
    while (begin < end) {
        uint middle = (begin + end) / 2u;
        if (keys_from[middle] < floatBitsToUint(distance)) {
            begin = middle + 1u;
        } else {
            end = middle;
        }
    }
    return begin;
}

void plan_lists() {
    uint entries = counts.total <= step.capacity ? counts.total : 0u, blocks = groups_of(entries, kSortBlock);
    counts.required = max(step.begin == 0u ? 0u : counts.required, counts.total);
    counts.entries = entries;
    counts.entries_each = dispatch_of(groups_of(entries, kSortGroup));
    counts.entries_blocks = dispatch_of(blocks);
    counts.entries_digits = dispatch_of(groups_of(blocks * kSortGroup, kSortBlock));
}

void main() {
    uint k = gl_LocalInvocationID.x;
    if (k == 0u) plan_lists();
    if (k < step.shells) in_front[k] = nearer_than(shell_end(k));
    barrier();
    if (k > step.shells) return;
    bool first_batch = step.begin == 0u;
    uint before = k == 0u ? 0u : in_front[k - 1u], behind = k == step.shells ? counts.visible : in_front[k];
    uint first = max(before, step.begin), end = max(first, min(behind, step.end));
    uint tiles = first < end || (k == 0u && first_batch) ? step.tiles : 0u;  // the first clears the sums
    bool mixed = counts.not_fitted != 0u;
    uint end_shell = k;
    bool shell_follows = behind == 0u ? first_batch : behind > step.begin && behind <= step.end;
    if (k < step.shells && (k == 0u || before < behind) && shell_follows) {
        while (end_shell < step.shells && in_front[end_shell] == behind) ++end_shell;
    }
    uint pixels = end_shell > k ? step.width * step.height : 0u;
    parts[k].fitted = dispatch_of(mixed ? 0u : tiles);
    parts[k].mixed = dispatch_of(mixed ? tiles : 0u);
    parts[k].air = dispatch_of(groups_of(pixels, kComputeGroup));
    parts[k].first = first;
    parts[k].end = end;
    parts[k].first_shell = k;
    parts[k].end_shell = end_shell;
}
