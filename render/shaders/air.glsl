// SPDX-License-Identifier: Apache-2.0
// The air between the eye and what it sees; needs frame.glsl. Rays are unit vectors.

// Share of the light of a thing that arrives over a distance in metres: D's beta.
vec3 air_transmittance(vec3 ray, float distance) { return exp(-frame.air_extinction.rgb * distance); }

// Radiance of the air itself over that distance, in full light; `beta` is its transmittance.
vec3 air_light(vec3 ray, vec3 beta) { return (1.0 - beta) * frame.horizon.rgb; }
