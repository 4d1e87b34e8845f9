// SPDX-License-Identifier: Apache-2.0
// Film, puddles with ripples, and snow: wet_ground.cpp and ripples-inl.h in shaders; needs ground_mirror.glsl.

layout(set = 0, binding = 28, std430) readonly buffer Ripples {
    vec2 ripple_slopes[];  // of a square
};

// Samples the square's slopes bilinearly, with an offset by a hash.
vec2 slopes_in_square(vec2 at, uint hash) {
    vec2 low = floor(at), part = at - low;
    uvec2 a = uvec2(ivec2(low) + ivec2(hash & 0xffu, hash >> 8 & 0xffu)), b = a + 1u;
    a &= kRippleSide - 1u;
    b &= kRippleSide - 1u;
    return mix(mix(ripple_slopes[a.y * kRippleSide + a.x], ripple_slopes[a.y * kRippleSide + b.x], part.x),
               mix(ripple_slopes[b.y * kRippleSide + a.x], ripple_slopes[b.y * kRippleSide + b.x], part.x), part.y);
}

// Returns the slopes of water at a point by the size of a pixel and the rain there; z: the variance of those that are too
// small to be seen.
vec3 ripples_at(vec2 point, float pixel_m, float rain) {
    float height = ground_data.ripple_strength * sqrt(min(rain * ground_data.ripple_per_mm, 1.0));
    float seen = 1.0 - smoothstep(0.016, 0.07, pixel_m);
    float unseen = height * height * ground_data.ripple_variance * (1.0 - seen * seen);
    if (!(seen * height > 0.0)) return vec3(0.0, 0.0, unseen);
    const float kPerMetre = 1.0 / kRippleApart_m, kTexels = float(kRippleSide) / kRippleSquare_m;
    vec2 p = clamp(point, -1.0e4, 1.0e4);  // farther points are not seen
    vec2 at = vec2((p.x - 0.57735027 * p.y) * kPerMetre + ground_data.ripple_from_x,
                   p.y * (1.15470054 * kPerMetre) + ground_data.ripple_from_y);
    vec2 low = floor(at), f = at - low;
    bool upper = f.x + f.y > 1.0;  // of the two triangles of a rhombus
    vec3 weights = upper ? vec3(f.x + f.y - 1.0, 1.0 - f.y, 1.0 - f.x) : vec3(1.0 - (f.x + f.y), f.x, f.y);
    vec2 texel = p * kTexels + vec2(ground_data.ripple_texel_x, ground_data.ripple_texel_y);
    uint column = cell_of(low.x, ground_data.ripple_corner_x), row = cell_of(low.y, ground_data.ripple_corner_y);
    uint both = upper ? 1u : 0u;
    vec2 sum = vec2(0.0);
    float squares = 0.0;
    for (uint n = 0u; n < 3u; ++n) {
        uint cx = n == 0u ? both : n == 1u ? 1u : 0u, cy = n == 0u ? both : n == 2u ? 1u : 0u;
        float w = weights[n] * weights[n];
        sum += w * slopes_in_square(texel, mixed(mixed(column + cx) + row + cy));
        squares += w * w;
    }
    return vec3(height * seen * inversesqrt(squares) * sum, unseen);
}

// Returns the fraction of the ground that lies below a film where noise is the height of the hollows and tufts.
float covered(float film_mm, float half_mm, vec2 noise) {
    if (!(film_mm > 0.0)) return 0.0;
    float level = log(max(film_mm, 1.0e-6) / half_mm) / kFilmDeviations;
    float x = max((level - noise.x) / sqrt(noise.y + 0.1 * 0.1), -50.0);
    return 1.0 / (1.0 + exp(-1.702 * x));
}

vec3 soaked_albedo(vec3 dry) { return (1.0 - ground_data.dry.w) * dry / (1.0 - ground_data.dry.w * dry); }

// Returns the surface of wet soil and puddles; `lying`: of lying_at().
Surface wet_surface(Seen seen, vec3 lying) {
    vec2 hollows = resolved_noise(ground_data.hollows, seen.point.xy, seen.pixel_m);
    float puddle = covered(lying.x, ground_data.film.y, hollows);
    // Hollows stay damp longer than what stands out.
    float soaked = 1.0 - exp(-lying.x * exp(-0.7 * hollows.x) * ground_data.film.x);
    vec3 slopes = ripples_at(seen.point.xy, seen.pixel_m, lying.z);
    float cosine = -seen.ray.z, tilted = max(cosine + dot(slopes.xy, seen.ray.xy), 0.01);
    float of_water = water_reflectance(min(tilted, 1.0), slopes.z);
    float of_soil = ground_data.film.w * soaked * water_reflectance(cosine, 0.09);
    float beside = 1.0 - puddle;
    Surface surface;
    vec3 soaked_soil = kCountry ? soaked_albedo(seen.dry) : ground_data.soaked.rgb;
    surface.albedo = beside * (1.0 - soaked) * seen.dry +
                     (beside * (soaked - of_soil) + puddle * (1.0 - of_water)) * soaked_soil;
    surface.reflected = vec3(0.0);
    if (!kMirror) return surface;
    for (uint n = 0u; n < 2u; ++n) {  // water; soil
        float fraction = ground_data.reflection * (n == 0u ? puddle * of_water : beside * of_soil);
        vec3 way = mirrored_ray(seen.ray, n == 0u ? slopes.xy : vec2(0.0));
        surface.reflected += fraction * reflected(seen, way, n == 0u ? 2.0 * sqrt(slopes.z) : 0.6);
    }
    return surface;
}

// Lays snow over a surface; its grain shows as a little light and shade.
void lay_snow(Seen seen, float snow_mm, inout Surface surface) {
    if (!(snow_mm > 0.0)) return;
    vec2 tufts = resolved_noise(ground_data.tufts, seen.point.xy, seen.pixel_m);
    float white = covered(snow_mm, ground_data.film.z, tufts);
    vec3 snow = min(ground_data.snow.rgb * clamp(1.0 - 0.02 * tufts.x, 0.9, 1.05), 1.0);
    surface.albedo = mix(surface.albedo, snow, white);
    surface.reflected *= 1.0 - white;
}
