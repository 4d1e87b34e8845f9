// SPDX-License-Identifier: Apache-2.0
#include "core/place.h"

#include <chrono>
#include <cmath>
#include <cstdio>

#include "core/error.h"
#include "core/math.h"

namespace nephos {
namespace {

constexpr double kSemiMajor_m = 6378137.0, kFlattening = 1 / 298.257223563;

// Exactly `count` decimal digits from `at` on.
std::optional<int> digits(std::string_view text, std::size_t at, std::size_t count) {
    int value = 0;
    for (std::size_t n = at; n < at + count; ++n) {
        if (text[n] < '0' || text[n] > '9') return {};
        value = 10 * value + (text[n] - '0');
    }
    return value;
}

}  // namespace

Matrix4 ecef_from_world(const Georeference& place) {
    // Not by the system's sine: the bytes of VDB files hold this matrix.
    const auto [cos_lat, sin_lat] = rotation_of_degrees(place.latitude_deg);
    const auto [cos_lon, sin_lon] = rotation_of_degrees(place.longitude_deg);
    const double e2 = kFlattening * (2 - kFlattening);
    const double n = kSemiMajor_m / std::sqrt(1 - e2 * sin_lat * sin_lat);  // radius in the prime vertical
    const double h = place.height_m + (place.height_datum == HeightDatum::msl ? place.geoid_height_m : 0.0);
    const double east[3] = {-sin_lon, cos_lon, 0};
    const double north[3] = {-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat};
    const double up[3] = {cos_lat * cos_lon, cos_lat * sin_lon, sin_lat};
    const double origin[3] = {(n + h) * cos_lat * cos_lon, (n + h) * cos_lat * sin_lon,
                              (n * (1 - e2) + h) * sin_lat};
    const auto [cos_heading, sin_heading] = rotation_of_degrees(place.heading_deg);
    Matrix4 m{};
    for (std::size_t row = 0; row < 3; ++row) {
        m[4 * row] = cos_heading * east[row] - sin_heading * north[row];
        m[4 * row + 1] = sin_heading * east[row] + cos_heading * north[row];
        m[4 * row + 2] = up[row];
        m[4 * row + 3] = origin[row];
    }
    m[15] = 1;
    return m;
}

std::optional<double> utc_seconds(std::string_view text) {
    using namespace std::chrono;
    if (text.size() != 20 || text[4] != '-' || text[7] != '-' || text[10] != 'T' || text[13] != ':' ||
        text[16] != ':' || text[19] != 'Z')
        return {};
    const auto y = digits(text, 0, 4), m = digits(text, 5, 2), d = digits(text, 8, 2);
    const auto hour = digits(text, 11, 2), minute = digits(text, 14, 2), second = digits(text, 17, 2);
    if (!y || !m || !d || !hour || !minute || !second) return {};
    const year_month_day day{year(*y), month(unsigned(*m)), std::chrono::day(unsigned(*d))};
    if (!day.ok() || *y < 1900 || *y > 2100 || *hour > 23 || *minute > 59 || *second > 59) return {};
    return 86400.0 * double(sys_days(day).time_since_epoch().count()) + 3600.0 * *hour + 60.0 * *minute +
           *second;
}

std::string utc_text(double seconds_since_1970) {
    using namespace std::chrono;
    const auto all = milliseconds(std::llround(seconds_since_1970 * 1000));
    const auto day = floor<days>(sys_time<milliseconds>(all));
    const year_month_day date(day);
    const auto in_day = (sys_time<milliseconds>(all) - day).count();
    char text[64];
    std::snprintf(text, sizeof text, "%04d-%02u-%02uT%02d:%02d:%02d", int(date.year()),
                  unsigned(date.month()), unsigned(date.day()), int(in_day / 3600000),
                  int(in_day / 60000 % 60), int(in_day / 1000 % 60));
    std::string out = text;
    if (in_day % 1000 != 0) {
        std::snprintf(text, sizeof text, ".%03d", int(in_day % 1000));
        out += text;
    }
    return out + "Z";
}

std::string utc_at(const Georeference& place, double time_s) {
    if (!place.given || place.start_utc.empty()) return {};
    const std::optional<double> start = utc_seconds(place.start_utc);
    if (!start)
        throw Error(ErrorCode::usage, "'" + place.start_utc + "' is no moment such as 2024-06-21T13:50:00Z");
    return utc_text(*start + time_s);
}

}  // namespace nephos
