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

// Radiance of the sky along a ray; below the horizon along the ray mirrored in it, with its own angle to the sun.
vec3 sky_scattered(vec3 ray) {
    vec2 sun = frame.to_sun.xy;
    float across = dot(ray.xy, sun) * inversesqrt(max(dot(ray.xy, ray.xy) * dot(sun, sun), 1.0e-12));
    vec2 place = vec2(sky_across(clamp(across, -1.0, 1.0)), sky_upwards(min(abs(ray.z), 1.0)));
    return sky_layer(place, 0.0) + particle_phase(dot(frame.to_sun.xyz, ray), frame.air.y) * sky_layer(place, 1.0);
}

// Colour of the unshaded sun at a height above the eye in metres: the radiance of a white surface that faces it.
vec3 sunlight_at(float height) {
    if (!kPhysicalSky) return frame.sunlight.rgb;
    return sky_layer(vec2(clamp((frame.air.x + height) / kSunlightTop, 0.0, 1.0), 0.0), 2.0);
}

// Share of the light of a thing that arrives over a distance in metres: D's beta. With tables the air is two layers
// over a flat Earth.
vec3 air_transmittance(vec3 ray, float distance) {
    if (!kPhysicalSky) return exp(-frame.air_extinction.rgb * distance);
    return exp(-layer_column(frame.air.x, ray.z, distance, frame.rayleigh.w) * frame.rayleigh.rgb -
               layer_column(frame.air.x, ray.z, distance, frame.haze.w) * frame.haze.rgb);
}

// Radiance of the air itself over that distance, in full light; `beta` is its transmittance. With tables it is the
// sky's part that lies in front: far away it becomes the sky.
vec3 air_light(vec3 ray, vec3 beta) {
    if (!kPhysicalSky) return (1.0 - beta) * frame.horizon.rgb;
    vec2 heights = vec2(frame.rayleigh.w, frame.haze.w);
    vec2 column = exp(-frame.air.x * heights) / (heights * max(abs(ray.z), 1.0e-5));
    vec3 beyond = exp(-column.x * frame.rayleigh.rgb - column.y * frame.haze.rgb);
    return sky_scattered(ray) * (1.0 - beta) / max(1.0 - beyond, 1.0e-4);
}

// Radiance per metre that the air at a distance along the ray scatters of unshaded sunlight towards the eye, before
// what lies between takes its share (air_transmittance).
vec3 air_sunlight(vec3 ray, float distance) {
    if (!kPhysicalSky) return kAirSunShare * frame.air_extinction.rgb * frame.horizon.rgb;
    float height = ray.z * distance, cosine = dot(frame.to_sun.xyz, ray);
    vec2 density = exp(-max(frame.air.x + height, 0.0) * vec2(frame.rayleigh.w, frame.haze.w));
    vec3 scattered = density.x * molecule_phase(cosine) * frame.rayleigh.rgb +
                     density.y * particle_phase(cosine, frame.air.y) * frame.air.z * frame.haze.rgb;
    return kPi * scattered * sunlight_at(height);
}
