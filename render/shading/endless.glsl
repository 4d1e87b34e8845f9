// SPDX-License-Identifier: Apache-2.0
// Clouds whose lattice repeats to the horizon; needs detail.glsl. The first period has the lattice's cloud. In
// its images a noise of the size of the lattice makes clouds larger and smaller, or lets them vanish, so that no
// repetition shows. Beyond the shade map, which holds the first period, their shade is known by the depth of lines
// through a period.

#define NEPHOS_ENDLESS

// Returns a place relative to the eye as if the round Earth were a plane.
vec3 above_plane(vec3 point, float bend) { return vec3(point.xy, point.z + bend * dot(point.xy, point.xy)); }

// Returns how far images are drawn aside, metres, and what that adds to the slope of lines. `beyond`: from the first
// period, along the axis across which they are drawn; `length`: kWaveAcross or kWaveAlong.
vec2 wave_at(uint v, float beyond, float length) {
    float per_wave = march.volumes[v].patch_ramp / length, turns = beyond * per_wave, half_turn = fract(turns) - 0.5;
    float q = 4.0 * abs(half_turn) - 1.0, rest = 2.0 - abs(q);
    float slope = -8.0 * kWaveHeight * (half_turn < 0.0 ? 1.0 - rest : rest - 1.0);
    return vec2(kWaveHeight / max(per_wave, 1.0e-9) * (1.0 - q * rest), beyond == 0.0 ? 0.0 : slope);
}

// Returns how far a place relative to the corner lies beyond the first period, in x and y.
vec2 beyond_home(uint v, vec2 place) {
    vec2 end = march.volumes[v].home + vec2(march.volumes[v].period_x, march.volumes[v].period_y);
    return max(place - end, 0.0) - max(march.volumes[v].home - place, 0.0);
}

// Returns how far a place is drawn aside, metres east and north.
vec2 drawn_aside(uint v, vec2 place) {
    vec2 beyond = beyond_home(v, place);
    return vec2(wave_at(v, beyond.y, kWaveAcross).x, wave_at(v, beyond.x, kWaveAlong).x);
}

// Returns the direction of a ray at a distance from the eye, as places of offset_in() go on along it.
vec3 way_in(uint v, vec3 ray, float distance) {
    vec2 beyond = beyond_home(v, distance * ray.xy - march.volumes[v].corner.xy);
    float rise = 2.0 * march.volumes[v].bend * distance * (1.0 - ray.z * ray.z);
    vec2 slopes = vec2(wave_at(v, beyond.y, kWaveAcross).y, wave_at(v, beyond.x, kWaveAlong).y);
    return ray + vec3(march.volumes[v].repeats * slopes * ray.yx, rise);
}

// Returns a place relative to a volume's corner. Of a volume that repeats: the one with the same cloud in its first
// period, over a plane ground. Without a branch: lavapipe would recompile the shader.
vec3 offset_in(uint v, vec3 point) {
    vec3 offset = above_plane(point, march.volumes[v].bend) - march.volumes[v].corner.xyz;
    vec2 period = vec2(march.volumes[v].period_x, march.volumes[v].period_y);
    vec2 per_period = vec2(march.volumes[v].per_period_x, march.volumes[v].per_period_y);
    offset.xy += march.volumes[v].repeats * drawn_aside(v, offset.xy);
    offset.xy -= period * floor((offset.xy - march.volumes[v].home) * per_period);
    return offset;
}

// Returns how much cloud there is, relative to the first period, at a place relative to the corner that is not taken
// back to it.
float patches_at(uint v, vec2 place) {
    vec2 beyond = abs(beyond_home(v, place));
    float share = min(max(beyond.x, beyond.y) * march.volumes[v].patch_ramp, 1.0);
    if (share == 0.0) return 1.0;
    vec4 to = march.volumes[v].to_patches;
    float noise = noise_at(0u, 7u, vec3(dot(to.xy, place), dot(to.zw, place), kPatchLevel) * 128.0);
    return max(share * kPatchSpread * (1.0 - 2.0 * noise) + 1.0, 0.0);
}

// Returns that of a place relative to the eye.
float patches_of(uint v, vec3 point) {
    return march.volumes[v].repeats > 0.0 ? patches_at(v, point.xy - march.volumes[v].corner.xy) : 1.0;
}

// Returns D times a factor, as the share t of D and the density of half coverage that nodes store.
float scaled_share(float t, float factor) { return t * factor / max(1.0 - t + t * factor, 1.0e-6); }

// Returns whether there is such a cloud.
bool endless() {
    float some = 0.0;
    for (uint v = 0u; v < march.count; ++v) some += march.volumes[v].repeats;
    return some > 0.0;
}

