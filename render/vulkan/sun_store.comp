// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Light at the centres, last: it goes to the metaballs, and to the table for the host.
#include "render/vulkan/order.glsl"
#include "render/vulkan/exact_distance.glsl"
#include "render/vulkan/sun.glsl"

layout(local_size_x = kSortGroup) in;

void main() {
    uint j = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (j >= counts.visible) return;
    uint i = sources[values_from[j]];
    cloud[i].sun_depth = queries[j].depth;
    table[i] = floatBitsToUint(queries[j].depth);
}
