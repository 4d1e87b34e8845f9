// SPDX-License-Identifier: Apache-2.0
#include "render/options/phase_function.h"

#include <cassert>
#include <cmath>
#include <numbers>

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;

// Integrates to (1 + (1 + 2 g^2) / 3 alpha) with the factor (1 + alpha cos^2), as the mean of cos^2 under
// Henyey and Greenstein's lobe is (1 + 2 g^2) / 3.
double mean_squared_cosine(double g) { return (1 + 2 * g * g) / 3; }

// Draine 2003, equation 6.
double draine_mean_cosine(double g, double alpha) {
    return g * (1 + alpha * (3 + 2 * g * g) / 5) / (1 + alpha * mean_squared_cosine(g));
}

}  // namespace

double henyey_greenstein(double cos_theta, double g) {
    assert(std::abs(g) < 1);
    // 1 + g^2 - 2 g cos, exact also where it is small.
    const double base = (1 - g) * (1 - g) + 2 * g * (1 - cos_theta);
    return (1 - g * g) / (4 * kPi * base * std::sqrt(base));
}

double rayleigh(double cos_theta) { return 3 / (16 * kPi) * (1 + cos_theta * cos_theta); }

double draine(double cos_theta, double g, double alpha) {
    assert(alpha >= 0);
    return henyey_greenstein(cos_theta, g) * (1 + alpha * cos_theta * cos_theta) /
           (1 + alpha * mean_squared_cosine(g));
}

HgDraine hg_draine_fit(double droplet_diameter_um) {
    const double d = droplet_diameter_um;
    assert(d >= kMinDroplet_um && d <= kMaxDroplet_um);
    return {.g = std::exp(-0.0990567 / (d - 1.67154)),
            .draine_g = std::exp(-2.20679 / (d + 3.91029) - 0.428934),
            .alpha = std::exp(3.62489 - 8.29288 / (d + 5.52825)),
            .draine_fraction = std::exp(-0.599085 / (d - 0.641583) - 0.665888)};
}

double phase(const PhaseFunction& function, double cos_theta, double directed) {
    const double g = directed * function.g;
    switch (function.kind) {
        case Phase::isotropic:
            return 1 / (4 * kPi);
        case Phase::rayleigh:
            return (1 - directed) / (4 * kPi) + directed * rayleigh(cos_theta);
        case Phase::henyey_greenstein:
            return henyey_greenstein(cos_theta, g);
        case Phase::cornette_shanks:
            return draine(cos_theta, g, directed);
        case Phase::hg_draine:
            break;
    }
    const HgDraine fit = hg_draine_fit(function.droplet_diameter_um);
    return (1 - fit.draine_fraction) * henyey_greenstein(cos_theta, directed * fit.g) +
           fit.draine_fraction * draine(cos_theta, directed * fit.draine_g, directed * fit.alpha);
}

double mean_cosine(const PhaseFunction& function) {
    switch (function.kind) {
        case Phase::isotropic:
        case Phase::rayleigh:
            return 0;
        case Phase::henyey_greenstein:
            return function.g;
        case Phase::cornette_shanks:
            return draine_mean_cosine(function.g, 1);
        case Phase::hg_draine:
            break;
    }
    const HgDraine fit = hg_draine_fit(function.droplet_diameter_um);
    return (1 - fit.draine_fraction) * fit.g +
           fit.draine_fraction * draine_mean_cosine(fit.draine_g, fit.alpha);
}

}  // namespace nephos
