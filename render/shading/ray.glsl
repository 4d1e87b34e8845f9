// SPDX-License-Identifier: Apache-2.0
// The ray through a pixel; needs frame.glsl.

// Returns the direction of the ray through a point of the tile, in pixels; its component along the view axis is 1.
vec3 pixel_direction(vec2 point) {
    vec2 pixel = point + frame.picture.zw;
    vec2 plane = vec2(2.0, -2.0) * pixel / frame.picture.xy + vec2(-1.0, 1.0);
    return frame.forward.xyz + plane.x * frame.right.xyz + plane.y * frame.up.xyz;
}

vec3 pixel_ray(vec2 point) { return normalize(pixel_direction(point)); }

// Returns the transmittance below which nothing is seen behind what is before it, as opaque_beside_sun() (frame_data.h).
// Without a branch: lavapipe would recompile shaders whose loops depend on it for each frame.
float opaque_along(vec3 ray) {
    vec3 apart = ray - frame.to_sun.xyz;
    float beyond = (sqrt(dot(apart, apart)) - kSunRadius) * frame.up.w;  // the sun's rim, pixels
    return mix(kOpaque, kSunOpaque, clamp((1.0 - beyond) * 1.0e6, 0.0, 1.0) * frame.sun_disc.w);
}

layout(constant_id = 9) const bool kTerrain = false;  // ground that is not level (render/terrain/terrain_view.h)
layout(set = 0, binding = 23, std430) readonly buffer Terrain {
    float terrain[];  // its distance in each pixel of the picture
};
float terrain_end = 1.0e30;  // in the pixel of this invocation

// Returns it for a pixel of the tile; those beyond the picture have that of its side.
float terrain_at(vec2 point) {
    if (!kTerrain) return 1.0e30;
    uvec2 size = uvec2(frame.picture.xy), pixel = min(uvec2(point + frame.picture.zw), size - 1u);
    return terrain[pixel.y * size.x + pixel.x];
}

// Returns the distance at which a ray meets level ground, a sphere under the physical sky, else a plane; a very large
// number when it does not. Without a branch: lavapipe would recompile the shader for each height of the eye.
float level_distance(vec3 ray) {
    float below = frame.earth.x - ray.z;
    float slope = sqrt(max(below * (-frame.earth.x - ray.z), 0.0)) - ray.z;
    float way = min(frame.earth.y / max(slope, 1.0e-9), 1.0e30);
    float meets = clamp(below * 1.0e30, 0.0, 1.0) * frame.ground_sun.w;
    return max(way, (1.0 - meets) * 1.0e30);
}

// Returns the distance at which the ray of this invocation's pixel ends.
float ground_distance(vec3 ray) {
    float level = level_distance(ray);
    return kTerrain && terrain_end < 1.0e30 ? terrain_end : level;
}
