// SPDX-License-Identifier: Apache-2.0
// Sky, and the ground plane with the shadow map, dark where ground that is not level hides them; needs ray.glsl and air.glsl.

layout(set = 0, binding = 4) uniform sampler2D shadow_map;

// Returns the radiance of the sun's disc, with limb darkening and an edge of one pixel.
vec3 sun_disc(vec3 ray) {
    vec3 apart = ray - frame.to_sun.xyz;
    float angle = sqrt(dot(apart, apart));
    float covered = clamp((kSunRadius - angle) * frame.up.w + 0.5, 0.0, 1.0) * frame.sun_disc.w;
    float across = min(angle / kSunRadius, 1.0);
    float cosine = sqrt(max(1.0 - across * across, 1.0e-4));
    vec3 fade = exp(frame.sun_fade.rgb * clamp(apart.z, -kSunRadius, kSunRadius));
    return covered * frame.sun_disc.rgb * fade * pow(vec3(cosine), vec3(kLimbDarkeningRed, kLimbDarkeningGreen, kLimbDarkeningBlue));
}

// Returns the radiance of the sky; below the horizon that of the horizon.
vec3 sky(vec3 ray) {
    if (kPhysicalSky) return sky_scattered(ray) + sun_disc(ray);
    return gradient_sky(max(ray.z, 0.0));
}

// Returns the fraction of direct sunlight that arrives on the ground at a point relative to the eye.
float sun_share(vec3 point) {
    vec2 coordinate = vec2(dot(frame.shadow_u.xyz, point) + frame.shadow_u.w,
                           dot(frame.shadow_v.xyz, point) + frame.shadow_v.w);
    float shadow = textureLod(shadow_map, coordinate, 0.0).r;
#ifdef NEPHOS_ENDLESS
    vec2 inner = step(vec2(0.01), coordinate) * step(coordinate, vec2(0.99));
    bool known = inner.x * inner.y > 0.0 && sees_first_period(point);
    if (endless() && !known) shadow = sunlight_beyond(point);
#endif
    return shadow;
}

// Returns the radiance of the ground there, without the air in front of it.
vec3 ground_light(vec3 point, float sun) {
#ifdef NEPHOS_ENDLESS
    vec2 below = light_below(point);
    vec3 colour = frame.ground.rgb * below.y + frame.ground_sun.rgb * (sun + below.x);
#else
    vec3 colour = frame.ground.rgb + frame.ground_sun.rgb * sun;
#endif
    vec3 way = frame.flash.xyz - point;  // lightning; adds nothing in the dark, no branch: see lighting.glsl
    float squared = dot(way, way);
    return colour +
           frame.ground_flash.rgb * flash_falloff(squared) * max(way.z, 0.0) * inversesqrt(max(squared, 1.0e-6));
}

vec3 ground(vec3 ray, float distance) {
    vec3 point = distance * ray, beta = air_transmittance(ray, distance);
    return beta * ground_light(point, sun_share(point)) + air_light(ray, distance, beta);
}

vec3 background(vec3 ray) {
    float distance = level_distance(ray);
    if (kTerrain && terrain_end < 1.0e30) return vec3(0.0);  // it is drawn later
    return distance < 1.0e30 ? ground(ray, distance) : sky(ray);
}
