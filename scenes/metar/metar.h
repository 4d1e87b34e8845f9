// SPDX-License-Identifier: Apache-2.0
#pragma once

// METAR and SPECI reports (WMO Manual on Codes, FM 15 and FM 16) with what real reports contain: gaps, groups without
// unit, unknown parts written as slashes. All functions are pure and thread-safe.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace nephos {

inline constexpr double kKnot = 1852.0 / 3600;  // metres a second
inline constexpr double kFoot = 0.3048;         // metres

enum class CloudAmount { few, scattered, broken, overcast, obscured, unknown };  // obscured: VV

struct MetarCloud {
    CloudAmount amount = CloudAmount::unknown;
    std::optional<int> height_ft;  // above the aerodrome; of VV the vertical visibility
    std::string type;              // "CB", "TCU" or ""
};

struct MetarWeather {
    char intensity = 0;                  // '-', '+' or 0: moderate
    bool vicinity = false;               // VC: not at the aerodrome
    std::string descriptor;              // "SH", "TS", "FZ", "BL", "DR", "MI", "BC", "PR" or ""
    std::vector<std::string> phenomena;  // "RA", "SN", "FG" ...; may be empty beside TS and VCSH
};

struct MetarWind {
    bool known = false;
    bool variable = false;  // VRB, or no direction
    int from_deg = 0;
    double speed_m_per_s = 0;
    std::optional<double> gust_m_per_s;
    std::optional<int> from_between_deg, to_between_deg;  // dddVddd
};

// A group of the report and what it says.
struct MetarGroup {
    std::string text;
    std::size_t column = 0;  // of its first character, from 0
    std::string meaning;
    bool used = true;  // false: it changes nothing in a scene
};

struct Metar {
    std::string text;  // as given, blanks joined
    std::string station;
    int day = 0, hour = 0, minute = 0;  // UTC
    bool automatic = false;
    MetarWind wind;
    bool cavok = false;
    std::optional<int> visibility_m;  // 9999: 10 km or more
    std::vector<MetarWeather> weather;
    std::vector<MetarCloud> clouds;
    std::optional<int> temperature_c, dew_point_c;
    std::optional<double> pressure_hpa;
    std::vector<MetarGroup> groups;
    std::vector<std::string> warnings;  // of a lenient reading
};

// Reads a report. Throws Error(usage) with the report, a caret under the first group that is wrong, and what was
// expected; `lenient` turns a group that cannot be read into a warning. A report that contradicts itself (CAVOK with
// clouds, two winds, NIL) is an error in both cases.
Metar parse_metar(std::string_view text, bool lenient = false);

// Returns true of a report that ends behind its time, but for remarks and a trend.
bool tells_nothing(const Metar& metar);

// Returns the report of these values: station, time, wind, visibility, weather, clouds.
std::string metar_text(const Metar& metar);

// Returns true for what falls as reports write it, without intensity, SH and TS: "RA", "FZDZ", "RASN" ...
bool is_precipitation(std::string_view code);

// The amount of a cover 0..1 of optical depth above 1: FEW up to 2 oktas, SCT 4, BKN 7, OVC 8; nullopt below half an
// okta.
std::optional<CloudAmount> amount_of(double cover);
std::string_view amount_text(CloudAmount amount);

}  // namespace nephos
