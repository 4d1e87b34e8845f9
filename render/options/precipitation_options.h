// SPDX-License-Identifier: Apache-2.0
#pragma once

// How rain and snow are drawn (P, S); where they fall is for the rain areas to say (precipitation.h).

#include "core/weather.h"

namespace nephos {

struct PrecipitationOptions {
    bool enabled = false;
    PrecipitationKind kind = PrecipitationKind::rain;
    // Drops or flakes in the container before the eye (P: fixed, 50,000), 0..2,000,000; 0: only the shafts.
    int particles = 50'000;
    // How long a picture is exposed: the length of streaks is speed times this. 0..1 s
    double exposure_s = 1.0 / 60;
    // Opacity of drops and flakes as a multiple of the true one, 0..1000: streaks of real rain hide less than
    // a hundredth of what is behind them, which a picture of few pixels hardly shows.
    double visibility = 3;
    double intensity_scale = 1;  // of the rain of all areas, 0..100
    double wind_drift = 1;       // share of the wind that particles and shafts are carried with, 0..10
    double depth_m = 16;         // depth of the container around the eye, 1..1000
    double margin_m = 1;         // free movement of the eye in it before it is put elsewhere, 0..100
    double reach_m = 600;        // distance of an area beyond which no particle is drawn, > 0..100000
    double edge = 0.4;           // outer share of an area in which the rain falls off to 0, 0..1
    // Rain shafts: extinction as a multiple of the true one, 0..100; 0: none.
    double shafts = 1;
    double shaft_texture = 0.7;  // contrast of their streaks, 0..1
    // Virga: rain thins out on its way and is gone at this share of the way up from the ground to the cloud;
    // 0: it reaches the ground.
    double evaporation = 0;  // 0..1
    bool operator==(const PrecipitationOptions&) const = default;
};

// Throws Error(usage) naming the first value that is out of its range.
void check(const PrecipitationOptions& precipitation);

}  // namespace nephos
