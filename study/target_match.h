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
    double distance;        // in standard deviations of both
    double log_likelihood;  // but for what is the same at every point
    double sd;              // of both, on the emulator's scale
};

// The emulator errs on its own scale (of a cover the logit), the target in the statistic's unit: of all numbers z the one is
// found for which
//
//     ((z - foretold) / its error)^2 + ((backward(z) - target) / its sd)^2
//
// is least, the square of the distance; the likelihood is the integral over z of the two normal densities about there. Where
// the scale is linear both are the usual ones, with the sum of the variances. Pure.
TargetMatch match(Transform transform, const Emulator::Prediction& foretold, const TargetValue& target);

}  // namespace nephos
