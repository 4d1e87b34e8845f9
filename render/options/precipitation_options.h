// SPDX-License-Identifier: Apache-2.0
#pragma once

// Options of the rendering of rain and snow (P, S); the rain areas determine where they fall
// (precipitation.h).

#include "core/weather.h"

namespace nephos {

struct PrecipitationOptions {
    bool enabled = false;
    PrecipitationKind kind = PrecipitationKind::rain;
    // Number of drops or flakes in the container around the camera (P: fixed, 50,000), 0..2,000,000; 0: only
    // the shafts.
    int particles = 50'000;
    // Exposure time, 0..1 s: the length of streaks is speed times this.
    double exposure_s = 1.0 / 60;
    // Factor of the physical opacity of drops and flakes, 0..1000: streaks of real rain have an opacity of
    // less than a hundredth, which is hardly visible in images of few pixels.
    double visibility = 3;
    double intensity_scale = 1;  // factor of the rain of all areas, 0..100
    double wind_drift = 1;       // factor of the wind that displaces particles and shafts, 0..10
    double depth_m = 16;         // depth of the container around the eye, 1..1000
    double margin_m = 1;         // distance that the eye may move before the container follows, 0..100
    double reach_m = 600;        // distance of an area beyond which no particle is drawn, > 0..100000
    double edge = 0.4;           // outer fraction of an area over which the rain decreases to 0, 0..1
    // Factor of the physical extinction of rain shafts, 0..100; 0: no shafts.
    double shafts = 1;
    double shaft_texture = 0.7;  // contrast of their streaks, 0..1
    // Virga: rain evaporates as it falls, completely at this fraction of the height from ground to cloud; 0:
    // all of it reaches the ground.
    double evaporation = 0;  // 0..1
    // Factor of the number of splashes of drops on ground and water within 30 m of the eye, 0..10; 1 is physical,
    // 0: none (splashes.h).
    double splashes = 0;
    bool operator==(const PrecipitationOptions&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const PrecipitationOptions& precipitation);

}  // namespace nephos
