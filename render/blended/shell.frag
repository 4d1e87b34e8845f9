// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// A shell of air over what lies behind it. Alpha of both outputs is the transmittance, the blend factor.
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/air.glsl"
#include "render/shading/scattering.glsl"
#include "render/shading/shells.glsl"

layout(location = 0) flat in uint shell;

layout(location = 0) out vec4 radiance;
layout(location = 1) out vec4 depth;

void main() {
    vec3 ray = pixel_ray(gl_FragCoord.xy);
    terrain_end = terrain_at(gl_FragCoord.xy);
    uvec2 pixel = uvec2(gl_FragCoord.xy) + uvec2(frame.picture.zw);
    AirLayer air = air_shell(shell, sunlit_air(ray), ray, pixel);
    radiance = vec4(air.light, air.transmittance);
    depth = vec4((1.0 - air.transmittance) * air.distance, 0.0, 0.0, air.transmittance);
}
