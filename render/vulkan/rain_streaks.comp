// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/rain.h"
// Particles at the time of a frame, as streaks (render/rain/particle_streaks.cpp): a work group has a segment of
// kStreakSegment particles and keeps the streaks of those that show, in their order.
#include "render/vulkan/pairs.glsl"
#include "render/vulkan/rain.glsl"
#include "render/vulkan/rain_order.glsl"

layout(local_size_x = kRainGroup) in;
layout(set = 0, binding = 8, std430) readonly buffer Passes {
    RainPass passes[];
};
layout(set = 0, binding = 9, std430) readonly buffer Particles {
    RainParticle particles[];
};
layout(set = 0, binding = 10, std430) writeonly buffer Streaks {
    vec4 streaks[];  // three of each: ends; width, opacity, distance; radiance
};
layout(set = 0, binding = 11, std430) writeonly buffer SegmentCounts {
    uint segment_counts[];
};

#define the_pass passes[rain_step.pass]

struct Streak {
    vec4 ends;
    float width, opacity, distance_m;
    vec3 radiance;
};

float linear(float low, float high, float x) { return clamp((x - low) / (high - low), 0.0, 1.0); }

// Returns the fractional part of a sum, less a half.
float centred_fraction(float high, float low, float phase) {
    precise float whole = high - floor(high);
    precise float sum = (whole + phase) + (low + 0.5);
    return sum - floor(sum) - 0.5;
}

// The place in a box along one axis. `away`: a sum of two floats, metres.
float place_across(float phase, vec2 away, Pair width) {
    precise float quotient = away.x / width.high;
    Pair back = exact_product(quotient, width.high);
    precise float rest = (((away.x - back.high) - back.low) + away.y) - quotient * width.low;
    precise float more = rest / width.high;
    return centred_fraction(quotient, more, phase) * width.high;
}

// Returns where a particle is, from the middle of the container (place_particles()). In sums of two floats: after
// days of rain a float would count fall in metres.
vec3 place_of(RainParticle of) {
    Pair depth = exact_product(of.reach, the_pass.box_high.x), sum = exact_sum(depth.high, the_pass.box_high.y);
    precise float rest = sum.low + (depth.low + of.reach * the_pass.box_low.x + the_pass.box_low.y);
    Pair width = exact_sum(sum.high, rest);
    Pair fall = exact_product(of.speed, the_pass.away_z.z), fallen = exact_sum(fall.high, the_pass.away_z.x);
    precise float fallen_low = fallen.low + (fall.low + of.speed * the_pass.away_z.w + the_pass.away_z.y);
    return vec3(place_across(of.x, the_pass.away_x.xy, width), place_across(of.y, the_pass.away_x.zw, width),
                centred_fraction(fallen.high, fallen_low, of.z) * the_pass.boxes.y);
}

struct Sway {
    vec2 place, velocity;
    float cover;
};

// Cosines are exact near 0 only.
float within_turn(float angle) { return angle - 2.0 * kPi * round(angle * (0.5 / kPi)); }

Sway sway_of(uint i, float diameter_mm) {
    uint speed = i % kSwaySpeeds;
    float start = float(i % kSwayStarts) * kSwayStart, turn = (i & 1u) != 0u ? 1.0 : -1.0;
    float per_s = turn * (kSwaySlowest + kSwayFaster * float(speed));
    float radius_m = kSwayLeast_m + kSwayMore_m * float(i % kSwayRadii) / (0.5 + diameter_mm);
    float angle = within_turn(start + turn * the_pass.sway[speed].x);
    float harmonic = within_turn((kSwayHarmonic + 1.0) * start + turn * the_pass.sway[speed].y);
    float c = cos(angle), s = sin(angle);
    return Sway(radius_m * vec2(c, s), radius_m * per_s * vec2(-s, c), 0.7 + 0.3 * cos(harmonic));
}

