// SPDX-License-Identifier: Apache-2.0
#pragma once

// Makes the map of scattered light below clouds (render/image/ground_light.h). Private to the module.
//
// Each column by itself transmits what a layer of its depth does (E. P. Shettle and J. A. Weinman 1970, "The Transfer of
// Solar Irradiance through Inhomogeneous Turbid Atmospheres Evaluated by Eddington's Approximation"; without absorption,
// above black ground, with delta-Eddington's depth of J. H. Joseph, W. J. Wiscombe and J. A. Weinman 1976), of the sun
//     ((2 + 3 mu) + (2 - 3 mu) exp(-(1 - g^2) depth / mu)) / (4 + 3 (1 - g) depth) - exp(-depth / mu)
// where mu is the sine of its elevation, and of the sky 1 / (1 + 3/4 (1 - g) depth); then it spreads as far as the clouds'
// base is high. Beyond the map the light is the mean of clouds that repeat to the horizon, or that of open ground.
// Results do not depend on the number of threads. `to_sun`: a unit vector.

#include <span>

#include "core/vec.h"
#include "render/cloud/cloud_volume.h"
#include "render/image/ground_light.h"
#include "render/image/picture.h"

namespace nephos {

// Returns the light below volumes. None that holds cloud: no words.
GroundLight light_below(std::span<const CloudVolume> volumes, const Vec3& to_sun, double ground_height_m);

// Returns that below any clouds by their shadow map, whose depths it takes for those of layers: for those of metaballs
// alone. `base_m`: world z of the lowest; `mean_cosine`: of the phase function. Sun at the horizon or below: no words.
GroundLight light_below(const Picture& shaded, double base_m, double mean_cosine, double ground_height_m);

}  // namespace nephos
