// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "order.h"
// Light at the centres, last: it goes to the metaballs, and to the table for the host.
#include "order.glsl"
#include "exact_distance.glsl"
#include "sun.glsl"

layout(local_size_x = kSortGroup) in;

void main() {
    uint j = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (j >= counts.visible) return;
    uint i = sources[values_from[j]];
    cloud[i].sun_depth = queries[j].depth;
    table[i] = floatBitsToUint(queries[j].depth);
}
