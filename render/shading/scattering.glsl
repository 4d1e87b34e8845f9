// SPDX-License-Identifier: Apache-2.0
// Sunlight that metaballs scatter, by the scattering table; needs frame.glsl.

layout(constant_id = 10) const bool kBows = false;  // the table has rows by colours

// scattering_table.h: kScatterAngles columns.
layout(set = 0, binding = 12, std430) readonly buffer Scattering {
    float scattering[];
};

// Interpolates between two angles of a row of the table.
float scattering_at(uint row, float column) {
    uint below = min(uint(column), kScatterAngles - 2u), at = row * kScatterAngles + below;
    return mix(scattering[at], scattering[at + 1u], column - float(below));
}

// Returns pi times the phase function, for red, green and blue. Sunlight travels along -to_sun before and along -ray after
// scattering.
vec3 scattered_once(float cosine) {
    float column = scatter_column(cosine);
    if (!kBows) return vec3(scattering_at(0u, column));
    uint first = 2u + kScatterDepths;
    return vec3(scattering_at(first, column), scattering_at(first + 1u, column), scattering_at(first + 2u, column));
}

// Returns the radiance per colour of the sun.
float scattered_often(vec3 ray, float sun_depth) {
    float column = scatter_column(dot(frame.to_sun.xyz, ray)), row = scatter_row(sun_depth);
    uint below = min(uint(row), kScatterDepths - 2u);
    return mix(scattering_at(1u + below, column), scattering_at(2u + below, column), row - float(below));
}
