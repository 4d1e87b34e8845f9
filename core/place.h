// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where on Earth, and when, a scene lies: the WGS 84 ellipsoid and Coordinated Universal Time.
//
// The world of a scene is the plane that touches the ellipsoid's normal at its origin: x, y and z are a local tangent
// frame, east-north-up turned by the heading. It is flat: at a distance d from the origin its z = 0 lies d^2 / (2 R)
// above the curved surface, 2 m at 5 km and 31 m at 20 km.

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace nephos {

// What a height is counted from.
enum class HeightDatum {
    msl,        // mean sea level, the geoid
    ellipsoid,  // WGS 84
};

// The place of the world's origin (0, 0, 0), and the moment of simulated time 0.
struct Georeference {
    bool given = false;  // false: the scene lies nowhere; all else is then without meaning
    double latitude_deg = 0, longitude_deg = 0;  // -90..90, north; -180..180, east; geodetic, WGS 84
    double height_m = 0;                         // of the origin above the datum
    HeightDatum height_datum = HeightDatum::msl;
    double geoid_height_m = 0;  // of mean sea level above the ellipsoid there (undulation)
    double heading_deg = 0;     // true bearing of the y axis, clockwise from north, -360..360
    std::string start_utc;      // "2024-06-21T13:50:00Z"; empty: not known
    bool operator==(const Georeference&) const = default;
};

// A 4 x 4 matrix by rows, for column vectors: result = M (x, y, z, 1).
using Matrix4 = std::array<double, 16>;

// Returns the matrix from the world to Earth-centred, Earth-fixed coordinates of WGS 84 (EPSG:4978), in metres. Source:
// NIMA TR8350.2 (2000), section 4. Thread-safe; pure.
Matrix4 ecef_from_world(const Georeference& place);

// Returns the seconds from 1970-01-01T00:00:00Z, leap seconds left out as in POSIX, to a text such as
// "2024-06-21T13:50:00Z", the years 1900 to 2100; nullopt for any other text. Pure.
std::optional<double> utc_seconds(std::string_view text);

// Returns the text of a moment; with milliseconds unless they are 0. Pure.
std::string utc_text(double seconds_since_1970);

// Returns the moment of a simulated time as text; empty when `start_utc` is. Throws Error(usage) when it is no moment.
std::string utc_at(const Georeference& place, double time_s);

}  // namespace nephos
