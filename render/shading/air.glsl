// SPDX-License-Identifier: Apache-2.0
// The air between the eye and what it sees, and the sky behind it; needs frame.glsl. Rays are unit vectors. Without
// kPhysicalSky the air has two colours; with it the tables of atmosphere.h, whose layers are: light scattered by
// molecules and many times; by particles, without their phase function; sunlight by altitude.

layout(constant_id = 5) const bool kPhysicalSky = false;
layout(set = 0, binding = 11) uniform sampler2DArray sky_tables;

vec3 sky_layer(vec2 place, float layer) {
    const vec2 texels = vec2(float(kSkyColumns), float(kSkyRows));
    return textureLod(sky_tables, vec3((place * (texels - 1.0) + 0.5) / texels, layer), 0.0).rgb;
}

// Returns the radiance of the sky along a ray; below the horizon along the ray mirrored at it, with its own angle to
// the sun.
vec3 sky_scattered(vec3 ray) {
    vec2 sun = frame.to_sun.xy;
    float across = dot(ray.xy, sun) * inversesqrt(max(dot(ray.xy, ray.xy) * dot(sun, sun), 1.0e-12));
    vec2 place = vec2(sky_across(clamp(across, -1.0, 1.0)), sky_upwards(min(abs(ray.z), 1.0)));
    return sky_layer(place, 0.0) + particle_phase(dot(frame.to_sun.xyz, ray), frame.air.y) * sky_layer(place, 1.0);
}

// Returns the radiance of a white surface that faces the unshaded sun at a height above the eye in metres.
vec3 sunlight_at(float height) {
    if (!kPhysicalSky) return frame.sunlight.rgb;
    return sky_layer(vec2(clamp((frame.air.x + height) / kSunlightTop, 0.0, 1.0), 0.0), 2.0);
}

// Returns the transmittance of the air over a distance in metres: D's beta. With tables the air is two exponential
// layers over a flat Earth.
vec3 air_transmittance(vec3 ray, float distance) {
    if (!kPhysicalSky) return exp(-frame.air_extinction.rgb * distance);
    return exp(-layer_column(frame.air.x, ray.z, distance, frame.rayleigh.w) * frame.rayleigh.rgb -
               layer_column(frame.air.x, ray.z, distance, frame.haze.w) * frame.haze.rgb);
}

// Returns the radiance of infinitely much sunlit air along a ray. With tables it is the sky's, so that the air becomes
// the sky far away.
vec3 endless_air(vec3 ray) {
    if (!kPhysicalSky) return frame.horizon.rgb;
    vec2 heights = vec2(frame.rayleigh.w, frame.haze.w);
    vec2 column = exp(-frame.air.x * heights) / (heights * max(abs(ray.z), 1.0e-5));
    vec3 beyond = exp(-column.x * frame.rayleigh.rgb - column.y * frame.haze.rgb);
    return sky_scattered(ray) / max(1.0 - beyond, 1.0e-4);
}

// Returns the radiance of sunlit air over a distance; `beta` is its transmittance.
vec3 air_light(vec3 ray, vec3 beta) { return (1.0 - beta) * endless_air(ray); }

// Gradient: the air is thickest at the horizon; its colour falls off exponentially with height, and reaches zero at the
// zenith.
vec3 gradient_sky(float height) {
    const float falloff = 4.0;
    float haze = (exp(-falloff * height) - exp(-falloff)) / (1.0 - exp(-falloff));
    return mix(frame.zenith.rgb, frame.horizon.rgb, haze);
}

// The radiance of the air along a ray: in total, and the part that clouds can shade, single scattering of sunlight.
struct SunlitAir {
    vec3 endless;
    vec3 most;                   // no more than the air and the sky have, so that none is negative
    float molecules, particles;  // with tables: pi times the phase functions, and the albedo
};

SunlitAir sunlit_air(vec3 ray) {
    vec3 endless = endless_air(ray);
    float cosine = dot(frame.to_sun.xyz, ray);
    if (kPhysicalSky)
        return SunlitAir(endless, endless, kPi * molecule_phase(cosine),
                         kPi * frame.air.z * particle_phase(cosine, frame.air.y));
    float direct = frame.horizon.w * 4.0 * kPi * particle_phase(cosine, frame.zenith.w);
    float share = direct / (direct + 1.0 - frame.horizon.w + 1.0e-6);
    return SunlitAir(endless, share * min(endless, gradient_sky(max(ray.z, 0.0))), 0.0, 0.0);
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
