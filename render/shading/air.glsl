// SPDX-License-Identifier: Apache-2.0
// The air between the eye and what it sees, and the sky behind it; needs frame.glsl. Rays are unit vectors. Without
// kPhysicalSky the air has two colours; with it the tables of atmosphere.h, whose layers are: light scattered by
// molecules and many times; by particles, without their phase function; sunlight by altitude; and kAirLayer on.

layout(constant_id = 5) const bool kPhysicalSky = false;
layout(set = 0, binding = 11) uniform sampler2DArray sky_tables;

vec3 sky_layer(vec2 place, float layer) {
    const vec2 texels = vec2(float(kSkyColumns), float(kSkyRows));
    return textureLod(sky_tables, vec3((place * (texels - 1.0) + 0.5) / texels, layer), 0.0).rgb;
}

// Returns the radiance of the sky along a ray; below the horizon that of the horizon.
vec3 sky_scattered(vec3 ray) {
    vec2 sun = frame.to_sun.xy;
    float across = dot(ray.xy, sun) * inversesqrt(max(dot(ray.xy, ray.xy) * dot(sun, sun), 1.0e-12));
    vec2 place = vec2(sky_across(clamp(across, -1.0, 1.0)), air_row(max(ray.z, frame.earth.x), frame.earth.x));
    return sky_layer(place, 0.0) + particle_phase(dot(frame.to_sun.xyz, ray), frame.air.y) * sky_layer(place, 1.0);
}

// Returns a layer of the table of air, at a place of its own (air_place()).
vec3 air_layer_at(vec2 place, float layer) { return textureLod(sky_tables, vec3(place, layer), 0.0).rgb; }

vec2 air_place(vec3 ray, float distance) {
    float column = air_distance(distance, ray.z, frame.earth.x, frame.earth.y) * float(kSkyColumns - 1u);
    float row = air_row(ray.z, frame.earth.x) * float(kAirRows - 1u) + (ray.z < frame.earth.x ? 0.0 : float(kAirRows));
    return (vec2(column, row) + 0.5) / vec2(float(kSkyColumns), float(kSkyRows));
}

// Returns the radiance of a white surface that faces the unshaded sun at a height above the eye in metres.
vec3 sunlight_at(float height) {
    if (!kPhysicalSky) return frame.sunlight.rgb;
    return sky_layer(vec2(clamp((frame.air.x + height) / kSunlightTop, 0.0, 1.0), 0.0), 2.0);
}

// Returns the transmittance of the air over a distance in metres: D's beta.
vec3 air_transmittance(vec3 ray, float distance) {
    if (!kPhysicalSky) return exp(-frame.air_extinction.rgb * distance);
    return exp(-distance * air_layer_at(air_place(ray, distance), float(kAirLayer)));
}

// The same for what lies within some tens of kilometres, in closed form: two exponential layers, and a ray whose
// altitude is as that over a round Earth at both ends and changes steadily between.
vec3 clear_air(vec3 ray, float distance) {
    if (!kPhysicalSky) return exp(-frame.air_extinction.rgb * distance);
    float slope = ray.z + (1.0 - ray.z * ray.z) * frame.earth.z * distance;
    return exp(-layer_column(frame.air.x, slope, distance, frame.rayleigh.w) * frame.rayleigh.rgb -
               layer_column(frame.air.x, slope, distance, frame.haze.w) * frame.haze.rgb);
}

// Returns the source of the light of sunlit air along a ray, up to a distance: light / (1 - transmittance).
vec3 air_source(vec3 ray, float distance) {
    if (!kPhysicalSky) return frame.horizon.rgb;
    vec2 sun = frame.to_sun.xy, place = air_place(ray, distance);
    float beside = dot(ray.xy, sun) * inversesqrt(max(dot(ray.xy, ray.xy) * dot(sun, sun), 1.0e-12));
    float cosine = clamp(beside, -1.0, 1.0), square = cosine * cosine;
    const float first = float(kAirLayer);
    vec3 around = vec3(0.5 * (square + cosine), 1.0 - square, 0.5 * (square - cosine));
    float phase = particle_phase(dot(frame.to_sun.xyz, ray), frame.air.y);
    // No compiler knows that there are six layers: lavapipe writes out the code of a look-up wherever one stands, and
    // shaders with many of them would take gigabytes to compile.
    uint layers = ray.z > -2.0 ? 6u : 0u;
    vec3 sum = vec3(0.0);
    for (uint n = 0u; n < layers; ++n)
        sum += around[n % 3u] * (n < 3u ? 1.0 : phase) * air_layer_at(place, first + 1.0 + float(n));
    return sum;
}

// Returns the radiance of sunlit air over a distance; `beta` is its transmittance.
vec3 air_light(vec3 ray, float distance, vec3 beta) { return (1.0 - beta) * air_source(ray, distance); }

// Gradient: the air is thickest at the horizon; its colour falls off exponentially with height, and reaches zero at the
// zenith.
vec3 gradient_sky(float height) {
    const float falloff = 4.0;
    float haze = (exp(-falloff * height) - exp(-falloff)) / (1.0 - exp(-falloff));
    return mix(frame.zenith.rgb, frame.horizon.rgb, haze);
}

// The radiance of the air along a ray: in total, and the part that clouds can shade, single scattering of sunlight.
struct SunlitAir {
    vec3 source;
    vec3 most;                   // no more than the air and the sky have, so that none is negative
    float molecules, particles;  // with tables: pi times the phase functions, and the albedo
};

SunlitAir sunlit_air(vec3 ray) {
    vec3 source = air_source(ray, kShaftsReach);
    float cosine = dot(frame.to_sun.xyz, ray);
    if (kPhysicalSky)
        return SunlitAir(source, source, kPi * molecule_phase(cosine),
                         kPi * frame.air.z * particle_phase(cosine, frame.air.y));
    float direct = frame.horizon.w * 4.0 * kPi * particle_phase(cosine, frame.zenith.w);
    float share = direct / (direct + 1.0 - frame.horizon.w + 1.0e-6);
    return SunlitAir(source, share * min(source, gradient_sky(max(ray.z, 0.0))), 0.0, 0.0);
}

// Returns the single-scattering radiance of infinitely much air as at a height above the eye; `sunlight`: its
// sunlight_at().
vec3 sunlit_at(SunlitAir air, float height, vec3 sunlight) {
    if (!kPhysicalSky) return air.most;
    vec2 density = exp(-max(frame.air.x + height, 0.0) * vec2(frame.rayleigh.w, frame.haze.w));
    vec3 molecules = density.x * frame.rayleigh.rgb, particles = density.y * frame.haze.rgb;
    vec3 scattered = air.molecules * molecules + air.particles * particles;
    return min(sunlight * scattered / max(molecules + particles, 1.0e-12), air.most);
}