// Returns the interval of a ray outside of which none shades it.
vec2 part_below_endless(vec3 ray) {
    vec2 part = vec2(1.0e30, 0.0);
    for (uint v = 0u; v < march.count; ++v) {
        if (march.volumes[v].repeats == 0.0) continue;
        float top = march.volumes[v].shade_top, crossing = top / (abs(ray.z) < 1.0e-12 ? 1.0e-12 : ray.z);
        vec2 below = top > 0.0 ? vec2(0.0, ray.z > 0.0 ? crossing : 1.0e30) : vec2(ray.z > 0.0 ? 1.0e30 : crossing, 1.0e30);
        if (below.x < below.y) part = vec2(min(part.x, below.x), max(part.y, below.y));
    }
    return part;
}

// Returns the mean fraction of the sunlight that clouds which repeat leave below them.
float mean_sunlight() {
    float left = 1.0;
    for (uint v = 0u; v < march.count; ++v)
        left *= march.volumes[v].repeats > 0.0 ? march.volumes[v].mean_sunlight : 1.0;
    return left;
}

// Returns where the line from a point, over a plane ground, towards the sun crosses a volume that repeats, in the middle
// of its height: column and row of its shade; metres from its corner.
vec4 sun_crossing(uint v, vec3 above) {
    vec2 at = vec2(dot(march.volumes[v].shade_u.xyz, above) + march.volumes[v].shade_u.w,
                   dot(march.volumes[v].shade_v.xyz, above) + march.volumes[v].shade_v.w);
    vec2 middle = vec2(march.volumes[v].shade_mid_x, march.volumes[v].shade_mid_y);
    return vec4(at, 2.0 * march.volumes[v].corner.w * at + middle);
}

// Returns whether that line crosses the first period, which the shade map and the shadow map know, of all such volumes.
bool sees_first_period(vec3 point) {
    bool first = true;
    for (uint v = 0u; v < march.count; ++v) {
        vec2 at = sun_crossing(v, above_plane(point, march.volumes[v].bend)).zw;
        first = first && (march.volumes[v].repeats == 0.0 || beyond_home(v, at) == vec2(0.0));
    }
    return first;
}

// Returns the fraction of the sunlight that clouds which repeat leave at a point relative to the eye.
float sunlight_beyond(vec3 point) {
    float left = 1.0, blurred = clamp((length(point) - kShadeFades_m) * (0.5 / kShadeFades_m), 0.0, 1.0);
    for (uint v = 0u; v < march.count; ++v) {
        if (march.volumes[v].repeats == 0.0) continue;
        vec3 place = above_plane(point, march.volumes[v].bend);
        vec4 crossing = sun_crossing(v, place);
        vec2 at = crossing.xy, middle = crossing.zw;
        uvec2 count = uvec2(march.volumes[v].shade_columns, march.volumes[v].shade_rows);
        at += drawn_aside(v, middle) / (2.0 * march.volumes[v].corner.w);
        vec2 size = vec2(count), wrapped = max(at - floor(at / size) * size, 0.0);
        uvec2 texel = min(uvec2(wrapped), count - 1u);
        uint word = march_light[march.volumes[v].first_shade + texel.y * count.x + texel.x];
        float root = of_word(word, wrapped - vec2(texel)) * (1.0 / 255.0);
        float part = clamp((march.volumes[v].shade_top - place.z) * march.volumes[v].per_shade_height, 0.0, 1.0);
        float exact = exp(-root * root * kMostShadeDepth * patches_at(v, middle) * part);
        left *= mix(exact, 1.0 - part * (1.0 - march.volumes[v].mean_sunlight), blurred);
    }
    return left;
}

// Returns fractions of the light of open ground at a point relative to the eye: scattered sunlight, and the sky's.
vec2 light_below(vec3 point) {
    vec2 at = clamp(march.ground_light.xy * point.xy + march.ground_light.zw, 0.0, float(kGroundTexels - 1u));
    vec2 texel = min(floor(at), float(kGroundTexels - 2u)), part = at - texel;
    uint first = march.first_ground_light + uint(texel.y) * kGroundTexels + uint(texel.x);
    vec2 low = mix(unpackUnorm2x16(march_light[first]), unpackUnorm2x16(march_light[first + 1u]), part.x);
    vec2 high = mix(unpackUnorm2x16(march_light[first + kGroundTexels]),
                    unpackUnorm2x16(march_light[first + kGroundTexels + 1u]), part.x);
    return mix(low, high, part.y);
}
