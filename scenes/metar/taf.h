// SPDX-License-Identifier: Apache-2.0
#pragma once

// Aerodrome forecasts (WMO Manual on Codes, FM 51 TAF) as scenes whose weather changes: each period of the forecast is a
// state of the climate, and layers come and go with it. All functions are pure and thread-safe.

#include <string>
#include <string_view>
#include <vector>

#include "scenes/metar/metar.h"
#include "scenes/metar/metar_scene.h"

namespace nephos {

// The weather from one change of the forecast to the next.
struct TafPeriod {
    std::string change;              // "BECMG 2115/2118", "FM211800"; empty: from the beginning
    double from_s = 0, until_s = 0;  // of the change, after the beginning of validity
    Metar weather;                   // all of it: what a change does not name goes on
};

struct Taf {
    std::string text;  // as given, blanks joined
    std::string station;
    int day = 0, hour = 0;           // UTC, at which it becomes valid
    std::string date;                // of that day, "2024-06-21"; empty where the month is not known
    double length_s = 0;             // of the validity
    std::vector<TafPeriod> periods;  // by time, at least one; none begins before that before it has come
    std::vector<std::string> notes;  // what is left out, a sentence each
};

// Scenes have room for so many layers, clouds and what falls together, and so many of them with fine detail.
inline constexpr std::size_t kMostTafLayers = 64, kMostDetailedTafLayers = 16;

// Returns whether a text begins as a forecast does.
bool is_taf(std::string_view text);

// Reads a forecast. `date`: "2024-06", the month in which it was issued, or "2024-06-21", that day or the one on which it becomes
// valid; or empty, when a forecast that goes on into the next month is taken to do so after the last day that it names, which is
// noted. Throws Error(usage) as parse_metar(); on a date that is none or does not fit; and on more than kMostTafLayers layers.
Taf parse_taf(std::string_view text, bool lenient = false, std::string_view date = {});

// A layer of the scene, and the periods in which it is there.
struct TafLayer {
    MetarLayer layer;
    std::vector<bool> present;  // of each period
};

// Returns the layers of all periods from below, each once: a group that goes on is one layer.
std::vector<TafLayer> layers_of(const Taf& taf);

// Returns `count` moments, in seconds after the beginning of validity, evenly over the time in which a layer is wholly there; one
// where that is a moment.
std::vector<double> moments_of(const Taf& taf, const TafLayer& layer, int count);

// Returns the scene as TOML with comments, as metar_scene_text(); `coverage` has that of each of layers_of().
std::string taf_scene_text(const Taf& taf, const MetarSceneOptions& options,
                           const std::vector<double>& coverage);

// Returns what the forecast says that the scene leaves out, a sentence each.
std::vector<std::string> taf_notes(const Taf& taf, const MetarSceneOptions& options);

}  // namespace nephos
