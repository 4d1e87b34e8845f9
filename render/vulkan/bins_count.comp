// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Lists of the tiles, first: how many entries each splat of the batch has; the others have none.
#include "render/vulkan/order.glsl"

layout(local_size_x = kSortGroup) in;

void main() {
    uint k = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (k >= counts.visible) return;
    uvec2 box = boxes[k];
    uvec2 size = uvec2((box.y & 0xffffu) - (box.x & 0xffffu), (box.y >> 16) - (box.x >> 16));
    table[k] = k >= step.begin && k < step.end ? size.x * size.y : 0u;
}
