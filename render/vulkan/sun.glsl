// SPDX-License-Identifier: Apache-2.0
// Further bindings of the passes that make the order from the sun and the items of work (device_sun.h); order.glsl must
// be included before.

layout(set = 0, binding = 16) uniform SunFrameBlock {
    SunFrame sun;
};
layout(set = 0, binding = 17, std430) buffer Sources {
    uint sources[];  // of the splats: metaballs
};
layout(set = 0, binding = 18, std430) buffer Splats {
    LightSplat splats[];  // nearest to the sun first
};
layout(set = 0, binding = 19, std430) buffer Queries {
    LightQuery queries[];  // centres, tile by tile, in each nearest to the sun first
};
layout(set = 0, binding = 20, std430) buffer Places {
    LightPlace places[];
};
layout(set = 0, binding = 21, std430) writeonly buffer Items {
    LightItem items[];
};

// Returns the offset of a metaball from the corner of the shadow map.
vec3 offset_from_corner(CloudBall ball) {
    return vec3(offset_from(ball.x, sun.corner_high.x, sun.corner_low.x).high,
                offset_from(ball.y, sun.corner_high.y, sun.corner_low.y).high,
                offset_from(ball.z, sun.corner_high.z, sun.corner_low.z).high);
}
