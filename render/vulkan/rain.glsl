// SPDX-License-Identifier: Apache-2.0
// What all passes of rain read, and its light; the same as render/rain/precipitation_light.cpp and rain_shafts-inl.h.

layout(set = 0, binding = 0) uniform RainBlock {
    RainUniforms rain;
};
layout(set = 0, binding = 1) uniform sampler2D shadow_map;
layout(set = 0, binding = 2, std430) readonly buffer Bases {
    float bases[];  // of each cloud: water of all columns, then water times base
};
layout(set = 0, binding = 3, std430) readonly buffer GroundLightWords {
    uint ground_words[];
};
layout(set = 0, binding = 4, std430) readonly buffer Bow {
    vec4 bow[];  // rgb
};
layout(push_constant) uniform Step {
    RainStep rain_step;
};

uint rain_group() { return gl_WorkGroupID.y * kGroupRow + gl_WorkGroupID.x; }

float smooth_blend(float x) { return x * x * (3.0 - 2.0 * x); }

// What falls from the cloud above a place, in texels: x: its water, y: water times the world height of its base.
vec2 cloud_column(uint c, vec2 carried) {
    uvec4 table = rain.curtains[c].bases;
    vec2 size = vec2(table.yz), repeats = vec2(table.w & 1u, table.w >> 1);
    vec2 at = mix(clamp(carried, vec2(-2.0), size + 1.0), carried - size * floor(carried / size), repeats);
    vec2 low = floor(at), part = at - low, sum = vec2(0.0);
    for (uint corner = 0u; corner < 4u; ++corner) {
        vec2 side = vec2(corner & 1u, corner >> 1), texel = low + side;
        texel *= 1.0 - repeats * step(size, texel);  // the first again
        if (any(lessThan(texel, vec2(0.0))) || any(greaterThanEqual(texel, size))) continue;
        vec2 weights = mix(1.0 - part, part, side);
        uint word = table.x + uint(texel.y) * table.y + uint(texel.x);
        sum += weights.x * weights.y * vec2(bases[word], bases[word + table.y * table.z]);
    }
    return sum;
}

// Phase function of particles times pi, without bows.
float drop_phase(float cosine) {
    float g = rain.to_sun.w, base = 1.0 + g * g - 2.0 * g * cosine;
    return kForwardFraction * 0.25 * (1.0 - g * g) / (base * sqrt(base)) + 0.25 * (1.0 - kForwardFraction);
}

// What particles scatter of the sun along a ray.
vec3 sun_of_drops(vec3 ray) {
    if (rain.sun.w == 0.0) return vec3(0.0);
    float cosine = dot(ray, rain.to_sun.xyz), lobe = drop_phase(cosine);
    if (rain.air.w == 0.0) return lobe * rain.sun.rgb;
    float place = sqrt(clamp(0.5 * cosine + 0.5, 0.0, 1.0)) * float(kBowCells);
    uint below = min(uint(place), kBowCells - 1u);
    vec3 bows = mix(bow[below].rgb, bow[below + 1u].rgb, place - float(below));
    return rain.sun.rgb * ((1.0 - rain.air.w) * lobe + bows);
}

float shadow_texel(ivec2 at, ivec2 size) {
    bool inside = at.x >= 0 && at.y >= 0 && at.x < size.x && at.y < size.y;
    return inside ? texelFetch(shadow_map, at, 0).r : 1.0;
}

// Returns the fraction of the sunlight at a point, between texels; samplers have too few bits.
float sunlight_at(vec3 point) {
    if (rain.extra.y == 0.0) return 1.0;
    ivec2 size = textureSize(shadow_map, 0);
    vec2 place = vec2(dot(rain.shadow_u.xyz, point) + rain.shadow_u.w, dot(rain.shadow_v.xyz, point) + rain.shadow_v.w);
    vec2 at = place * vec2(size) - 0.5;
    if (!(all(greaterThan(at, vec2(-1.0))) && all(lessThan(at, vec2(size))))) return 1.0;
    vec2 low = floor(at), part = at - low;
    ivec2 texel = ivec2(low);
    float above = mix(shadow_texel(texel, size), shadow_texel(texel + ivec2(1, 0), size), part.x);
    float below = mix(shadow_texel(texel + ivec2(0, 1), size), shadow_texel(texel + ivec2(1, 1), size), part.x);
    return mix(above, below, part.y);
}

// Returns fractions of the light of open ground: scattered sunlight, and the sky's.
vec2 light_below(vec3 point) {
    if (rain.flash_m.w == 0.0) return vec2(0.0, 1.0);
    const uint kTexels = 96u;
    vec2 at = clamp(rain.ground_place.xy * point.xy + rain.ground_place.zw, 0.0, float(kTexels - 1u));
    vec2 texel = min(floor(at), float(kTexels - 2u)), part = at - texel;
    uint first = uint(texel.y) * kTexels + uint(texel.x);
    vec2 low = mix(unpackUnorm2x16(ground_words[first]), unpackUnorm2x16(ground_words[first + 1u]), part.x);
    vec2 high = mix(unpackUnorm2x16(ground_words[first + kTexels]), unpackUnorm2x16(ground_words[first + kTexels + 1u]),
                    part.x);
    return mix(low, high, part.y);
}

// Returns the radiance of particles at a point along a ray; `sun`: of sun_of_drops(), `sunlight`: the fraction there.
vec3 particle_radiance(vec3 ray, vec3 point, vec3 sun, float sunlight) {
    vec2 below = light_below(point);
    vec3 light = below.x * rain.by_scattered_sun.rgb + below.y * rain.by_sky.rgb;
    light += sunlight * (sun + rain.by_sunlit_ground.rgb);
    if (rain.flash.w > 0.0) {
        vec3 way = rain.flash_m.xyz - point;
        float squared = max(dot(way, way), 1.0e4);
        light += flash_falloff(squared) * drop_phase(dot(ray, way) * inversesqrt(squared)) * rain.flash.rgb;
    }
    return light;
}
