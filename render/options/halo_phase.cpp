// SPDX-License-Identifier: Apache-2.0
#include "render/options/halo_phase.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace nephos {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::size_t kCells = 1200;  // of angles
constexpr double kFirst_deg = 20, kLast_deg = 50;
constexpr double kCell_deg = (kLast_deg - kFirst_deg) / kCells;
constexpr std::array<double, 3> kIndex{1.3069, 1.3110, 1.3166};  // of ice: Warren and Brandt 2008
constexpr double kSunRadius_deg = 0.265;

// Transmittance of unpolarised light from cosine `c` outside to `t` inside a medium of index n.
double fresnel(double c, double t, double n) {
    const double s = (c - n * t) / (c + n * t), p = (n * c - t) / (n * c + t);
    return 1 - 0.5 * (s * s + p * p);
}

std::vector<double> histogram(double index) {
    std::vector<double> energy(kCells, 0.0);
    constexpr int kAngles = 1000, kInclinations = 100;
    for (int j = 0; j < kInclinations; ++j) {
        const double h = (j + 0.5) / kInclinations * 60 * kDegree, cosine = std::cos(h);
        const double n = std::sqrt(index * index - std::sin(h) * std::sin(h)) / cosine;  // Bravais
        for (int k = 0; k < kAngles; ++k) {
            const double i = (k + 0.5) / kAngles * 90 * kDegree, r = std::asin(std::sin(i) / n);
            const double inside = 60 * kDegree - r, leaves = n * std::sin(inside);
            if (leaves >= 1) continue;  // totally reflected
            const double out = std::asin(leaves), deflection = i + out - 60 * kDegree;
            const double angle = 2 * std::asin(cosine * std::sin(0.5 * deflection)) / kDegree;
            const double through =
                fresnel(std::cos(i), std::cos(r), n) * fresnel(std::cos(out), std::cos(inside), n);
            // Random orientations: cos h dh; the side is seen under cos i cos h.
            const double weight = cosine * cosine * std::cos(i) * through;
            const double cell = (angle - kFirst_deg) / kCell_deg;
            if (cell >= 0 && cell < double(kCells)) energy[std::size_t(cell)] += weight;
        }
    }
    return energy;
}

// The mean over the sun's disc, a chord at each distance from its middle.
std::vector<double> over_disc(const std::vector<double>& of) {
    std::vector<double> smooth(of.size(), 0.0);
    const int reach = int(kSunRadius_deg / kCell_deg);
    double all = 0;
    for (int d = -reach; d <= reach; ++d) {
        const double weight = std::sqrt(std::max(0.0, 1 - double(d) * d / (double(reach) * reach)));
        all += weight;
        for (int i = std::max(0, -d); i < int(of.size()) - std::max(0, d); ++i)
            smooth[std::size_t(i)] += weight * of[std::size_t(i + d)];
    }
    for (double& value : smooth) value /= all;
    return smooth;
}

}  // namespace

HaloPhase::HaloPhase() {
    for (std::size_t c = 0; c < 3; ++c) {
        table_[c] = over_disc(histogram(kIndex[c]));
        double all = 0;
        for (const double energy : table_[c]) all += energy;
        for (std::size_t i = 0; i < kCells; ++i) {
            const double low = (kFirst_deg + double(i) * kCell_deg) * kDegree,
                         high = low + kCell_deg * kDegree;
            table_[c][i] /= all * 2 * std::numbers::pi * (std::cos(low) - std::cos(high));
        }
    }
}

std::array<double, 3> HaloPhase::at(double cos_theta) const {
    const double angle = std::acos(std::clamp(cos_theta, -1.0, 1.0)) / kDegree;
    const double at = (angle - kFirst_deg) / kCell_deg - 0.5;
    if (!(at >= 0 && at < double(kCells - 1))) return {};
    const auto below = std::size_t(at);
    const double part = at - double(below);
    std::array<double, 3> phase;
    for (std::size_t c = 0; c < 3; ++c)
        phase[c] = (1 - part) * table_[c][below] + part * table_[c][below + 1];
    return phase;
}

}  // namespace nephos
