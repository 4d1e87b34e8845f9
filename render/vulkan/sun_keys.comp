// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Order from the sun, first: distances along the light as keys.
#include "render/vulkan/order.glsl"
#include "render/vulkan/exact_distance.glsl"
#include "render/vulkan/sun.glsl"

layout(local_size_x = kSortGroup) in;

void main() {
    uint i = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (i == 0u) counts.total = step.count;
    if (i >= step.count) return;
    keys_to[i] = floatBitsToUint(max(0.0, dot(sun.direction.xyz, offset_from_corner(cloud[i]))));
    values_to[i] = i;
}
