// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Light at the centres, second: the centres in the order of their tiles.
#include "render/vulkan/order.glsl"
#include "render/vulkan/exact_distance.glsl"
#include "render/vulkan/sun.glsl"

layout(local_size_x = kSortGroup) in;

void main() {
    uint j = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (j >= counts.visible) return;
    uint k = values_from[j];
    queries[j] = LightQuery(splats[k].x, splats[k].y, places[k].z, 0.0);
}
