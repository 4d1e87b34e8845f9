// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/rain.h"
// Rain shafts (render/rain/rain_shafts.h): a ray a pixel, tiles of kRainTile x kRainTile pixels. An invocation does
// what a lane of rain_shafts-inl.h does; loops go over the curtains that some ray of the tile meets.
#include "render/vulkan/rain.glsl"
#include "render/vulkan/rain_pixels.glsl"

layout(local_size_x = kRainGroup) in;
layout(set = 0, binding = 5, std430) readonly buffer Noise {
    uint noise[];  // of each cell its four corners, a byte each
};

const float kNowhere = 1.0e30;
shared uint met_by_tile[2];
uvec2 met;  // curtains that this ray meets, a bit each

bool meets(uint c) { return (met[c >> 5] >> (c & 31u) & 1u) != 0u; }
bool tile_meets(uint c) { return (met_by_tile[c >> 5] >> (c & 31u) & 1u) != 0u; }

struct Way {
    vec2 unit, level;  // of a metre: in the curtain's units; in metres, without its lean
};

Way way_through(uint c, vec3 ray) {
    vec2 level = ray.xy - rain.curtains[c].lean.xy * ray.z;
    vec4 axes = rain.curtains[c].axes;
    return Way(vec2(dot(axes.xy, level), dot(axes.zw, level)), level);
}

// Returns the interval of a ray in a curtain; none: begin > end.
vec2 interval(uint c, vec3 ray) {
    vec2 unit = way_through(c, ray).unit;
    vec4 eye = rain.curtains[c].eye;
    // Relative to the point of the ray nearest to the axis, which is accurate from far away, too.
    float a = max(dot(unit, unit), 1.0e-16), nearest = -dot(eye.xy, unit) / a;
    vec2 at = nearest * unit + eye.xy;
    float chord = 1.0 - dot(at, at), half_way = sqrt(max(chord, 0.0) / a);
    float rise = abs(ray.z) < 1.0e-7 ? 1.0e-7 : ray.z;
    float low = -eye.z / rise, high = (eye.w - eye.z) / rise;
    vec2 part = vec2(max(max(nearest - half_way, min(low, high)), 0.0), min(nearest + half_way, max(low, high)));
    return chord > 0.0 && part.x < part.y ? part : vec2(kNowhere, -kNowhere);
}

bool may_meet(uint c, vec3 ray) {
    vec3 circle = rain.curtains[c].circle.xyz;
    float across = circle.x * ray.y - circle.y * ray.x;
    return across * across <= circle.z * circle.z * dot(ray.xy, ray.xy);
}

// Smooth noise 0..255.
float noise_at(vec2 place) {
    vec2 low = floor(place), s = place - low;
    s = s * s * (3.0 - 2.0 * s);
    ivec2 cell = ivec2(low) & (kShaftNoiseSide - 1);
    uint word = noise[(uint(cell.y) << kShaftNoiseBits) | uint(cell.x)];
    vec4 corners = vec4(word & 255u, (word >> 8) & 255u, (word >> 16) & 255u, word >> 24);
    vec2 rows = mix(corners.xz, corners.yw, s.x);
    return mix(rows.x, rows.y, s.y);
}

vec2 grains_at(uint c, Way way, float t) {
    vec4 grain = rain.curtains[c].grain;
    return t * grain.z * way.level + grain.xy;
}

// Returns the factor of f, the texture's falling parts.
float falls_at(uint c, Way way, float rise, float t) {
    float contrast = rain.shape.z;
    if (contrast <= 0.0) return 1.0;
    vec2 grains = grains_at(c, way, t);
    float height_m = t * rise + rain.curtains[c].eye.z;
    float falls = noise_at(vec2(grains.x + grains.y, height_m * rain.curtains[c].grain.w + rain.curtains[c].lean.w));
    return exp(1.5 / 255.0 * contrast * falls - 0.75 * contrast);
}

// Returns the rain of the cloud above, which fades in below the base of each column; y: the height, of that base.
vec2 rain_of_cloud(uint c, Way way, float t, float height_m) {
    vec4 cloud = rain.curtains[c].cloud;
    vec2 column = cloud_column(c, t * cloud.z * way.level + cloud.xy);
    float top = column.y / max(column.x, 1.0e-6) - cloud.w;
    float below = (top - height_m) / max(top, 1.0);
    return vec2(column.x * clamp(below / kShaftCloudFade, 0.0, 1.0), 1.0 - below);
}

