// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a polynomial stands for: statistics on a scale without ends, on which they are smooth functions of parameters. Private
// to study/.

#include <cmath>
#include <limits>
#include <string>

namespace nephos {

enum class Transform { identity, log, logit };

// Fractions between 0 and 1 become logits, what is above 0 a logarithm, exponents and dimensions stay.
inline Transform transform_of(const std::string& statistic) {
    if (statistic == "cover" || statistic.ends_with("_fraction")) return Transform::logit;
    if (statistic.ends_with("_exponent") || statistic == "size_exponent_line" || statistic == "overlap" ||
        statistic.ends_with("_dimension"))
        return Transform::identity;
    return Transform::log;
}

// Return the number that stands for a statistic in an emulator, NaN where there is none, the statistic of such a number, and
// the slope of the first at a statistic.
inline double forward(Transform transform, double x) {
    if (transform == Transform::log) return x > 0 ? std::log(x) : std::numeric_limits<double>::quiet_NaN();
    if (transform == Transform::logit)
        return x > 0 && x < 1 ? std::log(x / (1 - x)) : std::numeric_limits<double>::quiet_NaN();
    return x;
}

inline double backward(Transform transform, double z) {
    if (transform == Transform::log) return std::exp(z);
    if (transform == Transform::logit) return 1 / (1 + std::exp(-z));
    return z;
}

inline double slope(Transform transform, double x) {
    if (transform == Transform::log) return 1 / x;
    if (transform == Transform::logit) return 1 / (x * (1 - x));
    return 1;
}

}  // namespace nephos
