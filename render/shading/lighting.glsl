// SPDX-License-Identifier: Apache-2.0
// The light that a metaball scatters towards the eye; needs air.glsl, scattering.glsl and shells.glsl.

struct Scattered {
    vec3 diffuse;  // radiance that does not depend on the ray
    vec3 direct;   // radiance per light that is scattered once
};

// Returns the optical depths of light that is scattered once, and often (ViewBall::sun_depth).
vec2 depths_of(float sun_depth) {
    uint both = floatBitsToUint(sun_depth);
    vec2 two = vec2(unpackHalf2x16((both >> 15) & 0x7fffu).x, unpackHalf2x16(both & 0x7fffu).x);
    return sun_depth < 0.0 ? two : vec2(sun_depth);
}

// There are no branches on uniforms: lavapipe would recompile the shader for each draw.
Scattered scattered_light(ViewBall ball, float distance) {
    vec3 ambient = mix(frame.ambient_base.rgb, frame.ambient_top.rgb, ball.height);
    vec3 ray = vec3(ball.x, ball.y, ball.z) / max(distance, 1.0e-6);
    vec3 beta = air_transmittance(ray, distance);
    float albedo = frame.ambient_top.w;
    vec3 sunlight = sunlight_at(ball.z);
    vec2 depths = depths_of(ball.sun_depth);
    vec3 arriving = sunlight * scattered_often(ray, depths.y) + ambient;
    vec3 way = frame.flash.xyz - vec3(ball.x, ball.y, ball.z);  // lightning; adds nothing in the dark
    float share = float(ball.flags >> 16) / 65535.0;
    arriving += frame.flash.w * flash_falloff(dot(way, way)) * share * frame.flash_colour.rgb;
    Scattered light;
    light.diffuse = beta * albedo * arriving + air_light(ray, distance, beta);
    light.direct = beta * albedo * exp(-depths.x) * sunlight;
    return light;
}

// Returns the radiance towards the eye along `ray`.
vec3 radiance_along(Scattered light, vec3 ray) {
    return light.diffuse + light.direct * scattered_once(dot(frame.to_sun.xyz, ray));
}

// Returns the mean radiance of a metaball's disc; `ray`: to its centre, `ratio`: radius / distance.
vec3 radiance_of_disc(Scattered light, vec3 ray, float ratio) {
    return light.diffuse + light.direct * scattered_once(dot(frame.to_sun.xyz, ray) - kDiscSpread * ratio * ratio);
}

// Returns the drawn radius in metres, at least kMinRadiusPixels on the screen.
float drawn_radius(ViewBall ball, float distance) {
    return max(ball.radius, kMinRadiusPixels * distance / frame.up.w);
}

// Returns the light of a metaball at the beginning of its shell.
Scattered seen_through_shell(Scattered light, vec3 centre, float distance) {
    AirLayer air = layer_in_front(centre, distance);
    light.diffuse = light.diffuse * air.transmittance + air.light;
    light.direct *= air.transmittance;
    return light;
}
