// SPDX-License-Identifier: Apache-2.0
// The picture that rain is drawn over; needs rain.glsl.

layout(set = 0, binding = 6, std430) buffer Pixels {
    vec4 pixels[];  // rgb; a: transmittance of the clouds
};
layout(set = 0, binding = 7, std430) readonly buffer Depths {
    float depths[];
};

// The pixel of an invocation in a tile.
uvec2 tile_pixel(uint tile, uint lane) {
    uvec2 corner = uvec2(tile % rain_step.tiles_x, tile / rain_step.tiles_x) * kRainTile;
    return corner + uvec2(lane % kRainTile, lane / kRainTile);
}

// Distance of the cloud; infinite where there is hardly one (Picture::depth_m).
float cloud_distance(uint at, float transmittance) {
    if (rain.forward.w == 0.0) return depths[at];
    float opacity = 1.0 - transmittance;
    return opacity >= 1.0 / 1024.0 ? depths[at] / opacity : uintBitsToFloat(0x7f800000u);
}

vec3 rain_ray(vec2 point) {
    vec2 plane = vec2(2.0, -2.0) * point / vec2(rain.right.w, rain.up.w) + vec2(-1.0, 1.0);
    return normalize(rain.forward.xyz + plane.x * rain.right.xyz + plane.y * rain.up.xyz);
}