// The strongest rain of some curtains, a bit each: particles per m^3 and drawn one.
float strongest(uvec2 of, vec3 place, float d_mm) {
    float most = 0.0;
    uint count = uint(rain.extra.z);
    for (uint c = 0u; c < count; ++c) {
        if ((of[c >> 5] >> (c & 31u) & 1u) == 0u) continue;
        vec4 eye = rain.curtains[c].eye, axes = rain.curtains[c].axes, law = rain.curtains[c].law;
        float height_m = place.z + eye.z, height = height_m * law.z;
        if (height < 0.0 || height > 1.0) continue;
        vec2 level = place.xy - rain.curtains[c].lean.xy * place.z;
        vec2 at = vec2(dot(axes.xy, level), dot(axes.zw, level)) + eye.xy;
        float value = dot(at, at), edge = rain.extra.w;
        if (value >= 1.0) continue;
        float fraction = edge > 0.0 ? smooth_blend(clamp((1.0 - sqrt(value)) / edge, 0.0, 1.0)) : 1.0;
        if (rain.curtains[c].bases.y != 0u) {
            vec4 cloud = rain.curtains[c].cloud;
            vec2 column = cloud_column(c, cloud.z * level + cloud.xy);
            float base_m = column.y / column.x - cloud.w;
            if (!(column.x > 0.0) || height_m > base_m) continue;
            fraction *= column.x;
            height = height_m / base_m;
        }
        float evaporation = rain.shape.w;
        if (evaporation > 0.0) {
            float left = clamp((height - evaporation) / max(1.0 - evaporation, 1.0e-3), 0.0, 1.0);
            fraction *= left * (2.0 - left);
        }
        if (fraction > 0.0) most = max(most, fraction * law.x * exp(law.y * d_mm));
    }
    return most;
}

float real_particles(vec3 place, float d_mm) {
    float here = strongest(the_pass.rain.xy, place, d_mm);
    if (!(here > 0.0) || the_pass.rain.zw == uvec2(0u)) return here;
    return max(0.0, here - strongest(the_pass.rain.zw, place, d_mm));
}

// drawn_per_m3(): particles per m^3 at a distance in the container.
float drawn_per_m3(float d) {
    float left = d <= 1.0 - kReachFade ? 1.0 - d - 0.5 * kReachFade / (1.0 - kReachFade) * d
                                       : (1.0 - d) * (1.0 - d) * (1.0 - kReachFade) / (2.0 * kReachFade * d);
    return the_pass.box_low.z * max(left, 0.01);
}

// Returns a point in pixels; z: its distance along the view's axis.
vec3 projected(vec3 place, vec3 eye, vec3 right, vec3 up, vec3 forward) {
    vec3 way = place - eye;
    float depth = dot(way, forward);
    vec2 at = vec2(dot(way, right), dot(way, up)) / depth;
    return vec3(0.5 * (at.x + 1.0) * rain.right.w, 0.5 * (1.0 - at.y) * rain.up.w, depth);
}

vec3 velocity_of(RainParticle of, Sway sway, float width_m) {
    vec3 v = vec3(the_pass.wind.xy, -of.speed);
    if (the_pass.wind.w == 0.0) return the_pass.box_low.w * v;
    v.xy += sway.velocity;
    return min(1.0, width_m / max(the_pass.box_high.z, 1.0e-6) / length(v)) * v;
}

// Extends a streak about its middle to a least length; vertical where its ends coincide.
vec4 at_least(vec4 ends, float least) {
    vec2 way = ends.zw - ends.xy, middle = 0.5 * (ends.xy + ends.zw);
    float span = length(way);
    if (span >= least) return ends;
    way = span > 1.0e-3 ? way * (0.5 * least / span) : vec2(0.0, 0.5 * least);
    return vec4(middle - way, middle + way);
}

bool beside_picture(vec4 ends, float margin) {
    vec2 low = min(ends.xy, ends.zw), high = max(ends.xy, ends.zw);
    return any(lessThan(high, vec2(-margin))) || any(greaterThan(low, vec2(rain.right.w, rain.up.w) + margin));
}

// Fade weight of a particle.
float presence(uint i, float reach, float d, float z, float distance_m, bool far) {
    float fraction = the_pass.centre.w * min(1.0, (reach - d) / (kReachFade * reach));
    fraction *= linear(kNearestDrop_m, kNearDropFade_m, distance_m);
    if (!far) fraction *= linear(1.0, 1.0 - kVerticalFade, abs(z) / (0.5 * the_pass.boxes.y));
    float number = the_pass.boxes.z, order = float(i) / the_pass.boxes.w;
    if (number < 1.0) fraction *= linear(0.0, kNumberFade, number * (1.0 + kNumberFade) - order);
    return fraction;
}

