// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain shafts, rain seen from afar: a participating medium in the elliptic cylinders of the rain areas
// between cloud and ground, which lean with the wind. Private to the module.
//
// With r the distance from a curtain's axis in its semi-axes (1: the perimeter), h the height between ground
// (0) and cloud (1), s the strands of its texture and f its denser, falling parts, both noise 0..1, and
// c = shaft_texture, the extinction is that of uniform rain times
//
//     min(1, (1 - h) / kShaftTopFade)  left_of_rain(h)  smooth((1 - r - kShaftFray c s r) / softness)
//     exp(c (4.5 (s - 1/2) + 1.5 (f - 1/2)) - c^2 / 4)
//
// where the first factor is w min(1, (1 - H) / kShaftCloudFade) below a cloud that is known (RainCurtain::cloud): w is its
// water and H the height between ground and base, both of the column from which the drops at that place fell; rain is left by H there;
// with smooth(x) = 3 x^2 - 2 x^3 in 0..1 and softness = `edge`, at least kShaftSoftest unless 0: the outline
// is frayed inwards by the strands. Where curtains overlap, the densest counts. Noise N is bilinear between
// random bytes on a lattice, with weights smooth(). In cells of grain_m, from the area's centre along the
// lean,
//
//     s = 0.6 N(x + o, y) + 0.4 N(4 x, 4 y + o),    o = id mod kShaftsOwn
//     f = N(x + y, (height + kShaftFall time) / kShaftFallCell + o)
//
// A curtain shades itself: at a place in it the sun has exp(-depth) of its light, with half of the optical depth of the ray to
// the sun in the same curtain; what drops diffract arrives. There the rain is the mean of its texture and of its cloud's water, at all heights the same, and
// across the axis a polynomial that has the mean of smooth((1 - r) / softness) over the ellipse (sun_profile()),
//
//     1 - w + w (1 - r^2)^2,    w = softness (1.5 - 0.45 softness), at most 1.
//
// Along the ray, m metres towards the sun, r^2 is a parabola c + 2 b m + a m^2, so that the integral has a closed form. It ends
// where the ray leaves the ellipse or the height of the cloud. Of curtains that overlap at the place the deepest counts.
//
// Each interval of a ray in curtains that touch or overlap is marched in kShaftSteps equal steps, or in as
// many each before and behind a cloud inside it, with an offset of a quarter to three quarters of a step that
// hides banding (tests/render/reference_shafts.h is the scalar form for one ray). Parts behind a cloud with a
// transmittance below kShaftLeastSeen are omitted.

#include <cstdint>
#include <span>
#include <vector>

#include "render/image/picture.h"
#include "render/options/options.h"
#include "render/rain/precipitation_light.h"
#include "render/rain/rain_container.h"
#include "render/shared/rain.h"

namespace nephos {

using shader::kShaftCloudFade, shader::kShaftLeastSeen, shader::kShaftNoiseBits, shader::kShaftNoiseSide,
    shader::kShaftSteps, shader::kShaftStepsPerLight, shader::kShaftTopFade;
inline constexpr double kShaftSoftest = 0.6;     // least softness of a curtain with an edge
inline constexpr double kShaftFray = 0.4;        // fraction of the radius by which its outline varies
inline constexpr double kShaftFall_m_per_s = 6;  // of the texture
inline constexpr float kShaftFallCell_m = 700;   // height of the denser falls
inline constexpr std::uint64_t kShaftsOwn = 61;  // number of curtains with different textures

// Returns the extinction per metre of rain of a rate, seen from afar: twice the geometric cross-section.
double rain_extinction_per_m(PrecipitationKind kind, double rate_mm_per_h);

// Returns the fraction of the rain that has not evaporated at a height between ground (0) and cloud (1).
double left_of_rain(double height, double evaporation);

// Returns the weight w of the profile of rain on the way of sunlight, for a softness of 0..1.
double sun_profile(double softness);
// Returns the mean of the water above a curtain's ellipse, 0..1: of its rain in its rate.
double mean_water(const RainCurtain& curtain);

// Returns the width of a curtain's strands, metres.
double shaft_grain_m(const RainCurtain& curtain);
// Returns the lattice of the noise, kShaftNoiseSide^2 values, x fastest, periodic.
std::vector<std::uint8_t> shaft_noise(std::uint64_t seed);

// Composites the curtains over the picture by ray marching, before or behind the picture's clouds by
// distance. `camera` is the camera at the time. SIMD, rows in parallel; the same bits for any number of
// threads.
void draw_shafts(Picture& picture, const RenderOptions& options, const CameraFrame& camera,
                 std::span<const RainCurtain> curtains, const PrecipitationLight& light, double time_s,
                 std::uint64_t seed);

}  // namespace nephos
