// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Order from the eye, second: what is seen moves together; the table tells where to.
#include "render/vulkan/order.glsl"

layout(local_size_x = kSortGroup) in;

void main() {
    uint i = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (i >= step.count + step.billboards) return;
    uint key = keys_from[i];
    if (key == kCulled) return;
    keys_to[table[i]] = key;
    values_to[table[i]] = i;
}
