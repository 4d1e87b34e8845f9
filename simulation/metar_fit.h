// SPDX-License-Identifier: Apache-2.0
#pragma once

// A scene whose clouds have the cover that a METAR reports.

#include <string>
#include <vector>

#include "scenes/metar/metar_scene.h"
#include "scenes/metar/taf.h"

namespace nephos {

struct FittedLayer {
    MetarLayer layer;
    double coverage = 1;  // the key that was chosen
    double cover = 0;     // optical, in the first frame
    int tries = 0;
};

struct FittedScene {
    std::string text;  // TOML
    std::vector<FittedLayer> layers;
    std::vector<std::string> notes;
};

// Chooses the coverage of each layer by bisection over its density at the first frame, until its optical cover is
// within a tenth of an okta of what is wanted or after `kMostTries`: the same report and seed give the same scene.
// Throws Error(usage) as metar_scene_text().
inline constexpr int kMostTries = 10;
FittedScene fit_metar(const Metar& metar, const MetarSceneOptions& options);

// The same for a forecast: each layer has the coverage that it gets in the report of the first period that has it. The sky
// of a period is met as that of a report is; between periods layers come and go (LayerOptions::presence).
FittedScene fit_taf(const Taf& taf, const MetarSceneOptions& options);

}  // namespace nephos
