// SPDX-License-Identifier: Apache-2.0
// Bindings of the passes that make the order from the sun and the lists of the shadow map's tiles (device_sun.h), where
// they have others than order.glsl, which must be included before.

layout(set = 0, binding = 0) uniform SunFrameBlock {
    SunFrame sun;
};
layout(set = 0, binding = 3, std430) buffer Sources {
    uint sources[];  // of the splats: metaballs
};
layout(set = 0, binding = 4, std430) buffer Splats {
    LightSplat splats[];  // nearest to the sun first
};
layout(set = 0, binding = 11, std430) buffer Queries {
    LightQuery queries[];  // centres, tile by tile, in each nearest to the sun first
};
layout(set = 0, binding = 12, std430) buffer Places {
    LightPlace places[];
};
layout(set = 0, binding = 13, std430) writeonly buffer Items {
    LightItem items[];
};

// Returns the offset of a metaball from the corner of the shadow map.
vec3 offset_from_corner(CloudBall ball) {
    return vec3(offset_from(ball.x, sun.corner_high.x, sun.corner_low.x).high,
                offset_from(ball.y, sun.corner_high.y, sun.corner_low.y).high,
                offset_from(ball.z, sun.corner_high.z, sun.corner_low.z).high);
}
