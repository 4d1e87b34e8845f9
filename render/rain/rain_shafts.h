// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain seen from afar: curtains between cloud and ground, as a medium in the elliptic cylinders of the rain
// areas, which lean with the wind. Private to the module.
//
// With r the distance from a curtain's axis in its semi-axes (1: the perimeter), h the height between ground
// (0) and cloud (1), s the strands of its texture and f the denser falls on their way down, both noise 0..1,
// and c = shaft_texture, the extinction is that of even rain times
//
//     min(1, (1 - h) / kShaftTopFade)  left_of_rain(h)  smooth((1 - r - kShaftFray c s r) / softness)
//     exp(c (4.5 (s - 1/2) + 1.5 (f - 1/2)) - c^2 / 4)
//
// with smooth(x) = 3 x^2 - 2 x^3 in 0..1 and a softness of `edge`, at least kShaftSoftest unless 0: what is
// left of the outline frays with the strands, inwards. Where curtains overlap, the densest counts. Noise is
// bilinear between random bytes on a lattice, with blended shares smooth(); in cells of grain_m, counted from
// the area's centre along the lean, s is 0.6 of it at (x + o, y) and 0.4 at (4 x, 4 y + o), f is it at (x +
// y, (height + kShaftFall time) / kShaftFallCell + o), o = id mod kShaftsOwn.
//
// A ray goes in kShaftSteps even steps through every stretch of curtains that touch or overlap, and in as
// many each before and behind a cloud that stands in it, displaced by a quarter to three quarters of a step
// so that no steps show (tests/render/reference_shafts.h has all of it for one ray, without vectors). What is
// behind a cloud that lets less than kShaftLeastSeen through is left out.

#include <cstdint>
#include <span>
#include <vector>

#include "render/image/picture.h"
#include "render/options/options.h"
#include "render/rain/precipitation_light.h"
#include "render/rain/rain_container.h"

namespace nephos {

inline constexpr int kShaftSteps = 12;
inline constexpr float kShaftLeastSeen = 1.0f / 4096;
inline constexpr int kShaftStepsPerLight =
    3;  // three steps have light and falls (f) of the one in their middle
inline constexpr float kShaftTopFade = 0.15f;    // share of the height over which a curtain begins
inline constexpr double kShaftSoftest = 0.6;     // least edge of a curtain that has one: seen from afar
inline constexpr double kShaftFray = 0.4;        // share of the radius by which its outline varies
inline constexpr double kShaftFall_m_per_s = 6;  // of the texture
inline constexpr float kShaftFallCell_m = 700;   // height of the denser falls
inline constexpr std::uint64_t kShaftsOwn = 61;  // curtains with a texture of their own
inline constexpr int kShaftNoiseBits = 7, kShaftNoiseSide = 1 << kShaftNoiseBits;

// Extinction per metre of rain of a rate as seen from afar: twice its geometric shadow.
double rain_extinction_per_m(PrecipitationKind kind, double rate_mm_per_h);

// The share of the rain that is left at a height between ground (0) and cloud (1).
double left_of_rain(double height, double evaporation);

// Width of a curtain's strands.
double shaft_grain_m(const RainCurtain& curtain);
// By how much of a step a pixel's steps are displaced, 0.25..0.75: interleaved gradient noise (Jimenez 2014),
// frac(53 frac(0.06711056 x + 0.00583715 y)), in whole numbers.
inline constexpr std::uint32_t kShaftOffset[3] = {288'237'660, 25'070'368, 13'564};
inline double shaft_offset(std::uint32_t x, std::uint32_t y) {
    const std::uint32_t sum = x * kShaftOffset[0] + y * kShaftOffset[1];
    return 0.25 + 0.5 * double((sum >> 8) * kShaftOffset[2] >> 8) / (1 << 24);
}
// The lattice of the noise, kShaftNoiseSide^2, x fastest; it repeats.
std::vector<std::uint8_t> shaft_noise(std::uint64_t seed);

// Draws the curtains over the picture, each by its distance before or behind the picture's clouds, along
// every pixel's ray by steps. `camera` is the camera at the time. In vectors, rows in parallel; the same bits
// for any number of threads.
void draw_shafts(Picture& picture, const RenderOptions& options, const CameraFrame& camera,
                 std::span<const RainCurtain> curtains, const PrecipitationLight& light, double time_s,
                 std::uint64_t seed);

}  // namespace nephos
