// SPDX-License-Identifier: Apache-2.0
// The pass over the ground (render/ground/wet_ground.h) behind a finished view: an invocation a pixel. Its frame is that of
// ground with an albedo of 1; needs background.glsl.

layout(constant_id = 11) const bool kSea = false;      // GroundPattern::water
layout(constant_id = 12) const bool kCountry = false;  // GroundPattern::country
layout(constant_id = 13) const bool kLying = false;    // water or snow lie on the ground, or rain falls into water

#include "render/vulkan/ground_noise.glsl"
#include "render/vulkan/ground_country.glsl"
#include "render/vulkan/ground_mirror.glsl"
#include "render/vulkan/ground_wet.glsl"
#include "render/vulkan/ground_water.glsl"

layout(local_size_x = kComputeGroup) in;
layout(set = 0, binding = 8, std430) buffer Radiance {
    vec4 radiance[];  // w: transmittance
};
layout(push_constant) uniform Step {
    TileStep step;
};

// Returns the difference of radiance to dry ground, without the clouds in front.
vec3 changed(vec3 ray) {
    Seen seen;
    seen.ray = ray;
    seen.distance = level_distance(ray);
    if (!(seen.distance < 1.0e30)) return vec3(0.0);
    seen.point = seen.distance * ray;
    vec3 lying = kLying ? lying_at(seen.point.xy) : vec3(0.0);
    bool covers = !kSea && max(lying.x, lying.y) > 0.0;  // nothing lies on water
    if (!kSea && !kCountry && !covers) return vec3(0.0);
    seen.beta = air_transmittance(ray, seen.distance);
    seen.veil = kMirror ? air_light(ray, seen.distance, seen.beta) : vec3(0.0);
    seen.pixel_m = seen.distance / frame.up.w / sqrt(max(-ray.z, 1.0e-6));
    seen.dry = ground_data.dry.rgb;
    if (kCountry) seen.dry *= country_albedo(seen.point.xy, footprint_of(ray, seen.distance, frame.up.w));
    Surface surface = Surface(seen.dry, vec3(0.0));
    float sun = sun_share(seen.point);
    if (kSea) {
        surface = water_surface(seen, sun, lying.z);
    } else if (covers) {
        surface = wet_surface(seen, lying);
        lay_snow(seen, lying.y, surface);
    }
    return seen.beta * ground_light(seen.point, sun) * (surface.albedo - ground_data.dry.rgb) + surface.reflected;
}

void main() {
    uint index = gl_GlobalInvocationID.y * (kGroupRow * kComputeGroup) + gl_GlobalInvocationID.x;
    if (index >= step.width * step.height) return;
    vec4 clouds = radiance[index];
    if (clouds.a == 0.0) return;
    vec2 pixel = vec2(index % step.width, index / step.width) + 0.5;
    radiance[index].rgb = max(clouds.rgb + clouds.a * changed(pixel_ray(pixel)), 0.0);
}
