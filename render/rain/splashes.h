// SPDX-License-Identifier: Apache-2.0
#pragma once

// Splashes of drops on ground and water near the eye: a crown that opens and falls back, and droplets that it throws.
//
// Drops of more than kThrowing_mm throw crowns (smaller ones wet the ground without). Their flux is the integral of the size
// distribution times the speed of fall (drop_sizes.h),
//
//     flux = integral over D > kThrowing_mm of N(D) speed(D) dD      per m^2 and s
//
// The ground is divided into square slots, in three levels of twice the size each, around the eye out to kSplashReach_m. In
// each slot a drop falls once a period or not: its chance is flux * area * period, its place and its time are hashes of the
// slot, the number of the period and the seed. So a splash is a function of seed and time alone, as the drops are, and frames
// may be drawn in any order. Where the flux is larger than one a period and slot, each splash stands for several and is
// more opaque.
//
// A droplet flies on a parabola from the rim of the crown, r and z after t seconds:
//
//     r = v cos(a) t,    z = v sin(a) t - g t^2 / 2,    a of 50 to 75 degrees, v of 0.7 to 1.3 m/s
//
// and is drawn as a streak over the exposure, 2.5 times as wide as it is, as drops are drawn larger, too. A splash is lit as
// drops are, in the shade of the cloud that it rained from. On relief it lies at the height of the ground, and droplets land on
// its slope; where that is steeper than kSteepestSplash there are none: water runs down a wall. Private to the module.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/image/overlay.h"
#include "render/rain/drop_sizes.h"
#include "render/rain/rain_frame.h"

namespace nephos {

inline constexpr double kThrowing_mm = 2;       // diameter of the smallest drop that throws a crown
inline constexpr double kSplashReach_m = 30;    // along the ground
inline constexpr double kSplashPeriod_s = 0.3;  // of a slot: longer than a splash lasts
inline constexpr double kSteepestSplash = 1.5;  // rise over run, 56 degrees

// Returns the drops of more than kThrowing_mm that fall on the ground, per m^2 and s.
double throwing_drops(const SizeLaw& law);

// One splash: where on the ground its drop fell (world), how long ago, how many it stands for, and the numbers 0..1 it
// was drawn with.
struct Splash {
    double x_m = 0, y_m = 0;
    GroundSurface ground{};
    double age_s = 0;
    double weight = 1;  // > 0: below 1 it fades with the distance, above 1 it stands for several
    double turn = 0, strength = 0;
};

// Returns the splashes of a frame, in the order of their slots. None of snow, on ground that is not level where
// Weather::relief does not say how it lies, or from more than 40 m above the ground.
std::vector<Splash> splashes_at(const RainFrame& frame, const Weather& weather);

// Returns their streaks inside the picture, in that order.
std::vector<Streak> streaks_of_splashes(const RainFrame& frame, const std::vector<Splash>& splashes);

}  // namespace nephos
