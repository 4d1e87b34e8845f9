// SPDX-License-Identifier: Apache-2.0
#include "render/options/droplet_phase.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <numbers>
#include <optional>
#include <utility>

#include "render/options/mie_scattering.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi, kDegree = kPi / 180;
constexpr double kFineStep_deg = 0.1, kFineReach_deg = 12, kStep_deg = 0.25;  // of the table's nodes
constexpr std::size_t kFine = std::size_t(kFineReach_deg / kFineStep_deg),
                      kNodes =
                          kFine + std::size_t((DropletPhase::kReach_deg - kFineReach_deg) / kStep_deg) + 1;
constexpr int kWavelengths = 16;
constexpr int kIndices = 3;
constexpr double kSizeStep = 0.1;  // of size parameters: resonances are narrow
constexpr int kMostSizes = 1600;
constexpr double kSunRadius_deg = 0.265;

double angle_of_node(std::size_t node) {
    return node < kFine ? double(node) * kFineStep_deg : kFineReach_deg + double(node - kFine) * kStep_deg;
}

double node_of_angle(double degrees) {
    return degrees < kFineReach_deg ? degrees / kFineStep_deg
                                    : double(kFine) + (degrees - kFineReach_deg) / kStep_deg;
}

double wavelength_nm(int number) { return 400 + 300 * (number + 0.5) / kWavelengths; }

double size_parameter(double radius_um, double nm) { return 2 * kPi * radius_um * 1e3 / nm; }

double index_of_node(int node) {
    const double high = index_of_water(wavelength_nm(0)),
                 low = index_of_water(wavelength_nm(kWavelengths - 1));
    return low + (high - low) * node / (kIndices - 1);
}

// Returns how much a node counts for the index at a wavelength: linear interpolation.
double share_of_node(int node, int number) {
    const double step = index_of_node(1) - index_of_node(0);
    return std::max(0.0, 1 - std::abs(index_of_water(wavelength_nm(number)) - index_of_node(node)) / step);
}

// A Gaussian with different widths below and above its middle.
double lobe(double wavelength, double middle, double below, double above) {
    const double t = (wavelength - middle) / (wavelength < middle ? below : above);
    return std::exp(-0.5 * t * t);
}

// Linear sRGB of light of one wavelength.
std::array<double, 3> rgb_of_wavelength(double nm) {
    const double x = 1.056 * lobe(nm, 599.8, 37.9, 31.0) + 0.362 * lobe(nm, 442.0, 16.0, 26.7) -
                     0.065 * lobe(nm, 501.1, 20.4, 26.2),
                 y = 0.821 * lobe(nm, 568.8, 46.9, 40.5) + 0.286 * lobe(nm, 530.9, 16.3, 31.1),
                 z = 1.217 * lobe(nm, 437.0, 11.8, 36.0) + 0.681 * lobe(nm, 459.0, 26.0, 13.8);
    return {3.2406 * x - 1.5372 * y - 0.4986 * z, -0.9689 * x + 1.8758 * y + 0.0415 * z,
            0.0557 * x - 0.2040 * y + 1.0570 * z};
}

// Returns the gamma distribution of radii at one of them, relative to its value at the effective radius.
double number_of(const DropletSizes& sizes, double radius_um) {
    const double variance = sizes.effective_variance,
                 radius = radius_um / (0.5 * sizes.effective_diameter_um);
    return std::exp((1 - 3 * variance) / variance * std::log(radius) - (radius - 1) / variance);
}

struct Range {
    double first, last;
};

// Radii beyond which droplets scatter less than 0.1 % of the light, micrometres.
Range radii_of(const DropletSizes& sizes) {
    const double effective = 0.5 * sizes.effective_diameter_um, spread = std::sqrt(sizes.effective_variance);
    return {effective * std::max(0.02, 1 - 3.5 * spread), effective * (1 + 4.5 * spread)};
}

// The phase functions of all wavelengths at the nodes. What interferes in a droplet changes with the size parameter over
// less than one, and hardly with the refractive index: spheres of three indices are solved on a fine grid of size parameters, which
// all wavelengths share, and the means over radii are interpolated in the index.
using Phases = std::array<std::vector<double>, kWavelengths>;

void add_index(const DropletSizes& sizes, int node, const MieAngles& angles, Phases& phases) {
    const Range radii = radii_of(sizes);
    const double first = size_parameter(radii.first, wavelength_nm(kWavelengths - 1)),
                 last = size_parameter(radii.last, wavelength_nm(0));
    const int count = std::clamp(int((last - first) / kSizeStep), 1, kMostSizes);
    std::array<double, kWavelengths> scattered{};
    Phases sums;
    for (std::vector<double>& sum : sums) sum.assign(kNodes, 0.0);
    std::vector<double> intensities(kNodes);
    for (int i = 0; i < count; ++i) {
        const double x = first + (last - first) * (i + (node + 0.5) / kIndices) / count;
        const MieCoefficients sphere = mie_coefficients(x, index_of_node(node));
        std::ranges::fill(intensities, 0.0);
        angles.add_intensities(sphere, 1, intensities);
        const double all = kPi * x * x * mie_efficiencies(sphere).scattering;
        for (int number = 0; number < kWavelengths; ++number) {
            const double radius_um = x * wavelength_nm(number) * 1e-3 / (2 * kPi);
            if (share_of_node(node, number) == 0 || radius_um < radii.first || radius_um > radii.last)
                continue;
            const double weight = number_of(sizes, radius_um);
            const auto at = std::size_t(number);
            scattered[at] += weight * all;
            for (std::size_t angle = 0; angle < kNodes; ++angle)
                sums[at][angle] += weight * intensities[angle];
        }
    }
    for (int number = 0; number < kWavelengths; ++number) {
        const auto at = std::size_t(number);
        const double share = share_of_node(node, number);
        if (share == 0) continue;
        for (std::size_t angle = 0; angle < kNodes; ++angle)
            phases[at][angle] += share / scattered[at] * sums[at][angle];
    }
}