// Returns the extinction of one curtain, without the factor of f.
float extinction(uint c, Way way, float rise, float t) {
    vec4 eye = rain.curtains[c].eye;
    vec2 at = t * way.unit + eye.xy;
    float radius2 = dot(at, at), height_m = t * rise + eye.z, h = height_m * rain.curtains[c].law.z;
    if (!(height_m >= 0.0 && radius2 < 1.0)) return 0.0;
    vec2 falling = vec2(clamp((1.0 - h) / kShaftTopFade, 0.0, 1.0), h);
    if (rain.curtains[c].bases.y != 0u) falling = rain_of_cloud(c, way, t, height_m);
    float most = rain.curtains[c].circle.w * falling.x, evaporation = rain.shape.w;
    if (evaporation > 0.0) {
        float left = clamp((falling.y - evaporation) / max(1.0 - evaporation, 1.0e-3), 0.0, 1.0);
        most *= left * (2.0 - left);
    }
    if (!(most > 0.0)) return 0.0;
    vec2 g = grains_at(c, way, t);
    float own = rain.curtains[c].lean.z;
    float coarse = noise_at(vec2(g.x + own, g.y)), fine = noise_at(vec2(4.0 * g.x, 4.0 * g.y + own));
    float strands = 0.6 / 255.0 * coarse + 0.4 / 255.0 * fine;
    float radius = sqrt(radius2), inside = 1.0 - radius * (rain.shape.y * strands + 1.0);
    float inner = rain.shape.x > 0.0 ? clamp(inside / rain.shape.x, 0.0, 1.0) : (inside > 0.0 ? 1.0 : 0.0);
    float even = most * smooth_blend(inner), contrast = rain.shape.z;
    return contrast > 0.0 ? even * exp(4.5 * contrast * strands - 2.25 * contrast - 0.25 * contrast * contrast) : even;
}

// Returns the optical depth of one curtain from a point of the ray in it to the sun, 0 elsewhere.
float depth_to_sun(uint c, Way way, float rise, float t) {
    vec4 eye = rain.curtains[c].eye, sun = rain.curtains[c].sun;
    vec2 at = t * way.unit + eye.xy;
    float a = max(dot(sun.xy, sun.xy), 1.0e-14), b = dot(at, sun.xy), inside = 1.0 - dot(at, at);
    float root = sqrt(max(b * b + a * inside, 0.0)), height_m = t * rise + eye.z;
    float way_m = min((root - b) / a, (eye.w - height_m) / max(rain.to_sun.z, 1.0e-3));
    if (!(inside > 0.0 && height_m >= 0.0 && way_m > 0.0)) return 0.0;
    // The integral of (1 - r^2)^2 over way_m, divided by it.
    float mean = way_m * (0.2 * a * a) + a * b;
    mean = way_m * mean + 4.0 / 3.0 * b * b - 2.0 / 3.0 * a * inside;
    mean = way_m * mean - 2.0 * inside * b;
    mean = way_m * mean + inside * inside;
    return max(sun.z * way_m * (sun.w * mean + 1.0 - sun.w), 0.0);
}

// Returns what the curtains around a point of the ray leave of the sun's light.
float sun_left(vec3 ray, float t) {
    float deepest = 0.0;
    uint count = uint(rain.extra.z);
    for (uint c = 0u; c < count; ++c)
        if (tile_meets(c) && meets(c)) deepest = max(deepest, depth_to_sun(c, way_through(c, ray), ray.z, t));
    return exp(-deepest);
}

// Finds the next interval of the union of the curtains' intersections after `run`.
bool next_run(vec3 ray, inout vec2 run) {
    uint count = uint(rain.extra.z);
    float last = run.y, begin = kNowhere;
    for (uint c = 0u; c < count; ++c) {
        if (!tile_meets(c) || !meets(c)) continue;
        vec2 part = interval(c, ray);
        if (part.x > last) begin = min(begin, part.x);
    }
    run = vec2(begin);
    if (!(begin < kNowhere)) return false;
    for (float before = -kNowhere; run.y > before;) {
        before = run.y;
        for (uint c = 0u; c < count; ++c) {
            if (!tile_meets(c) || !meets(c)) continue;
            vec2 part = interval(c, ray);
            if (part.x <= run.y) run.y = max(run.y, part.y);
        }
    }
    return true;
}

