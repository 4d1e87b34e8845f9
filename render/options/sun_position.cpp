// SPDX-License-Identifier: Apache-2.0
#include "render/options/sun_position.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace nephos {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

// Into 0..360.
double turned(double degrees) { return degrees - 360 * std::floor(degrees / 360); }

}  // namespace

SunPosition sun_position(double days, double latitude_deg, double longitude_deg) {
    // Ecliptic coordinates of the sun, then right ascension and declination.
    const double anomaly = kRadians * turned(357.528 + 0.9856003 * days);
    const double longitude = kRadians * turned(280.460 + 0.9856474 * days + 1.915 * std::sin(anomaly) +
                                               0.020 * std::sin(2 * anomaly));
    const double obliquity = kRadians * (23.439 - 4.0e-7 * days);
    const double ascension = std::atan2(std::cos(obliquity) * std::sin(longitude), std::cos(longitude));
    const double declination = std::asin(std::sin(obliquity) * std::sin(longitude));
    // Greenwich mean sidereal time: the part per day is a turn more than the sun's.
    const double sidereal = kRadians * turned(280.46062 + 360.98564737 * days);
    const double hour_angle = sidereal + kRadians * longitude_deg - ascension;
    const double latitude = kRadians * latitude_deg;
    const double up = std::sin(declination) * std::sin(latitude) +
                      std::cos(declination) * std::cos(latitude) * std::cos(hour_angle);
    const double east = -std::cos(declination) * std::sin(hour_angle);
    const double north = std::sin(declination) * std::cos(latitude) -
                         std::cos(declination) * std::sin(latitude) * std::cos(hour_angle);
    return {std::asin(std::clamp(up, -1.0, 1.0)) / kRadians, turned(std::atan2(east, north) / kRadians)};
}

}  // namespace nephos
