// SPDX-License-Identifier: Apache-2.0
// render/shared/air.h in shaders: clear air along rays, and the tables of the sky; needs frame.glsl.

layout(constant_id = 5) const bool kPhysicalSky = false;
layout(set = 0, binding = 11) uniform sampler2DArray sky_tables;

vec3 sky_layer(float across, float upwards, uint layer) {
    const vec2 texels = vec2(float(kSkyColumns), float(kSkyRows));
    return textureLod(sky_tables, vec3((vec2(across, upwards) * (texels - 1.0) + 0.5) / texels, float(layer)), 0.0).rgb;
}

// Returns the radiance of a white surface that faces the unshaded sun at a height above the eye in metres: the third
// layer has it by altitude.
vec3 sunlight_at(float height) {
    if (!kPhysicalSky) return frame.sunlight.rgb;
    return sky_layer(clamp((frame.air.x + height) / kSunlightTop, 0.0, 1.0), 0.0, 2u);
}

// Returns the light of six layers of the table of air: of molecules and of particles, by the azimuth from the sun.
// No compiler knows that there are six: lavapipe writes out the code of a look-up wherever one stands, and shaders with
// many of them would take gigabytes to compile.
vec3 light_of_air(float column, float row, vec3 around, float phase) {
    uint layers = row > -2.0 ? 6u : 0u;
    vec3 sum = vec3(0.0);
    for (uint n = 0u; n < layers; ++n)
        sum += around[n % 3u] * (n < 3u ? 1.0 : phase) * sky_layer(column, row, kAirLayer + 1u + n);
    return sum;
}

#define Real3 vec3
#define rgb(four) ((four).rgb)
#define xyz(four) ((four).xyz)
#include "render/shared/air.h"
#undef Real3
#undef rgb
#undef xyz
