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

#define Real3 vec3
#define rgb(four) ((four).rgb)
#define xyz(four) ((four).xyz)
#include "render/shared/air.h"
#undef Real3
#undef rgb
#undef xyz
