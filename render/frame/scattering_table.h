// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a metaball scatters of the sunlight, as a table over the angle and the optical depth towards the sun:
// all phase functions and all kinds of multiple scattering cost one look-up, and no shader branches on them.
// Private to the module.
//
// Rows of shader::kScatterAngles floats. Row 0 is pi times the phase function: the light that was scattered
// once, to be multiplied by exp(-depth). Row 1 + i is the light that was scattered more often at the depth of
// node i. Both are radiance under a sun of colour 1, that is per irradiance pi. Nodes lie where
// shader::scatter_column() and shader::scatter_row() are integers: dense where cos(theta) is near 1 or -1,
// and at small depths. Between nodes values are mixed linearly; largest error 0.3 % of the value at depth 0
// (test `ScatteringTable`), and 2 % on the flank of the aureole of the largest droplets, a tenth of a degree
// wide, and of asymmetries beyond 0.96.

#include <vector>

#include "render/options/options.h"

namespace nephos {

std::vector<float> scattering_table(const CloudLight& light);

// As found between the nodes, for tests: light scattered once per transmittance, and more often.
float scattered_once(const std::vector<float>& table, float cos_theta);
float scattered_often(const std::vector<float>& table, float cos_theta, float depth);

// Optical depths as shaders want them, from the shares of light that arrive, in place; at most
// shader::kMaxSunDepth, so that no shader meets an infinity.
void to_sun_depths(std::vector<float>& light);

}  // namespace nephos
