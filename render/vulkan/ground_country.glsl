// SPDX-License-Identifier: Apache-2.0
// render/ground/country-inl.h in shaders; needs ground_noise.glsl.

// What a pixel covers of the ground, metres.
struct Footprint {
    vec2 along, across;
    float longest;
};

Footprint footprint_of(vec3 ray, float distance, float per_unit) {
    vec2 way = ray.xy * inversesqrt(max(dot(ray.xy, ray.xy), 1.0e-8));
    float width = distance / per_unit, length = width / max(-ray.z, 1.0e-4);
    return Footprint(length * way, width * vec2(-way.y, way.x), max(length, 0.0));
}

uint field_hash(uint column, uint row) { return mixed(mixed(column) + row); }

// Returns the part of an interval low..low + width that lies in the cell above its lower one.
float upper_part(float low, float width) { return clamp((low + width - (floor(low) + 1.0)) / width, 0.0, 1.0); }

// Returns the part of an interval that hedges cover, which lie around whole numbers.
float hedge_part(float middle, float width, float half_width) {
    float away = abs(middle - roundEven(middle)), reach = 0.5 * width;
    return max(min(away + reach, half_width) - max(away - reach, -half_width), 0.0) / width;
}

vec3 crop_of(float cell, uint row) {
    uint number = cell_of(cell, ground_data.fields.cell_x), pair = number & ~1u;
    bool joined = (field_hash(pair, row) & 64u) != 0u;
    return ground_data.crops[field_hash(joined ? pair : number, row) >> 8 & (kCropKinds - 1u)].rgb;
}

vec3 row_of_fields(float x, float width, uint row) {
    float along = float(mixed(row) & 1023u) * (1.0 / 1024.0) + (x - 0.5 * width), low = floor(along);
    return mix(crop_of(low, row), crop_of(low + 1.0, row), upper_part(along, width));
}

// Returns noise as a pixel sees it, at places along its footprint.
float probed_noise(GroundNoise noise, vec2 point, Footprint print) {
    const int kProbes = 4;
    float width = length(print.across);
    if (print.longest <= 1.5 * width) return resolved_noise(noise, point, print.longest).x;
    float size = max(width, print.longest / float(kProbes)), sum = 0.0;
    for (int n = 0; n < kProbes; ++n)
        sum += resolved_noise(noise, point + ((float(n) + 0.5) / float(kProbes) - 0.5) * print.along, size).x;
    return sum / float(kProbes);
}

// Returns the albedo relative to that of plain ground.
vec3 country_albedo(vec2 point, Footprint print) {
    vec2 turned = point + vec2(3170.0, -1230.0);
    vec2 bends = vec2(resolved_noise(ground_data.bends, point, print.longest).x,
                      resolved_noise(ground_data.bends, turned, print.longest).x);
    GroundOctave o = ground_data.fields;
    vec2 at = in_lattice(o, point + ground_data.bend_m * bends);
    vec2 full = vec2(abs(o.x_x * print.along.x + o.x_y * print.along.y) + abs(o.x_x * print.across.x + o.x_y * print.across.y),
                     abs(o.y_x * print.along.x + o.y_y * print.along.y) + abs(o.y_x * print.across.x + o.y_y * print.across.y));
    full = max(full, vec2(1.0e-4));
    float wide = min(full.x, 1.0), deep = min(full.y, 1.0), low = at.y - 0.5 * deep;
    uint first = cell_of(floor(low), o.cell_y);
    vec3 albedo = mix(row_of_fields(at.x, wide, first), row_of_fields(at.x, wide, first + 1u), upper_part(low, deep));
    // Of many fields in a pixel only their mean is left.
    albedo = mix(albedo, ground_data.mean_crop.rgb, smoothstep(1.0, 4.0, max(full.x, full.y)));
    albedo = mix(albedo, ground_data.hedge.rgb, min(hedge_part(at.y, full.y, ground_data.hedge_cells), 1.0));
    albedo = mix(albedo, ground_data.wood.rgb,
                 part_above(resolved_noise(ground_data.woods, point, print.longest), 0.7));
    float tone = 0.09 * probed_noise(ground_data.tones, point, print) +
                 0.15 * probed_noise(ground_data.tussocks, point, print);
    return max(1.0 + tone, 0.0) * albedo;
}