// Marches one interval, or the part of it before or behind the pixel's cloud; rgb: radiance, a: transmittance.
void march(vec3 ray, vec3 sun, vec3 horizon, vec2 part, float offset, inout vec4 sum) {
    if (!(part.x < part.y)) return;
    uint count = uint(rain.extra.z);
    float step_m = (part.y - part.x) * (1.0 / float(kShaftSteps)), clear_m = rain.extra.x;
    vec3 kept = exp(-rain.air.rgb * (part.x + (offset + float(kShaftStepsPerLight / 2)) * step_m));
    vec3 more = exp(-rain.air.rgb * (float(kShaftStepsPerLight) * step_m));
    for (int first = 0; first < kShaftSteps; first += kShaftStepsPerLight, kept *= more) {
        vec3 at = part.x + (offset + float(first) + vec3(0.0, 1.0, 2.0)) * step_m, densest = vec3(0.0);
        for (uint c = 0u; c < count; ++c) {
            if (!tile_meets(c) || !meets(c)) continue;
            Way way = way_through(c, ray);
            vec3 steady = vec3(extinction(c, way, ray.z, at.x), extinction(c, way, ray.z, at.y),
                               extinction(c, way, ray.z, at.z));
            if (steady != vec3(0.0)) densest = max(densest, steady * falls_at(c, way, ray.z, at.y));
        }
        if (densest == vec3(0.0)) continue;
        if (clear_m > 0.0) {
            vec3 far = clamp(2.0 / clear_m * at - 1.0, 0.0, 1.0);
            densest *= far * far * (3.0 - 2.0 * far);
        }
        float depth = dot(densest, vec3(step_m)), weight = sum.a * (1.0 - exp(-depth));
        vec3 point = at.y * ray;
        float sunlight = rain.sun.w > 0.0 ? sunlight_at(point) : 0.0;
        vec3 lit = rain.sun.w > 0.0 ? sun_left(ray, at.y) * sun : sun;
        sum.rgb += weight * mix(horizon, particle_radiance(ray, point, lit, sunlight), kept);
        sum.a -= weight;
    }
}

// PictureAir::horizon.
vec3 horizon_at(vec3 ray) {
    float level = dot(ray.xy, ray.xy) * dot(rain.to_sun.xy, rain.to_sun.xy);
    float cosine = dot(ray.xy, rain.to_sun.xy) / sqrt(max(level, 1.0e-12));
    float at = min(sqrt(max(0.5 - 0.5 * cosine, 0.0)), 1.0) * float(kHorizonNodes - 1u);
    uint below = min(uint(at), kHorizonNodes - 2u);
    return mix(rain.horizon[below].rgb, rain.horizon[below + 1u].rgb, at - float(below));
}

// Displacement of the steps of a pixel, 0.25..0.75.
float shaft_offset(uvec2 pixel) {
    uint sum = pixel.x * kShaftOffsetX + pixel.y * kShaftOffsetY;
    return 0.25 + float(((sum >> 8) * kShaftOffsetMix) >> 8) * (1.0 / 33554432.0);
}

void main() {
    uint lane = gl_LocalInvocationID.x, tile = rain_group(), count = uint(rain.extra.z);
    if (tile >= rain_step.tiles) return;
    uvec2 pixel = tile_pixel(tile, lane);
    bool inside = pixel.x < rain_step.width && pixel.y < rain_step.height;
    uvec2 of_picture = pixel + uvec2(rain_step.x, rain_step.y);
    vec3 ray = rain_ray(vec2(of_picture) + 0.5);
    met = uvec2(0u);
    for (uint c = 0u; c < count; ++c) {
        if (!inside || !may_meet(c, ray)) continue;
        vec2 part = interval(c, ray);
        if (part.x < part.y) met[c >> 5] |= 1u << (c & 31u);
    }
    if (lane < 2u) met_by_tile[lane] = 0u;
    barrier();
    if (met.x != 0u) atomicOr(met_by_tile[0], met.x);
    if (met.y != 0u) atomicOr(met_by_tile[1], met.y);
    barrier();
    if (met == uvec2(0u)) return;

    uint at = pixel.y * rain_step.width + pixel.x;
    vec4 colour = pixels[at];
    float cloud_m = cloud_distance(at, colour.a), offset = shaft_offset(of_picture);
    vec3 sun = sun_of_drops(ray), horizon = horizon_at(ray);
    vec4 before = vec4(0.0, 0.0, 0.0, 1.0), behind = before;
    for (vec2 run = vec2(-1.0); next_run(ray, run);) {
        float parting = min(max(cloud_m, run.x), run.y);
        march(ray, sun, horizon, vec2(run.x, parting), offset, before);
        if (colour.a > kShaftLeastSeen) march(ray, sun, horizon, vec2(parting, run.y), offset, behind);
    }
    // The air before a curtain is in both its terms: what the curtain sends has it already, and what it lets through
    // keeps the rest.
    vec3 through = colour.rgb + colour.a * ((behind.a - 1.0) * colour.rgb + behind.rgb);
    pixels[at].rgb = before.a * through + before.rgb;
}
