// SPDX-License-Identifier: Apache-2.0
// Detailed density (density/detail.h), the twin of density/detail-inl.h. Look-ups are interpolated here: filters of
// textures have too few bits.
#include "density/detail_formulas.h"

layout(set = 0, binding = 18) uniform MarchBlock {
    March march;
};
layout(set = 0, binding = 19, std430) readonly buffer MarchCells {
    uint march_cells[];
};
layout(set = 0, binding = 20, std430) readonly buffer MarchLight {
    uint march_light[];
};
layout(set = 0, binding = 21, std430) readonly buffer MarchNoise {
    uint march_noise[];
};

float between(float a, float b, float weight) { return a + weight * (b - a); }

vec4 bytes_of(uint word) { return vec4(uvec4(word, word >> 8, word >> 16, word >> 24) & 255u); }

// A place in the bricks of a volume.
struct BrickPlace {
    vec3 brick, local;  // coordinates of the brick; nodes from its corner
    int number;         // of the brick, or -n as in CoverageField::table()
    bool within;        // the bricks' box
};

BrickPlace brick_place(uint v, vec3 offset_m) {
    BrickPlace place;
    vec3 nodes = offset_m * march.volumes[v].per_node;
    place.brick = floor(nodes * 0.125);
    place.local = nodes - 8.0 * place.brick;
    uvec3 bricks = uvec3(march.volumes[v].bricks_x, march.volumes[v].bricks_y, march.volumes[v].bricks_z);
    place.within = all(greaterThanEqual(place.brick, vec3(0.0))) && all(lessThan(place.brick, vec3(bricks)));
    uvec3 at = uvec3(mix(vec3(0.0), place.brick, bvec3(place.within)));
    place.number = int(march_cells[march.volumes[v].first_table + (at.z * bricks.y + at.y) * bricks.x + at.x]);
    return place;
}

bool holds_cloud(BrickPlace place) { return place.within && place.number >= 0; }

// The four bytes of a word of DetailNoise, 0..255, bilinearly.
float of_word(uint word, vec2 share) {
    vec4 bytes = bytes_of(word);
    return between(between(bytes.x, bytes.y, share.x), between(bytes.z, bytes.w, share.x), share.y);
}

// A cube of noise with 2^bits voxels on an edge, whose words begin at `first`; place in voxels; 0..1.
float noise_at(uint first, uint bits, vec3 place) {
    vec3 at = place - 0.5, below = floor(at), share = at - below;
    uint last = (1u << bits) - 1u;
    uvec3 voxel = uvec3(ivec3(below)) & last;
    uint in_plane = first + (voxel.y << bits) + voxel.x, above = (voxel.z + 1u) & last;
    return between(of_word(march_noise[in_plane + (voxel.z << (2u * bits))], share.xy),
                   of_word(march_noise[in_plane + (above << (2u * bits))], share.xy), share.z) * (1.0 / 255.0);
}

float small_noise_level(uint level, vec3 place) {
    uint first = kLargeNoiseWords + (level > 0u ? 262144u : 0u) + (level > 1u ? 32768u : 0u) + (level > 2u ? 4096u : 0u);
    return noise_at(first, 6u - level, place * uintBitsToFloat((127u - level) << 23));
}

// The small noise at a level of detail, 0..3, that need not be whole; place in voxels of level 0.
float small_noise_at(float level, vec3 place) {
    float below = min(floor(level), 2.0);
    return between(small_noise_level(uint(below), place), small_noise_level(uint(below) + 1u, place), level - below);
}

// log2 by its exponent and a chord of the mantissa: continuous, which is what counts.
float noise_level(float footprint, float voxels_per_m) {
    uint bits = floatBitsToUint(max(footprint * voxels_per_m, 1.0));
    float mantissa = uintBitsToFloat((bits & 0x7fffffu) | 0x3f800000u);
    return min(float(int(bits >> 23) - 127) + (mantissa - 1.0), 3.0);
}

// The small noises at a place in tiles of the large one, for a scaled footprint; 0..1.
float medium_noise(uint v, float footprint, vec3 tiles) {
    vec3 at = tiles * (march.volumes[v].medium_scale * 64.0);
    return small_noise_at(noise_level(footprint, march.volumes[v].medium_per_m),
                          vec3(0.6 * at.x - 0.8 * at.z, at.y, 0.8 * at.x + 0.6 * at.z));
}
float fine_noise(uint v, float footprint, vec3 tiles) {
    return small_noise_at(noise_level(footprint, march.volumes[v].fine_per_m),
                          tiles * (march.volumes[v].fine_scale * 64.0));
}

struct Node {
    float t, growth;
    float most_t;  // of the eight nodes around the place, 0..255
};

Node node_at(uint v, BrickPlace place) {
    vec3 below = min(floor(place.local), vec3(7.0)), share = place.local - below;
    uvec3 at = uvec3(below);
    uint first = march.volumes[v].first_nodes + uint(max(place.number, 0)) * kNodeWords +
                 (at.z * kNodeEdge + at.y) * kNodeEdge + at.x;
    vec4 a = bytes_of(march_cells[first]), b = bytes_of(march_cells[first + kNodeEdge]);
    vec4 c = bytes_of(march_cells[first + kNodeEdge * kNodeEdge]);
    vec4 e = bytes_of(march_cells[first + kNodeEdge * kNodeEdge + kNodeEdge]);
    vec2 ax = a.xy + share.x * (a.zw - a.xy), bx = b.xy + share.x * (b.zw - b.xy);
    vec2 cx = c.xy + share.x * (c.zw - c.xy), ex = e.xy + share.x * (e.zw - e.xy);
    vec2 low = ax + share.y * (bx - ax), high = cx + share.y * (ex - cx), both = low + share.z * (high - low);
    vec2 most = max(max(a.xz, b.xz), max(c.xz, e.xz));
    return Node(both.x * (1.0 / 255.0), both.y * (1.0 / 127.0) - 128.0 / 127.0, max(most.x, most.y));
}

