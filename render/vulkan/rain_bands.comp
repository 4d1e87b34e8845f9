// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/rain.h"
// Lists of the streaks that touch each band of rows, in their order; a work group has a band.
#include "render/vulkan/rain.glsl"
#include "render/vulkan/rain_order.glsl"

layout(local_size_x = kRainGroup) in;
layout(set = 0, binding = 10, std430) readonly buffer Streaks {
    vec4 streaks[];
};
layout(set = 0, binding = 11, std430) readonly buffer SegmentCounts {
    uint segment_counts[];
};
layout(set = 0, binding = 12, std430) writeonly buffer BandCounts {
    uint band_counts[];
};
layout(set = 0, binding = 13, std430) writeonly buffer BandLists {
    uint band_lists[];  // kParticlesAtOnce of each band
};

void main() {
    uint lane = gl_LocalInvocationID.x, band = rain_group(), kept = 0u;
    if (band >= rain_step.bands) return;
    float top = float(rain_step.y + band * kStreakBandRows), bottom = top + float(kStreakBandRows);
    uint segments = (rain_step.count + kStreakSegment - 1u) / kStreakSegment;
    for (uint segment = 0u; segment < segments; ++segment) {
        uint count = segment_counts[segment];
        for (uint begin = 0u; begin < count; begin += kRainGroup) {
            uint streak = segment * kStreakSegment + begin + lane;
            bool touches = false;
            if (begin + lane < count) {
                vec2 rows = streaks[3u * streak].yw;
                float reach = streaks[3u * streak + 1u].x + 1.0;
                touches = max(rows.x, rows.y) + reach > top && min(rows.x, rows.y) - reach < bottom;
            }
            uvec2 chosen = choose(touches);
            if (touches) band_lists[band * kParticlesAtOnce + kept + place_among(chosen)] = streak;
            kept += bitCount(chosen.x) + bitCount(chosen.y);
        }
    }
    if (lane == 0u) band_counts[band] = kept;
}
