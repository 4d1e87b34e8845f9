// SPDX-License-Identifier: Apache-2.0
// The shells of air around the eye (air_shells.h, docs/air.md); needs ray.glsl, air.glsl and
// scattering.glsl.

// Whether there are shells. Without them shaders are compiled as if they did not know any.
layout(constant_id = 6) const bool kShells = false;
layout(constant_id = 7) const bool kFog = false;

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

// Noise of fog at a point relative to the eye, 0..1.
float fog_noise(vec3 point, vec4 eye) {
    vec3 voxel = fract(eye.xyz + eye.w * point) * float(kFogVoxels);
    vec3 below = floor(voxel), share = voxel - below;
    uvec3 at = uvec3(below) & (kFogVoxels - 1u);
    uint row = 2u * uint(shells.settings.w) + at.y * kFogVoxels + at.x;
    uint level = kFogVoxels * kFogVoxels, above = (at.z + 1u) & (kFogVoxels - 1u);
    vec4 four = mix(unpackUnorm4x8(shade[row + at.z * level]), unpackUnorm4x8(shade[row + above * level]), share.z);
    vec2 two = mix(four.xy, four.zw, share.y);
    return mix(two.x, two.y, share.x);
}

// Optical depth of the fog of a ray between two distances, whose noise is looked up at a third. Over more than a patch
// the noise is its mean.
float fog_depth(vec3 ray, float begin, float end, float at) {
    float column = fog_column(shells.fog.z + ray.z * begin, ray.z, end - begin, shells.fog.y);
    float varies = shells.fog.w * min(1.0, 0.125 / max(shells.fog_coarse.w * (end - begin), 1.0e-6));
    vec3 point = at * ray;
    float noise = fog_noise(point, shells.fog_coarse) + fog_noise(point.yzx, shells.fog_fine);
    return shells.fog.x * column * max(1.0 + varies * (noise - 1.0), 0.0);
}

// Where a part of a ray is looked up that begins in a shell: in the last shell, which has no end, where it begins.
float within_shell(float begin, float end, float share) { return begin < shells.shade.w ? mix(begin, end, share) : begin; }

// Radiance at opacity 1 of the fog at a distance, as the eye sees it; lit as the clouds are. `lit`: share of the
// sunlight that the clouds leave.
vec3 fog_radiance(vec3 ray, float at, float lit) {
    float height = shells.fog.z + ray.z * at;
    float above = shells.fog.x * exp(min(-height * shells.fog.y, 60.0)) / shells.fog.y;  // optical depth upwards
    float sun_depth = above / max(frame.to_sun.z, 0.05), cosine = dot(frame.to_sun.xyz, ray);
    float sun = lit * (scattered_often(ray, sun_depth) + exp(-sun_depth) * scattered_once(cosine));
    vec3 arriving = sun * sunlight_at(ray.z * at) + mix(frame.ambient_base.rgb, frame.ambient_top.rgb, exp(-0.5 * above));
    vec3 beta = air_transmittance(ray, at);
    return beta * frame.ambient_top.w * arriving + air_light(ray, beta);
}

// The air of a ray between two distances, of which sunlight and fog are looked up at a third. All the light of clear air
// is in the picture already (air_light()); what clouds shade is taken away: radiance below zero.
AirLayer air_layer(SunlitAir sunlit, vec3 ray, float begin, float end, float at) {
    vec3 light = sunlit_at(sunlit, ray, at) * (air_transmittance(ray, begin) - air_transmittance(ray, end));
    float lit = sunlight_left(at * ray), strength = begin < shells.shade.w ? shells.settings.y : 0.0;
    light *= strength * (lit - 1.0);
    if (!kFog) return AirLayer(light, 1.0);
    float transmittance = exp(-fog_depth(ray, begin, end, at));
    light *= 0.5 + 0.5 * transmittance;  // half of the fog is in front
    // Its light changes with height so fast that looking it up here and there would show as grain.
    vec3 of_fog = fog_radiance(ray, within_shell(begin, end, 0.5), lit);
    return AirLayer(light + (1.0 - transmittance) * of_fog, transmittance);
}

// Where a ray comes out of the ground that the eye is below, as that of a mirror image is.
float air_begin(vec3 ray) { return frame.ground.w > 0.0 ? frame.ground.w / max(ray.z, 1.0e-6) : 0.0; }

// Shell k along the ray of a pixel of the picture, cut off by the ground; `at`: distance where it is looked up.
AirLayer air_shell(uint k, SunlitAir sunlit, vec3 ray, uvec2 pixel, out float at) {
    float first = air_begin(ray), last = ground_distance(ray);
    float begin = clamp(shell_begin(k), first, last), end = clamp(shell_end(k), first, last);
    at = within_shell(begin, end, shell_offset(pixel.x, pixel.y));
    return air_layer(sunlit, ray, begin, end, at);
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
    return air_layer(sunlit_air(ray), ray, begin, distance, within_shell(begin, distance, 0.5));
}
