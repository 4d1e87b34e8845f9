// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// Step 2, T's billboards: texture * light over what lies behind. Alpha of both outputs is the transmittance.

#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"

layout(set = 0, binding = 3) uniform sampler2DArray billboard_textures;

layout(location = 0) in vec2 coordinate;
layout(location = 1) in vec3 lit;
layout(location = 2) flat in vec4 veil;
layout(location = 3) flat in vec3 layer_level_distance;

layout(location = 0) out vec4 radiance;
layout(location = 1) out vec4 depth;

void main() {
    if (kTerrain && layer_level_distance.z > terrain_at(gl_FragCoord.xy)) discard;
    vec2 texel = textureLod(billboard_textures, vec3(coordinate, layer_level_distance.x), layer_level_distance.y).rg;
    float opacity = texel.r * veil.a;
    radiance = vec4(lit * texel.g + veil.rgb * texel.r, 1.0 - opacity);
    depth = vec4(layer_level_distance.z * opacity, 0.0, 0.0, 1.0 - opacity);
}