double between_nodes(const std::vector<double>& table, double degrees) {
    const double place = std::clamp(node_of_angle(degrees), 0.0, double(kNodes - 1));
    const std::size_t below = std::min(std::size_t(place), kNodes - 2);
    const double part = place - double(below);
    return (1 - part) * table[below] + part * table[below + 1];
}

// The mean over the sun's disc.
std::vector<double> over_disc(const std::vector<double>& of) {
    constexpr int kRings = 4, kPlaces = 12;
    std::vector<double> smooth(kNodes, 0.0);
    for (std::size_t node = 0; node < kNodes; ++node) {
        const double angle = angle_of_node(node) * kDegree;
        for (int ring = 0; ring < kRings; ++ring) {
            const double radius = kSunRadius_deg * kDegree * std::sqrt((ring + 0.5) / kRings);
            for (int place = 0; place < kPlaces; ++place) {
                const double turn = 2 * kPi * (place + 0.5) / kPlaces;
                const double cosine =
                    std::cos(angle) * std::cos(radius) + std::sin(angle) * std::sin(radius) * std::cos(turn);
                smooth[node] +=
                    between_nodes(of, std::acos(std::min(cosine, 1.0)) / kDegree) / (kRings * kPlaces);
            }
        }
    }
    return smooth;
}

}  // namespace

DropletPhase::DropletPhase(const DropletSizes& sizes) : sizes_(sizes) {
    assert(sizes.effective_diameter_um > 0 && sizes.effective_variance > 0 &&
           sizes.effective_variance < 1.0 / 3);
    std::vector<double> cosines;
    for (std::size_t node = 0; node < kNodes; ++node)
        cosines.push_back(-std::cos(angle_of_node(node) * kDegree));
    const double x = size_parameter(radii_of(sizes).last, wavelength_nm(0));
    const MieAngles angles(cosines, std::size_t(x + 4 * std::cbrt(x) + 2));
    Phases phases;
    for (std::vector<double>& phase : phases) phase.assign(kNodes, 0.0);
    for (int node = 0; node < kIndices; ++node) add_index(sizes, node, angles, phases);
    std::array<double, 3> white{};
    for (std::vector<double>& colour : table_) colour.assign(kNodes, 0.0);
    for (int number = 0; number < kWavelengths; ++number) {
        const std::vector<double>& phase = phases[std::size_t(number)];
        const std::array<double, 3> rgb = rgb_of_wavelength(wavelength_nm(number));
        for (std::size_t c = 0; c < 3; ++c) {
            white[c] += rgb[c];
            for (std::size_t node = 0; node < kNodes; ++node) table_[c][node] += rgb[c] * phase[node];
        }
    }
    for (std::size_t c = 0; c < 3; ++c) {
        table_[c] = over_disc(table_[c]);
        for (double& value : table_[c]) value = std::max(value / white[c], 0.0);
    }
}

std::array<double, 3> DropletPhase::at(double cos_theta) const {
    const double degrees = std::acos(std::clamp(-cos_theta, -1.0, 1.0)) / kDegree;
    std::array<double, 3> phase;
    for (std::size_t c = 0; c < 3; ++c) phase[c] = between_nodes(table_[c], degrees);
    return phase;
}

DropletPhase droplet_phase(const DropletSizes& sizes) {
    static std::mutex mutex;
    static std::optional<DropletPhase> last;
    const std::lock_guard lock(mutex);
    if (!last || !(last->sizes() == sizes)) last.emplace(sizes);
    return *last;
}

std::vector<std::array<double, 3>> bow_factors(const PhaseFunction& function, const DropletSizes& sizes,
                                               double strength, std::span<const double> cosines) {
    const DropletPhase droplets = droplet_phase(sizes);
    const PhaseFunction fit{
        .kind = Phase::hg_draine, .g = 0, .droplet_diameter_um = sizes.effective_diameter_um};
    std::vector<std::array<double, 3>> ratios;
    std::vector<double> shares;
    std::array<double, 3> changed{};
    double all = 0;
    for (std::size_t i = 0; i < cosines.size(); ++i) {
        const double cosine = cosines[i], t = std::clamp((std::acos(cosine) / kDegree - 95) / 30, 0.0, 1.0);
        shares.push_back(t * t * (3 - 2 * t));
        ratios.push_back(droplets.at(cosine));
        // The trapezoidal rule over the cosine.
        const double before = cosines[i == 0 ? 0 : i - 1],
                     after = cosines[std::min(i + 1, cosines.size() - 1)];
        const double light = shares.back() * phase(function, cosine) * 0.5 * (before - after);
        all += light;
        for (std::size_t c = 0; c < 3; ++c) {
            ratios[i][c] /= phase(fit, cosine);
            changed[c] += light * ratios[i][c];
        }
    }
    for (std::size_t i = 0; i < cosines.size(); ++i)
        for (std::size_t c = 0; c < 3; ++c)
            ratios[i][c] = 1 + strength * shares[i] * (ratios[i][c] * all / changed[c] - 1);
    return ratios;
}

}  // namespace nephos
