// SPDX-License-Identifier: Apache-2.0
// Sums over the invocations of a work group of kSortGroup. Sums end at 2^32 - 1: which of two such comes first still
// does not matter.

shared uint lane_sums[kSortGroup];

uint add_up(uint a, uint b) { return a + min(b, 0xffffffffu - a); }

// Sum of what the invocations before this one give, and of all; called by all of them.
uint sum_before(uint mine, out uint total) {
    uint lane = gl_LocalInvocationID.x;
    lane_sums[lane] = mine;
    barrier();
    for (uint reach = 1u; reach < kSortGroup; reach *= 2u) {
        uint other = lane >= reach ? lane_sums[lane - reach] : 0u;
        barrier();
        lane_sums[lane] = add_up(lane_sums[lane], other);
        barrier();
    }
    total = lane_sums[kSortGroup - 1u];
    uint before = lane > 0u ? lane_sums[lane - 1u] : 0u;
    barrier();
    return before;
}
