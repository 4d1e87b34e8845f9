// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// The first plane of the shade map (air_shells.h): means of the shadow map over squares of its texels, 0..255, with a
// border of full light; in each word those of four neighbours.

layout(local_size_x = kComputeGroup) in;
layout(set = 0, binding = 4) uniform sampler2D shadow_map;
layout(set = 0, binding = 14, std430) writeonly buffer Shade {
    uint shade[];
};
layout(push_constant) uniform Step {
    ShadeStep step;
};

uint light_at(uint index) {
    uvec2 place = uvec2(index % step.columns, index / step.columns);
    if (min(place.x, place.y) == 0u || max(place.x, place.y) >= step.columns - 1u) return 255u;
    uvec2 first = (place - 1u) * step.texels, end = min(first + step.texels, uvec2(step.shadow_size));
    float sum = 0.0;
    for (uint y = first.y; y < end.y; ++y)
        for (uint x = first.x; x < end.x; ++x) sum += texelFetch(shadow_map, ivec2(x, y), 0).r;
    return uint(clamp(sum / float((end.x - first.x) * (end.y - first.y)), 0.0, 1.0) * 255.0 + 0.5);
}

void main() {
    uint index = gl_GlobalInvocationID.y * (kGroupRow * kComputeGroup) + gl_GlobalInvocationID.x;
    uint last = step.columns * step.columns - 1u;
    if (index > last) return;
    shade[index] = light_at(index) | light_at(min(index + 1u, last)) << 8 |
                   light_at(min(index + step.columns, last)) << 16 |
                   light_at(min(index + step.columns + 1u, last)) << 24;
}
