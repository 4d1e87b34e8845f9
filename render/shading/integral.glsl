// SPDX-License-Identifier: Apache-2.0
// Opacity of a metaball along a ray, without textures and fits; needs ray.glsl.

// Returns the opacity of the part of a metaball between the eye and the ground, for metaballs that extend beyond
// either. The distance from the ray is a cross product, because a difference of squares would cancel far from the eye.
float integrated_opacity(vec3 centre_m, float radius, vec3 ray, float depth_scale) {
    vec3 centre = centre_m / radius;
    vec3 offset = cross(centre, ray);
    float w = 1.0 - dot(offset, offset);
    if (w <= 0.0) return 0.0;
    float half_chord = sqrt(w);
    float middle = dot(centre, ray);
    float start = max(-half_chord, -middle);
    float end = min(half_chord, ground_distance(ray) / radius - middle);
    if (end <= start) return 0.0;
    return 1.0 - exp(-depth_scale * (partial_line_integral(w, end) - partial_line_integral(w, start)));
}
