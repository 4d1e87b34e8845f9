// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/rain.h"
// Blends streaks into the picture in their order, by its depth and transmittance (render/image/overlay.h): a work group
// has a tile of kRainTile x kRainTile pixels and takes those of its band's streaks that touch it.
#include "render/vulkan/rain.glsl"
#include "render/vulkan/rain_pixels.glsl"
#include "render/vulkan/rain_order.glsl"

layout(local_size_x = kRainGroup) in;
layout(set = 0, binding = 10, std430) readonly buffer Streaks {
    vec4 streaks[];
};
layout(set = 0, binding = 12, std430) readonly buffer BandCounts {
    uint band_counts[];
};
layout(set = 0, binding = 13, std430) readonly buffer BandLists {
    uint band_lists[];
};

// How much of a pixel a thin streak covers: along its longer axis, the first of each vector.
float thin_cover(vec2 from, vec2 to, float width, vec2 pixel) {
    if (from.x > to.x) {
        vec2 other = from;
        from = to;
        to = other;
    }
    float span = to.x - from.x, slope = (to.y - from.y) / max(span, 1.0e-6);
    float half_width = 0.5 * width * sqrt(1.0 + slope * slope), at = pixel.x - from.x;
    float middle = from.y + clamp(at, 0.0, span) * slope;
    return clamp(min(at, span - at) + 0.5, 0.0, 1.0) * clamp(half_width + 0.5 - abs(pixel.y - middle), 0.0, 1.0);
}

// By the distance from its axis, with round ends; the wider, the softer its edge.
float wide_cover(vec4 ends, float width, vec2 pixel) {
    vec2 way = ends.zw - ends.xy;
    float span = length(way), half_width = 0.5 * width, cut = min(half_width, 0.5 * span) / max(span, 1.0e-6);
    vec2 axis = (1.0 - 2.0 * cut) * way, from = pixel - (ends.xy + cut * way);
    float squared = dot(axis, axis), soft = max(1.0, 0.6 * width);
    float t = squared > 0.0 ? clamp(dot(from, axis) / squared, 0.0, 1.0) : 0.0;
    return clamp((half_width + 0.5 * soft - length(from - t * axis)) / soft, 0.0, 1.0);
}

float cover_of(vec4 ends, float width, vec2 pixel) {
    if (width > kWideStreak) return wide_cover(ends, width, pixel);
    vec2 way = abs(ends.zw - ends.xy);
    return way.y >= way.x ? thin_cover(ends.yx, ends.wz, width, pixel.yx) : thin_cover(ends.xy, ends.zw, width, pixel);
}

void main() {
    uint lane = gl_LocalInvocationID.x, tile = rain_group();
    if (tile >= rain_step.tiles) return;
    uvec2 corner = tile_pixel(tile, 0u), pixel = tile_pixel(tile, lane), origin = uvec2(rain_step.x, rain_step.y);
    uint band = corner.y / kStreakBandRows, count = band_counts[band];
    if (count == 0u) return;
    bool inside = pixel.x < rain_step.width && pixel.y < rain_step.height;
    vec2 low = vec2(corner + origin), high = low + float(kRainTile), middle = vec2(pixel + origin) + 0.5;
    uint at = pixel.y * rain_step.width + pixel.x;
    vec4 colour = inside ? pixels[at] : vec4(0.0);
    float cloud_m = inside ? cloud_distance(at, colour.a) : 0.0;
    for (uint begin = 0u; begin < count; begin += kRainGroup) {
        uint streak = 0u;
        bool touches = false;
        if (begin + lane < count) {
            streak = band_lists[band * kParticlesAtOnce + begin + lane];
            vec4 ends = streaks[3u * streak];
            float reach = streaks[3u * streak + 1u].x + 1.0;
            touches = all(greaterThan(max(ends.xy, ends.zw) + reach, low)) &&
                      all(lessThan(min(ends.xy, ends.zw) - reach, high));
        }
        uvec2 chosen = choose(touches);
        for (uint word = 0u; word < 2u; ++word) {
            for (uint left = chosen[word]; left != 0u; left &= left - 1u) {
                uint next = 3u * band_lists[band * kParticlesAtOnce + begin + 32u * word + uint(findLSB(left))];
                vec4 how = streaks[next + 1u];
                float seen = how.z <= cloud_m ? 1.0 : colour.a;
                float fraction = how.y * cover_of(streaks[next], how.x, middle) * seen;
                colour.rgb += fraction * (streaks[next + 2u].rgb - colour.rgb);
            }
        }
    }
    if (inside) pixels[at] = colour;
}
