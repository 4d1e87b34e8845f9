// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tells how well a target is met by what an emulator foretells. Private to study/.

#include "study/emulator.h"
#include "study/transform.h"

namespace nephos {

// A target's value and standard deviation, in the unit of its statistic: above 0 the second.
struct TargetValue {
    double value, sd;
};

struct TargetMatch {
    double place;     // of the nearest number between both, on the emulator's scale
    double distance;  // of both from there, in their standard deviations
    double sd;        // of both, in the statistic's unit
    double unit;      // the statistic's unit in one of the emulator's scale
};

// The emulator errs on its own scale (of a cover the logit), the target in the statistic's unit: of all numbers z the one is
// found for which
//
//     ((z - foretold) / its error)^2 + ((backward(z) - target) / its sd)^2
//
// is least, the square of the distance. Where the scale is linear it is the usual one, with the sum of the variances. Pure.
TargetMatch match(Transform transform, const Emulator::Prediction& foretold, const TargetValue& target);

// Returns the logarithm of the integral over z of the two normal densities, but for what is the same at every point; exact
// about the nearest number. Pure.
double log_likelihood(Transform transform, const Emulator::Prediction& foretold, const TargetValue& target);

}  // namespace nephos
