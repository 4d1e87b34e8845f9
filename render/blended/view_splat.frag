// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/shared.h"
// Step 2: buffer = buffer * transmittance + colour. Alpha of both outputs is the transmittance, the blend factor.
#include "render/blended/attenuation.glsl"
#include "render/shading/frame.glsl"
#include "render/shading/ray.glsl"
#include "render/shading/integral.glsl"
#include "render/shading/scattering.glsl"

// Metaballs with kIntegrate have a pipeline of their own.
layout(constant_id = 0) const bool kExact = false;

layout(location = 0) in vec2 point;
layout(location = 1) flat in vec3 diffuse;
layout(location = 2) flat in vec3 direct;
layout(location = 3) flat in vec4 shape;
layout(location = 4) flat in vec4 centre_radius;

layout(location = 0) out vec4 radiance;
layout(location = 1) out vec4 depth;

void main() {
    vec3 ray = pixel_ray(gl_FragCoord.xy);
    terrain_end = terrain_at(gl_FragCoord.xy);
    if (kTerrain && shape.w > terrain_end) discard;
    float opacity;
    if (kExact) {
        opacity = integrated_opacity(centre_radius.xyz, centre_radius.w, ray, shape.x);
    } else {
        // Where the ray pierces the billboard's plane is farther from the centre than the ray itself.
        vec2 nearest = point * inversesqrt(1.0 + dot(point, point) * shape.z);
        opacity = billboard_opacity(nearest, shape.y);
    }
    radiance = vec4((diffuse + direct * scattered_once(dot(frame.to_sun.xyz, ray))) * opacity, 1.0 - opacity);
    depth = vec4(shape.w * opacity, 0.0, 0.0, 1.0 - opacity);
}
