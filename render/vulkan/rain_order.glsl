// SPDX-License-Identifier: Apache-2.0
// Choosing among the invocations of a work group of kRainGroup, in their order.

shared uint chosen_words[2];

// Returns a bit for each invocation with `mine`; called by all of them.
uvec2 choose(bool mine) {
    uint lane = gl_LocalInvocationID.x;
    barrier();
    if (lane < 2u) chosen_words[lane] = 0u;
    barrier();
    if (mine) atomicOr(chosen_words[lane >> 5], 1u << (lane & 31u));
    barrier();
    return uvec2(chosen_words[0], chosen_words[1]);
}

// Returns how many of the chosen come before this invocation.
uint place_among(uvec2 chosen) {
    uint lane = gl_LocalInvocationID.x, before = (1u << (lane & 31u)) - 1u;
    return lane < 32u ? bitCount(chosen.x & before) : bitCount(chosen.x) + bitCount(chosen.y & before);
}
