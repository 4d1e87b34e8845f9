// SPDX-License-Identifier: Apache-2.0
#pragma once

// Makes the map of scattered light below clouds (render/image/ground_light.h). Private to the module.
//
// Each column by itself transmits what a layer of its depth does (E. P. Shettle and J. A. Weinman 1970, "The Transfer of
// Solar Irradiance through Inhomogeneous Turbid Atmospheres Evaluated by Eddington's Approximation"; without absorption,
// above black ground, with delta-Eddington's depth of J. H. Joseph, W. J. Wiscombe and J. A. Weinman 1976), of the sun
//     ((2 + 3 mu) + (2 - 3 mu) exp(-(1 - g^2) depth / mu)) / (4 + 3 (1 - g) depth) - exp(-depth / mu)
// where mu is the sine of its elevation, and of the sky 1 / (1 + 3/4 (1 - g) depth); then it spreads as far as the clouds'
// base is high.

#include "core/vec.h"
#include "render/cloud/cloud_preparation.h"
#include "render/image/ground_light.h"

namespace nephos {

// Where clouds repeat to the horizon: the corner of their first period, and its edges; edges of 0: they do not.
struct RepeatedArea {
    Vec2 corner_m{0, 0}, edges_m{0, 0};
};

// Returns the light below a cloud of metaballs, which have the depth of columns whether they are drawn as such or not. No
// visible metaball: no words. Beyond the map the light is that of open ground, or of clouds that repeat its mean. `to_sun`:
// a unit vector; `mean_cosine`: g of the phase function. Does not depend on the number of threads.
GroundLight light_below(const PreparedCloud& cloud, const RepeatedArea& repeated, const Vec3& to_sun, double mean_cosine,
                        double ground_height_m);

}  // namespace nephos
