// SPDX-License-Identifier: Apache-2.0
// The light that a metaball scatters towards the eye; needs frame.glsl and air.glsl.

struct Scattered {
    vec3 diffuse;  // radiance that does not depend on the ray
    vec3 direct;   // radiance per phase function
};

// Light that arrives along many paths decays with the optical depth towards the sun like diffusion through a slab, far
// slower than the direct beam, and comes from all sides.
Scattered scattered_light(ViewBall ball, float distance) {
    float optical_depth = -log(max(ball.light, 1.0e-30));
    // Or T's absorption: light falls off in proportion to the way, to nothing. No branches on what is the same for the
    // whole picture: lavapipe then compiles the shader anew for each draw.
    float multiple = frame.sunlight.w * mix(1.0 / (1.0 + frame.ambient_base.w * optical_depth), ball.light,
                                            frame.air_extinction.w);
    vec3 ambient = mix(frame.ambient_base.rgb, frame.ambient_top.rgb, ball.height);
    vec3 ray = vec3(ball.x, ball.y, ball.z) / max(distance, 1.0e-6);
    vec3 beta = air_transmittance(ray, distance);
    float albedo = frame.ambient_top.w;
    vec3 sunlight = sunlight_at(ball.z);
    vec3 arriving = sunlight * multiple + ambient;
    vec3 way = frame.flash.xyz - vec3(ball.x, ball.y, ball.z);  // lightning; adds nothing in the dark
    float share = float(ball.flags >> 16) / 65535.0;
    arriving += frame.flash.w * flash_falloff(dot(way, way)) * share * frame.flash_colour.rgb;
    Scattered light;
    light.diffuse = beta * albedo * arriving + air_light(ray, beta);
    // A white surface facing the sun has radiance 1 here, 1 / pi of its irradiance: hence pi times the phase function.
    light.direct = beta * albedo * kPi * ball.light * sunlight;
    return light;
}

// Radiance towards the eye along `ray`. The sunlight travels along -to_sun and goes on along -ray.
vec3 radiance_along(Scattered light, vec3 ray) {
    return light.diffuse + light.direct * phase_function(dot(frame.to_sun.xyz, ray), frame.to_sun.w);
}

// Radius in metres of what is drawn: widened to a part of a pixel, see kMinRadiusPixels.
float drawn_radius(ViewBall ball, float distance) {
    return max(ball.radius, kMinRadiusPixels * distance / frame.up.w);
}
