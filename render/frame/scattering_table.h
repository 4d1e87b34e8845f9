// SPDX-License-Identifier: Apache-2.0
#pragma once

// The sunlight that a metaball scatters, as a table over the scattering angle and the optical depth towards
// the sun: all phase functions and approximations of multiple scattering cost one look-up, and no shader
// branches on them. Private to the module.
//
// Rows of shader::kScatterAngles floats. Row 0 is pi times the phase function: single scattering, to be
// multiplied by exp(-depth). Row 1 + i is multiple scattering at the depth of node i. The last row is that of light that
// was scattered forwards a few times: pi times the phase function with its asymmetry g times g, by
// shader::forward_light(), and what of it soon turns back, by shader::turned_back(). With CloudLight::bows three rows
// follow, of red, green and blue, which take the place of row 0. All are radiance under a sun of colour 1, that is per
// irradiance pi. Nodes are where shader::scatter_column() and
// shader::scatter_row() are integers: dense where cos(theta) is near 1 or -1, and at small depths. Values are
// interpolated linearly; largest error 0.3 % of the value at depth 0 (test `ScatteringTable`), and 2 % on the
// flank of the aureole of the largest droplets, a tenth of a degree wide, and of asymmetries beyond 0.96.

#include <cstddef>
#include <vector>

#include "render/options/options.h"
#include "render/shared/shared.h"

namespace nephos {

std::vector<float> scattering_table(const CloudLight& light);

// The first of the rows by colours, in numbers of rows.
inline constexpr std::size_t kRowsBeforeColours = 2 + shader::kScatterDepths;

// Interpolate the table, for tests: single scattering per transmittance, and multiple scattering.
float scattered_once(const std::vector<float>& table, float cos_theta);
float scattered_often(const std::vector<float>& table, float cos_theta, float depth);

// Optical depths towards the sun of light that is scattered once, and of the row of the table for light scattered often.
struct SunDepths {
    float once = 0, often = 0;
};

// Returns both in the bits of shader::ViewBall::sun_depth, as halfs: within 0.05 %. Precondition: neither is negative.
float two_depths(const SunDepths& depths);
// Returns what a shader::ViewBall::sun_depth stands for.
SunDepths depths_of(float sun_depth);

// Converts transmittances to optical depths in place, clamped to shader::kMaxSunDepth so that shaders meet no
// infinity.
void to_sun_depths(std::vector<float>& light);

}  // namespace nephos
