// SPDX-License-Identifier: Apache-2.0
// render/ground/ground_noise-inl.h and cover-inl.h in shaders, and what they read.

layout(set = 0, binding = 24, std430) readonly buffer Ground {
    GroundData ground_data;
};
layout(set = 0, binding = 25, std430) readonly buffer Octaves {
    GroundOctave octaves[];
};
layout(set = 0, binding = 26, std430) readonly buffer Cover {
    float cover_texels[];  // of the map: water, then snow, then rain
};

// mix_bits() of core/noise_hash.h.
uint mixed(uint h) {
    h = (h ^ h >> 16) * 0x7feb352du;
    h = (h ^ h >> 15) * 0x846ca68bu;
    return h ^ h >> 16;
}

// Returns a cell's number modulo 2^32 from its floor; undefined for far points, which no octave resolves.
uint cell_of(float low, uint first) { return uint(int(clamp(low, -1.0e9, 1.0e9))) + first; }

float slope_along(uint hash, vec2 apart) {
    vec2 component = vec2(hash & 0xffffu, hash >> 16) * (1.0 / 32768.0) - 1.0;
    return dot(component, apart);
}

// Returns where a point relative to the eye is in an octave's lattice.
vec2 in_lattice(GroundOctave o, vec2 p) {
    return vec2(o.x_x * p.x + o.x_y * p.y + o.from_x, o.y_x * p.x + o.y_y * p.y + o.from_y);
}

float noise_of(GroundOctave o, vec2 p) {
    vec2 at = in_lattice(o, p), low = floor(at), f = at - low;
    uint column = cell_of(low.x, o.cell_x), row = cell_of(low.y, o.cell_y);
    uint west = mixed(column), east = mixed(column + 1u);
    vec2 blend = ((6.0 * f - 15.0) * f + 10.0) * (f * f * f);
    float south = mix(slope_along(mixed(west + row), f), slope_along(mixed(east + row), f - vec2(1.0, 0.0)), blend.x);
    float north = mix(slope_along(mixed(west + row + 1u), f - vec2(0.0, 1.0)),
                      slope_along(mixed(east + row + 1u), f - vec2(1.0, 1.0)), blend.x);
    return 5.677 * mix(south, north, blend.y);
}

// Returns noise of the wavelengths that a pixel resolves, and the variance of the others.
vec2 resolved_noise(GroundNoise noise, vec2 p, float pixel_m) {
    vec2 sum = vec2(0.0, 1.0);
    for (uint n = noise.first; n < noise.first + noise.count; ++n) {
        float fraction = smoothstep(2.0, 5.0, octaves[n].wavelength_m / pixel_m);
        if (fraction == 0.0) break;  // the next ones are finer still
        float weight = octaves[n].weight * fraction;
        sum += vec2(weight * noise_of(octaves[n], p), -weight * weight);
    }
    return vec2(sum.x, max(sum.y, 0.0));
}

// Returns the part of a field of noise that lies above a level, in standard deviations.
float part_above(vec2 noise, float level) {
    float deviation = sqrt(noise.y + 0.12 * 0.12);
    return 1.0 / (1.0 + exp(1.702 * clamp((level - noise.x) / deviation, -30.0, 30.0)));
}

// Returns water and snow, mm, and rain, mm/h, on the ground at a point.
vec3 lying_at(vec2 point) {
    vec3 outside = ground_data.outside.xyz;
    uvec2 count = uvec2(ground_data.columns, ground_data.rows);
    if (count.x == 0u) return outside;
    vec2 size = vec2(count), at = ground_data.cover_place.zw * point + ground_data.cover_place.xy;
    vec2 from_edge = min(at, size - at) / size;
    float fraction = smoothstep(0.0, 0.1, min(from_edge.x, from_edge.y));
    vec2 place = clamp(at - 0.5, vec2(0.0), size - 1.0);
    vec2 low = min(floor(place), size - 2.0), part = place - low;
    uint first = uint(low.y) * count.x + uint(low.x);
    vec3 sum;
    for (uint n = 0u; n < 3u; ++n) {
        uint texel = n * count.x * count.y + first;
        float south = mix(cover_texels[texel], cover_texels[texel + 1u], part.x);
        float north = mix(cover_texels[texel + count.x], cover_texels[texel + count.x + 1u], part.x);
        sum[n] = mix(south, north, part.y);
    }
    return mix(outside, sum, fraction);
}
