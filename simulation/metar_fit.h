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
    double cover = 0;  // optical: of the first frame, or a forecast's mean over the time in which it is there
    double least_cover = 0, most_cover = 0;  // of the moments of that mean
    int tries = 0;                           // coverages that were measured
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

// The same for a forecast: the cover of a layer is met within two tenths of an okta on average over `kTafMoments` moments of the
// time in which it is there, as clouds that drift through the scene's box make it now more, now less. It is chosen over the
// first few of them and then corrected.
inline constexpr int kFirstTafMoments = 6, kTafMoments = 48;
FittedScene fit_taf(const Taf& taf, const MetarSceneOptions& options);

}  // namespace nephos
