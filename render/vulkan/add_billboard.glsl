// SPDX-License-Identifier: Apache-2.0
// T's billboards, as project_billboard.glsl leaves them; needs tile_splats.glsl.
#include "render/shading/billboards.glsl"

layout(set = 0, binding = 3) uniform sampler2DArray billboard_textures;

// `at`: the first of the billboard's words in `splats`. Beyond its rim the texture is clear.
void add_billboard(uint at, vec2 pixel) {
    vec4 place = uintBitsToFloat(splats[at]);
    uvec4 light = splats[at + 1u], more = splats[at + 2u], last = splats[at + 3u];
    vec2 l0b_l1r = unpackHalf2x16(light.y), l2b_l3r = unpackHalf2x16(more.x), air_b = unpackHalf2x16(more.w);
    vec3 l0 = vec3(unpackHalf2x16(light.x), l0b_l1r.x), l1 = vec3(l0b_l1r.y, unpackHalf2x16(light.z));
    vec3 l2 = vec3(unpackHalf2x16(light.w), l2b_l3r.x), l3 = vec3(l2b_l3r.y, unpackHalf2x16(more.y));
    vec3 veil = vec3(unpackHalf2x16(more.z), air_b.x);
    float opacity = uintBitsToFloat(last.x), distance = uintBitsToFloat(last.y);
    float layer = float(last.z & 255u), level = float(last.z >> 12 & 15u);
    uint turn = last.z >> 8 & 15u;

    float s = (pixel.x - place.x) * place.z;
    vec3 beside = l0 + s * l1;
    [[unroll]] for (uint row = 0u; row < kRows; ++row) {
        float t = (place.y - pixel.y - float(row)) * place.w;
        if (kTerrain && distance > ends[row]) continue;
        vec2 texel = textureLod(billboard_textures, vec3(billboard_coordinate(vec2(s, t), turn), layer), level).rg;
        vec3 lit = beside + t * l2 + max(t - s, 0.0) * l3;
        vec3 sum = transmittance[row] * (lit * texel.g + veil * texel.r);
        float part = transmittance[row] * texel.r * opacity;
        red[row] += sum.r;
        green[row] += sum.g;
        blue[row] += sum.b;
        if (kDistances) mean_distance[row] += part * distance;
        transmittance[row] -= part;
    }
}
