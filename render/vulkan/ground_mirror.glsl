// SPDX-License-Identifier: Apache-2.0
// What water reflects, of the mirrored view (render/ground/mirror_view.h): ground_look-inl.h and ground_pass-inl.h in
// shaders; needs ground_noise.glsl.

layout(constant_id = 14) const bool kMirror = false;
layout(set = 0, binding = 27, std430) readonly buffer Mirror {
    vec4 mirror_texels[];  // rgb: radiance; a: transmittance of clouds
};

// A pixel's ray and the ground that it meets.
struct Seen {
    vec3 ray, point;
    float distance, pixel_m;
    vec3 beta, veil;  // transmittance and light of the air up to the ground
    vec3 dry;         // albedo
};

struct Surface {
    vec3 albedo;     // of what scatters below the surface
    vec3 reflected;  // light, behind the air
};

// water_reflectance() of wet_ground.h.
float water_reflectance(float cosine, float slope_variance) {
    float slope = sqrt(slope_variance);
    float grazing = pow(max(1.0 - cosine, 1.0e-6), 5.0 * exp(-2.69 * slope));
    return kWaterFromAbove + (1.0 - kWaterFromAbove) * grazing / (1.0 + 22.7 * slope * sqrt(slope));
}

vec4 mirrored_level(GroundMirrorLevel level, vec2 place) {
    ivec2 size = ivec2(level.width, level.height), last = size - 1;
    vec2 at = place * vec2(size) - 0.5, low = floor(at), part = at - low;
    ivec2 a = clamp(ivec2(low), ivec2(0), last), b = clamp(ivec2(low) + 1, ivec2(0), last);
    uint south = level.first + uint(a.y * size.x), north = level.first + uint(b.y * size.x);
    return mix(mix(mirror_texels[south + uint(a.x)], mirror_texels[south + uint(b.x)], part.x),
               mix(mirror_texels[north + uint(a.x)], mirror_texels[north + uint(b.x)], part.x), part.y);
}

// Samples the mirrored view along a reflected direction (upwards), blurred over a cone of `blur` radians.
vec4 mirrored(vec3 direction, float blur) {
    float depth = max(dot(direction, ground_data.mirror_forward.xyz), 0.02);
    vec2 plane = vec2(dot(direction, ground_data.mirror_right.xyz), dot(direction, ground_data.mirror_up.xyz)) / depth;
    vec2 place = clamp(plane * vec2(ground_data.mirror_right.w, ground_data.mirror_up.w) + 0.5, 0.0, 1.0);
    float last = float(ground_data.mirror_levels - 1u);
    float level = min(log2(max(blur * ground_data.mirror_forward.w, 1.0)), last), fine = floor(level);
    vec4 both[2];
    for (uint n = 0u; n < 2u; ++n)  // in a loop, so that there is one look-up: see light_of_air()
        both[n] = mirrored_level(ground_data.levels[uint(min(fine + float(n), last))], place);
    return mix(both[0], both[1], level - fine);
}

// Returns the light that a surface of this roughness reflects to the eye. Light of the sky is attenuated by the air in
// front of the ground; light of clouds in the mirrored view has passed that air, whose own light is subtracted.
vec3 reflected(Seen seen, vec3 direction, float blur) {
    vec4 view = mirrored(direction, blur);
    return view.rgb * seen.beta * view.a + max(view.rgb - seen.veil, 0.0) * (1.0 - view.a);
}

// Returns the mirrored direction of a ray that meets water with these slopes; never below the horizon.
vec3 mirrored_ray(vec3 ray, vec2 slopes) {
    vec3 normal = normalize(vec3(-slopes, 1.0));
    vec3 way = ray - 2.0 * dot(ray, normal) * normal;
    way.z = max(way.z, min(-ray.z, 1.0e-3));
    return way.z > 0.0 ? way : vec3(ray.xy, abs(ray.z));
}
