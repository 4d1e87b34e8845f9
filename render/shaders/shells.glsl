// SPDX-License-Identifier: Apache-2.0
// The shells of air around the eye (air_shells.h, docs/air.md); needs ray.glsl and air.glsl.

// Whether there are shells. Without them shaders are compiled as if they did not know any.
layout(constant_id = 6) const bool kShells = false;

layout(set = 0, binding = 13) uniform ShellsBlock {
    Shells shells;
};
layout(set = 0, binding = 14, std430) readonly buffer Shade {
    uint shade[];
};

// What a part of the air does to the light behind it: light = light * transmittance + light of the layer.
struct AirLayer {
    vec3 light;
    float transmittance;
};

float shell_end(uint k) { return shells.ends[k / 4u][k % 4u]; }
float shell_begin(uint k) { return k == 0u ? 0.0 : shell_end(k - 1u); }

// Share of the sunlight that the clouds leave at a point relative to the eye: D's gamma. The shade of a cloud begins at
// its top and is complete at its base.
float sunlight_left(vec3 point) {
    vec2 place = vec2(dot(shells.shade_u.xyz, point) + shells.shade_u.w, dot(shells.shade_v.xyz, point) + shells.shade_v.w);
    place = clamp(place, vec2(0.0), shells.shade.xy);
    uvec2 texel = uvec2(place);
    vec2 share = place - vec2(texel);
    uint columns = uint(shells.settings.z), index = texel.y * columns + texel.x;
    vec2 upper = unpackUnorm2x16(shade[index]), lower = unpackUnorm2x16(shade[index + columns]);
    vec2 left_right = mix(upper, lower, share.y);
    index += uint(shells.settings.w);
    vec4 ranges = mix(unpackUnorm4x8(shade[index]), unpackUnorm4x8(shade[index + columns]), share.y);
    vec2 range = mix(ranges.xy, ranges.zw, share.x);
    float along = dot(shells.shade_along.xyz, point) + shells.shade_along.w;
    float part = clamp((along - range.x) / max(range.y - range.x, 1.0 / 255.0), 0.0, 1.0);
    return 1.0 - part * (1.0 - mix(left_right.x, left_right.y, share.x));
}

// The air of a ray between two distances, of which the sunlight is looked up at a third. All the light of the air is in
// the picture already (air_light()); what clouds shade is taken away: radiance below zero.
AirLayer air_layer(SunlitAir sunlit, vec3 ray, float begin, float end, float at) {
    vec3 light = sunlit_at(sunlit, ray, at) * (air_transmittance(ray, begin) - air_transmittance(ray, end));
    return AirLayer(shells.settings.y * (sunlight_left(at * ray) - 1.0) * light, 1.0);
}

// Where a ray comes out of the ground that the eye is below, as that of a mirror image is.
float air_begin(vec3 ray) { return frame.ground.w > 0.0 ? frame.ground.w / max(ray.z, 1.0e-6) : 0.0; }

// Shell k along the ray of a pixel of the picture, cut off by the ground.
AirLayer air_shell(uint k, SunlitAir sunlit, vec3 ray, uvec2 pixel) {
    float first = air_begin(ray), last = ground_distance(ray);
    float begin = clamp(shell_begin(k), first, last), end = clamp(shell_end(k), first, last);
    return air_layer(sunlit, ray, begin, end, mix(begin, end, shell_offset(pixel.x, pixel.y)));
}

// The part of a splat's own shell that lies in front of its centre.
AirLayer layer_in_front(vec3 centre, float distance) {
    if (!kShells) return AirLayer(vec3(0.0), 1.0);
    uint count = uint(shells.settings.x), k = 0u;
    for (uint step = kMaxShells; step > 0u; step /= 2u) {
        if (k + step <= count && shell_end(k + step - 1u) <= distance) k += step;
    }
    if (k == count) return AirLayer(vec3(0.0), 1.0);  // beyond the last
    vec3 ray = centre / max(distance, 1.0e-6);
    float begin = min(max(shell_begin(k), air_begin(ray)), distance);
    return air_layer(sunlit_air(ray), ray, begin, distance, 0.5 * (begin + distance));
}
