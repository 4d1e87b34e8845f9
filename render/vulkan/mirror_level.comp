// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/ground.h"
// A level of the mirrored view: the mean of up to four texels of the one before; at odd sizes the last row and column count
// twice. The same as mirror_view.cpp.

layout(local_size_x = kComputeGroup) in;
layout(set = 0, binding = 0, std430) buffer Mirror {
    vec4 texels[];
};
layout(push_constant) uniform Step {
    MirrorStep step;
};

vec4 texel(uvec2 at) {
    uvec2 inside = min(at, uvec2(step.fine.width, step.fine.height) - 1u);
    return texels[step.fine.first + inside.y * step.fine.width + inside.x];
}

void main() {
    uint index = gl_GlobalInvocationID.y * (kGroupRow * kComputeGroup) + gl_GlobalInvocationID.x;
    if (index >= step.coarse.width * step.coarse.height) return;
    uvec2 at = 2u * uvec2(index % step.coarse.width, index / step.coarse.width);
    texels[step.coarse.first + index] =
        0.25 * (texel(at) + texel(at + uvec2(1u, 0u)) + texel(at + uvec2(0u, 1u)) + texel(at + uvec2(1u, 1u)));
}
