// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared.h"
// Step 2, T's billboards: their corners, and T's light at each of them.
#include "billboard.glsl"
#include "frame.glsl"
#include "ray.glsl"
#include "air.glsl"
#include "scattering.glsl"
#include "shells.glsl"

layout(set = 0, binding = 1, std430) readonly buffer Puffs {
    Puff puffs[];
};
layout(set = 0, binding = 2, std430) readonly buffer Clouds {
    PuffCloud clouds[];
};

layout(location = 0) out vec2 coordinate;
layout(location = 1) out vec3 lit;  // radiance of the cloud, times what the air lets through and opacity
layout(location = 2) flat out vec4 veil;          // radiance of the air, times opacity; opacity
layout(location = 3) flat out vec3 layer_level_distance;

// T: clamp(dot(towards the light, outwards from the cloud) * colour - absorbed, 0, 1).
vec3 diffuse(vec3 to_light, vec3 outwards, vec3 colour, float absorbed) {
    return clamp(dot(to_light, outwards) * colour - absorbed, 0.0, 1.0);
}

vec3 light_at(vec3 position, Puff puff, PuffCloud cloud) {
    vec3 offset = position - vec3(cloud.x, cloud.y, cloud.z);
    vec3 outwards = offset / max(length(offset), 1.0e-6);
    vec2 absorbed = unpackUnorm2x16(puff.absorbed);
    float height = clamp((position.z - cloud.base) * cloud.inverse_height, 0.0, 1.0);
    vec3 light = diffuse(frame.to_sun.xyz, outwards, sunlight_at(position.z), absorbed.x) +
                 mix(frame.ambient_base.rgb, frame.ambient_top.rgb, height);
    vec3 way = frame.flash.xyz - position;  // adds nothing in the dark; no branch, see lighting.glsl
    float squared = dot(way, way);
    vec3 to_flash = way * inversesqrt(max(squared, 1.0e-6));
    light += frame.flash.w * flash_falloff(squared) * diffuse(to_flash, outwards, frame.flash_colour.rgb, absorbed.y);
    return frame.ambient_top.w * light;
}

// Texture coordinates of a corner: mirrored, and the axes exchanged, as the bits of `turn` say.
vec2 turned(vec2 corner, uint turn) {
    vec2 point = vec2((turn & 1u) != 0u ? -corner.x : corner.x, (turn & 2u) != 0u ? corner.y : -corner.y);
    return 0.5 + 0.5 * ((turn & 4u) != 0u ? point.yx : point);
}

void main() {
    Puff puff = puffs[gl_VertexIndex / 6];
    vec2 corner = square_corner(uint(gl_VertexIndex));
    vec3 centre = vec3(puff.x, puff.y, puff.z);
    float distance = length(centre);
    // Parallel to the picture's plane: all corners have the depth of the centre.
    vec2 reach = corner * unpackHalf2x16(puff.half_size);
    vec2 per_metre = inversesqrt(vec2(dot(frame.right.xyz, frame.right.xyz), dot(frame.up.xyz, frame.up.xyz)));
    vec3 right = per_metre.x * frame.right.xyz, up = per_metre.y * frame.up.xyz;
    float depth = dot(frame.forward.xyz, centre);
    vec2 picture = per_metre * (vec2(dot(right, centre), dot(up, centre)) + reach) * vec2(1.0, -1.0);
    gl_Position = vec4(picture * frame.tile.xy + depth * frame.tile.zw, 0.5 * depth, depth);

    vec3 position = centre + reach.x * right + reach.y * up;
    vec3 ray = centre / max(distance, 1.0e-6);
    vec3 beta = air_transmittance(ray, distance);
    AirLayer air = layer_in_front(centre, distance);
    coordinate = turned(corner, puff.texture_bits >> 8 & 15u);
    lit = puff.opacity * air.transmittance * beta * light_at(position, puff, clouds[puff.cloud]);
    veil = puff.opacity * vec4(air.transmittance * air_light(ray, beta) + air.light, 1.0);
    layer_level_distance = vec3(uvec2(puff.texture_bits & 255u, puff.texture_bits >> 12), distance);
}