// Where a particle is in the container: 0 at its point, 1 at the rim.
float within_container(vec2 from) {
    if (the_pass.nearest.z == 0.0) return length(from) / the_pass.boxes.x;
    vec2 ahead = the_pass.axis.zw;
    float across = from.x * ahead.y - from.y * ahead.x;
    return length(vec2(dot(from, ahead) / the_pass.nearest.z, across / the_pass.boxes.x));
}

// Returns the streak of a particle; one without opacity does not show.
Streak streak_of(uint i, RainParticle of) {
    Streak none = Streak(vec4(0.0), 1.0, 0.0, 0.0, vec3(0.0));
    bool snow = the_pass.wind.w != 0.0, far = the_pass.nearest.z != 0.0;
    vec3 from_middle = place_of(of), place = the_pass.centre.xyz + from_middle;
    float d = within_container(place.xy - the_pass.nearest.xy);
    if (d >= of.reach || (the_pass.nearest.w == 0.0 && dot(place.xy, the_pass.axis.xy) < 0.0)) return none;
    vec3 way = place;
    float distance_m = length(way);
    if (dot(way, rain.forward.xyz) < kNearestDrop_m) return none;
    float present = presence(i, of.reach, d, from_middle.z, distance_m, far);
    if (!(present > 0.0)) return none;

    Sway sway = Sway(vec2(0.0), vec2(0.0), 1.0);
    if (snow) sway = sway_of(i, of.diameter_mm);
    place.xy += sway.place;
    float width_m = the_pass.box_low.w * (1.0 + (snow ? kSnowGrowth : kRainGrowth) * d * d) * of.width_m;
    vec3 half_way = 0.5 * the_pass.box_high.z * velocity_of(of, sway, width_m);
    vec3 from = projected(place - half_way, the_pass.opening.xyz, the_pass.opening_right.xyz,
                          the_pass.opening_up.xyz, the_pass.opening_forward.xyz);
    vec3 to = projected(place + half_way, the_pass.closing.xyz, the_pass.closing_right.xyz, the_pass.closing_up.xyz,
                        the_pass.closing_forward.xyz);
    if (!(from.z > 0.0 && to.z > 0.0)) return none;
    float scale = the_pass.wind.z / distance_m, width = max(1.0, width_m * scale);
    if (far) width = min(width, kMostFarPixels);
    vec4 ends = vec4(from.xy, to.xy);
    if (beside_picture(ends, width)) return none;
    float real = real_particles(place, of.diameter_mm);
    if (!(real > 0.0)) return none;
    float shadow = real / drawn_per_m3(d) * of.shadow_m2 * scale * scale * sway.cover;  // pixels
    ends = at_least(ends, snow ? width : 1.0);
    float opacity = present * min(kMostDropOpaque, the_pass.box_high.w * shadow / (width * length(ends.zw - ends.xy)));
    if (opacity < kLeastDropOpaque) return none;
    vec3 ray = way / distance_m;
    float sunlight = the_pass.sunlight.w >= 0.0 ? the_pass.sunlight.w : sunlight_at(the_pass.sunlight.xyz);
    // Drops oscillate and show now more of the sky, now more of the ground.
    float turn = 1.0 + kDropFlicker * (2.0 * fract(kDropFlickers * of.z) - 1.0);
    vec3 light = turn * particle_radiance(ray, place, sun_of_drops(ray), sunlight);
    if (far) opacity *= exp(-rain.air.g * distance_m);
    return Streak(ends, width, opacity, distance_m, light);
}

void main() {
    uint lane = gl_LocalInvocationID.x, segment = rain_group();
    uint first = segment * kStreakSegment, end = min(first + kStreakSegment, rain_step.count), kept = 0u;
    if (first >= rain_step.count) return;
    for (uint begin = first; begin < end; begin += kRainGroup) {
        uint k = begin + lane;
        Streak streak = Streak(vec4(0.0), 1.0, 0.0, 0.0, vec3(0.0));
        if (k < end) {
            uint i = rain_step.first + k;
            streak = streak_of(i, particles[i]);
        }
        bool shows = streak.opacity > 0.0;
        uvec2 chosen = choose(shows);
        if (shows) {
            uint to = 3u * (first + kept + place_among(chosen));
            streaks[to] = streak.ends;
            streaks[to + 1u] = vec4(streak.width, streak.opacity, streak.distance_m, 0.0);
            streaks[to + 2u] = vec4(streak.radiance, 0.0);
        }
        kept += bitCount(chosen.x) + bitCount(chosen.y);
    }
    if (lane == 0u) segment_counts[segment] = kept;
}
