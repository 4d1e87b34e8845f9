// SPDX-License-Identifier: Apache-2.0
// The ray through a pixel; for fragment shaders.
#include "frame.glsl"

// Unit direction of the ray through this fragment.
vec3 fragment_ray() {
    vec2 pixel = gl_FragCoord.xy + frame.picture.zw;
    vec2 plane = vec2(2.0, -2.0) * pixel / frame.picture.xy + vec2(-1.0, 1.0);
    return normalize(frame.forward.xyz + plane.x * frame.right.xyz + plane.y * frame.up.xyz);
}

// Distance along a ray at which it meets the ground; a very large number when it does not.
float ground_distance(vec3 ray) {
    bool meets = frame.ground_sun.w > 0.0 && ray.z < 0.0;
    return meets ? min(frame.ground.w / ray.z, 1.0e30) : 1.0e30;
}
