// SPDX-License-Identifier: Apache-2.0
#pragma once

// The position of the sun in the sky for a place and time, within 0.01 degrees (without refraction) from 1950
// to 2050: J. J. Michalsky, "The Astronomical Almanac's algorithm for approximate solar position
// (1950-2050)", Solar Energy 40, 1988.

#include <chrono>
#include <optional>
#include <string_view>

namespace nephos {

namespace sun_text {

// Parses exactly `count` decimal digits; nullopt for any other text.
inline std::optional<int> digits(std::string_view text, std::size_t count) {
    if (text.size() != count) return {};
    int value = 0;
    for (const char c : text) {
        if (c < '0' || c > '9') return {};
        value = 10 * value + (c - '0');
    }
    return value;
}

inline std::optional<double> day_fraction(std::string_view time) {
    if (time.size() != 5 && time.size() != 8) return {};
    const auto hour = digits(time.substr(0, 2), 2), minute = digits(time.substr(3, 2), 2),
               second = time.size() == 8 ? digits(time.substr(6), 2) : std::optional(0);
    const bool marks = time[2] == ':' && (time.size() == 5 || time[5] == ':');
    if (!marks || !hour || !minute || !second || *hour > 23 || *minute > 59 || *second > 59) return {};
    return (*hour + (*minute + *second / 60.0) / 60.0) / 24.0;
}

}  // namespace sun_text

// Parses a date "2026-06-21" (years 1900..2100) and a universal time "18:30" or "18:30:15". Returns days
// since 2000-01-01 12:00 (Julian date - 2451545), or nullopt for any other text. Pure.
inline std::optional<double> days_since_2000(std::string_view date, std::string_view time) {
    using namespace std::chrono;
    using namespace sun_text;
    if (date.size() != 10 || date[4] != '-' || date[7] != '-') return {};
    const auto y = digits(date.substr(0, 4), 4), m = digits(date.substr(5, 2), 2),
               d = digits(date.substr(8), 2);
    const std::optional<double> fraction = day_fraction(time);
    if (!y || !m || !d || !fraction || *y < 1900 || *y > 2100) return {};
    const year_month_day day{year(*y), month(unsigned(*m)), std::chrono::day(unsigned(*d))};
    if (!day.ok()) return {};
    const auto days = sys_days(day) - sys_days(year(2000) / 1 / 1);
    return double(days.count()) + *fraction - 0.5;
}

struct SunPosition {
    double elevation_deg = 0;  // of the disc's centre above the horizon, without refraction
    double azimuth_deg = 0;    // clockwise from north, 0..360
};

// Returns the position at a latitude of -90..90 (north positive) and a longitude of -180..180 (east
// positive). Pure.
SunPosition sun_position(double days_since_2000, double latitude_deg, double longitude_deg);

}  // namespace nephos
