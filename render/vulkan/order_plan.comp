// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Order from the eye, third: how many work groups the passes to come need.
#include "render/vulkan/order.glsl"

layout(local_size_x = 1) in;

void main() {
    uint visible = counts.total, blocks = groups_of(visible, kSortBlock);
    counts.visible = visible;
    counts.not_fitted = step.billboards > 0u ? 1u : 0u;
    counts.visible_each = dispatch_of(groups_of(visible, kSortGroup));
    counts.visible_blocks = dispatch_of(blocks);
    counts.visible_digits = dispatch_of(groups_of(blocks * kSortGroup, kSortBlock));
    counts.splats = dispatch_of(groups_of(visible, kComputeGroup));
}