// Rounded as the processor does it: of the fine noise there are thousands of voxels in a tile.
float turned(vec4 row, vec3 place) {
    return fma(row.x, place.x, fma(row.y, place.y, fma(row.z, place.z, row.w)));
}

// Places in the tiles of the large noise: of the band of height that a point is in and, where it passes into the next, of
// that one, too.
struct InTiles {
    vec3 own, next;
    float share, apart;  // of the next; mean_of_uniform()
};

vec4 band_of(uint v, float number) {
    uint first = march.volumes[v].first_bands + 4u * uint(number);
    return uintBitsToFloat(uvec4(march_cells[first], march_cells[first + 1u], march_cells[first + 2u], march_cells[first + 3u]));
}

InTiles in_tiles(uint v, vec3 place) {
    vec3 tiles = vec3(turned(march.volumes[v].to_noise[0], place), turned(march.volumes[v].to_noise[1], place),
                      turned(march.volumes[v].to_noise[2], place));
    InTiles at = InTiles(tiles, tiles, 0.0, 0.0);
    if (march.volumes[v].bands == 0u) return at;
    float height = (place.z - march.volumes[v].bands_begin) * march.volumes[v].bands_per_m - 0.5;
    float last = float(march.volumes[v].bands - 1u), below = clamp(floor(height), 0.0, last), above = min(below + 1.0, last);
    vec4 lower = band_of(v, below), upper = band_of(v, above);
    at.own += lower.xyz;
    at.next += upper.xyz;
    at.share = share_of_upper(height - below);
    at.apart = lower.w;
    return at;
}

struct Eroded {
    float density;
    float margin;  // coverage that is missing to be cloud; not above 0 inside
};

// The detailed density of a node at a place relative to the field's corner, metres; its margin only if that is asked
// for.
Eroded eroded(uint v, Node node, vec3 place, float footprint, bool margins) {
    float coverage = coverage_of(node.t), c = coverage + march.volumes[v].whole, top = towards_top(place.z - march.volumes[v].base_m);
    float large = large_width(top, node.growth, march.volumes[v].base_width, march.volumes[v].top_width,
                              march.volumes[v].dissolving_width);
    footprint *= march.volumes[v].footprint_scale;
    float medium = medium_width(footprint, march.volumes[v].medium_width);
    float fine = fine_width(footprint, march.volumes[v].fine_width), soft = edge_softness(footprint);
    float others = 0.5 * (medium + fine + soft);
    bool needed = c > 0.5 - others - 0.5 * large && coverage > march.volumes[v].least_coverage;
    if (!needed && !margins) return Eroded(0.0, 0.0);
    InTiles at = in_tiles(v, place);
    bool two = at.share > 0.0;
    float uniform_noise = noise_at(0u, 7u, at.own * 128.0);
    if (two) uniform_noise = mean_of_uniform(uniform_noise, noise_at(0u, 7u, at.next * 128.0), at.share, at.apart);
    float noise = large * (uniform_noise - 0.5) + 0.5;
    if (needed && abs(c - noise) < others && medium > 0.0) {
        float apart = apart_of_small(at.apart), bumps = medium_noise(v, footprint, at.own), grain = 0.0;
        if (two) bumps = mean_of_uniform(bumps, medium_noise(v, footprint, at.next), at.share, apart);
        bumps -= 0.5;
        if (fine > 0.0) {
            grain = fine_noise(v, footprint, at.own);
            if (two) grain = mean_of_uniform(grain, fine_noise(v, footprint, at.next), at.share, apart);
            grain -= 0.5;
        }
        noise += medium * billows(top, node.growth, march.volumes[v].wisps) * bumps;
        noise += fine * grain;
    }
    float margin = noise - 0.5 * soft - c, mask = saturate((c - noise) / soft + 0.5);
    float narrow = sqrt(medium * medium + soft * soft);
    float fraction = max(cloudy_fraction(c, large, min(narrow, large)), 0.02);
    float coarse = saturate((footprint - 13.0) * (1.0 / 12.0));
    float gain = between(march.volumes[v].gain_fine, march.volumes[v].gain_coarse, coarse);
    float mean = density_of(node.t, march.volumes[v].half_density);
    if (!needed) mask = 0.0;
    return Eroded(mask * min(gain * mean / fraction, max(mean, march.volumes[v].cap)), margin);
}

#include "render/shading/endless.glsl"

// `patches`: patches_at() there.
float density_at(uint v, vec3 offset_m, float patches, float footprint) {
    BrickPlace place = brick_place(v, offset_m);
    if (!holds_cloud(place)) return 0.0;
    Node node = node_at(v, place);
    node.t = scaled_share(node.t, patches);
    return eroded(v, node, offset_m, footprint, false).density;
}
