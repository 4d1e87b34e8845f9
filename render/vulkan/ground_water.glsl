// SPDX-License-Identifier: Apache-2.0
// A sea: render/ground/water-inl.h in shaders; needs ground_wet.glsl, ground_country.glsl and frame.glsl.

layout(set = 0, binding = 29, std430) readonly buffer Waves {
    GroundWave waves[];
};

// Returns the slopes of the waves that a pixel resolves; z: the variance of the others on one axis.
vec3 waves_at(vec2 point, Footprint print, float strength) {
    const float kTurn = 6.2831853;
    vec3 sum = vec3(0.0, 0.0, ground_data.slope_variance);
    float across = length(print.across);
    for (uint n = 0u; n < ground_data.waves; ++n) {
        GroundWave wave = waves[n];
        if (!(wave.wavelength_m > 1.5 * across)) break;  // the next ones are shorter still
        vec2 k = vec2(wave.x, wave.y), per = wave.wavelength_m / kTurn * k;
        float wide = max(abs(dot(per, print.along)) + abs(dot(per, print.across)), 1.0e-4);
        float seen = smoothstep(1.5, 3.5, wave.wavelength_m / wide);
        float phase = dot(k, point) + wave.phase;
        float cosine = cos(phase - roundEven(phase * (1.0 / kTurn)) * kTurn);  // in the first turn, where it is exact
        sum += vec3(seen * vec2(wave.slope_x, wave.slope_y) * cosine, -seen * seen * wave.variance);
    }
    return vec3(strength * sum.xy, strength * strength * max(sum.z, 0.0));
}

// SeenSlopes of water-inl.h: area, mean and standard deviation.
vec3 seen_slopes(float elevation, float towards, float sigma) {
    float u = max((elevation + towards) / sigma, -3.0), root = sqrt(u * u + 0.63661977);
    return vec3(0.5 * sigma * (u + root), towards + sigma / root, sigma * sqrt((u * u + 0.43) / (u * u + 1.0)));
}

// Returns the radiance of the sun in water, per irradiance on a surface that faces it.
float glint_of(vec3 to_eye, vec2 slopes, float variance, float seen_area) {
    vec3 both = to_eye + frame.to_sun.xyz, half_way = both * inversesqrt(max(dot(both, both), 1.0e-6));
    float up = max(half_way.z, 0.05);
    vec2 apart = -half_way.xy / up - slopes;
    float density = exp(max(-dot(apart, apart) / (2.0 * variance), -80.0)) / (6.2831853 * variance);
    float reflectance = water_reflectance(min(dot(half_way, to_eye), 1.0), 0.0);
    return reflectance * density / (4.0 * up * up * up * up * seen_area);
}

// Returns the surface of the water that a pixel sees, with this share of the sun's light and this rain, mm/h.
Surface water_surface(Seen seen, float sun, float rain) {
    Footprint print = footprint_of(seen.ray, seen.distance, frame.up.w);
    // Gusts roughen the water in patches.
    float gusts = resolved_noise(ground_data.gusts, seen.point.xy, print.longest).x;
    vec3 slopes = waves_at(seen.point.xy, print, max(1.0 + 0.2 * gusts, 0.3));
    slopes += vec3(1.0, 1.0, 0.5) * ripples_at(seen.point.xy, seen.pixel_m, rain);  // the rings of drops
    // The eye from the water, whose plane bends away with the Earth.
    float level = sqrt(max(dot(seen.ray.xy, seen.ray.xy), 1.0e-8));
    vec2 eye = -seen.ray.xy / level;
    float bend = kPhysicalSky ? 2.0 * frame.earth.z * seen.distance * level : 0.0;
    float elevation = max(-seen.ray.z / level - bend, 1.0e-4), towards = -dot(slopes.xy, eye);
    const float kSunHalf = 0.0023;  // the sun is no point: half of its radius, as slopes
    float variance = slopes.z + kSunHalf * kSunHalf;
    vec3 facets = seen_slopes(elevation, towards, sqrt(variance));

    // Three facets stand for all: the mean one and two beside it.
    Surface surface = Surface(vec3(0.0), vec3(0.0));
    float mean = 0.0;
    for (int n = -1; n <= 1; ++n) {
        float slope = max(facets.y + 1.2247449 * float(n) * facets.z, 0.01 - elevation);
        vec2 tilted = slopes.xy - (slope - towards) * eye;
        float cosine = level * (elevation + slope) / sqrt(1.0 + dot(tilted, tilted));
        float reflectance = water_reflectance(clamp(cosine, 0.0, 1.0), 0.0);
        mean += reflectance / 3.0;
        if (kMirror)
            surface.reflected += ground_data.reflection / 3.0 * reflectance *
                                 reflected(seen, mirrored_ray(seen.ray, tilted), facets.z);
    }
    float height = frame.to_sun.z;
    const float kSunSets = 0.001, kSunFades = 0.01;  // sines of the sun's elevation
    float risen = clamp((height - kSunSets) / kSunFades, 0.0, 1.0) / max(height, kSunSets);
    vec3 to_eye = vec3(-seen.ray.xy, elevation * level);
    float shine = sun * glint_of(to_eye, slopes.xy, variance, facets.x * level) * kPi * risen;
    surface.reflected += shine * seen.beta * frame.ground_sun.rgb;

    surface.albedo = (1.0 - mean) * seen.dry;
    if (ground_data.foam_albedo > 0.0) {
        float foam = part_above(resolved_noise(ground_data.foam, seen.point.xy, print.longest), ground_data.foam_level);
        surface.albedo = mix(surface.albedo, vec3(ground_data.foam_albedo), foam);
        surface.reflected *= 1.0 - foam;
    }
    return surface;
}
