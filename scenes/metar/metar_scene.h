// SPDX-License-Identifier: Apache-2.0
#pragma once

// A scene from a report: a layer for each cloud group with the genus that its amount and height stand for, wind, fog,
// rain or snow, and the sun. Functions are pure and thread-safe.
//
// Names of layers say what densities do not, and reports of a run (simulation/export/weather.h) take them from there:
// "Cb1", "Sc2" are genera; "VV1" is a sky that cannot be seen; a layer of rain is named by what falls, "FZRA", "RASN".
// The depth of the fog tells its kind (FogDepth).

#include <optional>
#include <string>
#include <vector>

#include "scenes/metar/metar.h"

namespace nephos {

struct MetarPlace {
    double latitude_deg = 0, longitude_deg = 0, elevation_m = 0;
};

struct MetarSceneOptions {
    std::string name;  // of the scene; empty: of the aerodrome
    // "2024-06" or "2024-06-21"; the report has day and time. Empty: the sun is not set by a date.
    std::string date;
    std::optional<MetarPlace> place;
    int seed = 1;
};

// Scale heights of what lessens the visibility, m: limits of its kinds, and what a scene gets. Fog and mist are shallow, haze
// fills the mixed layer; between them nothing is reported but what falls.
struct FogDepth {
    static constexpr double fog = 150, mist = 500, mist_limit = 750, other = 1000, haze_limit = 1500,
                            haze = 2000;
};

// A layer of clouds that a group becomes.
struct MetarLayer {
    std::string name;              // "Sc1": genus and number, from below; "VV1" where the sky is obscured
    std::string genus;             // WMO abbreviation; "VV": an obscured sky
    double base_m = 0, top_m = 0;  // above the aerodrome, which is z = 0
    double cover = 0;              // of optical depth above 1, to be met; 1: no gap
    bool sheet = false;            // without gaps: nothing to fit
    std::string group;             // of the report
};

// Returns the layers of a report from below. Groups of unknown amount or height are left out.
std::vector<MetarLayer> layers_of(const Metar& metar);

// Returns the target of an amount: FEW 0.19, SCT 0.44, BKN 0.75, OVC 1.
double cover_of(CloudAmount amount);

// Returns the scene as TOML with comments; `coverage` has the key of that name for each of layers_of(). Throws
// Error(usage) when the date is none, or has no such day.
std::string metar_scene_text(const Metar& metar, const MetarSceneOptions& options,
                             const std::vector<double>& coverage);

// Returns what the report says that the scene leaves out, a sentence each.
std::vector<std::string> metar_notes(const Metar& metar, const MetarSceneOptions& options);

}  // namespace nephos
