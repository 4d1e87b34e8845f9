// SPDX-License-Identifier: Apache-2.0
#include "render/rain/rainbow.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi, kDegree = kPi / 180;
constexpr double kCell_deg = 0.02;  // of the histogram
constexpr int kAngles = int(180 / kCell_deg);
constexpr double kKernel_deg = 4;  // half width of what one angle is spread over
constexpr double kSunRadius_deg = 0.265;
constexpr double kSlope_per_mm = 2.5;  // of the drops' sizes, Marshall and Palmer at 10 mm/h
constexpr std::array<double, 3> kWavelength_nm{650, 550, 450};
constexpr double kHalfChannel_nm = 40;  // a channel is the mean over wavelengths so far apart
constexpr int kWavelengths = 3;

// Cauchy's law between the indices of water at 440 and 680 nm.
double index_of_water(double wavelength_nm) { return 1.3241 + 3098 / (wavelength_nm * wavelength_nm); }

double airy(double x) {
    const double size = std::abs(x), argument = 2.0 / 3 * size * std::sqrt(size), third = 1.0 / 3;
    if (size < 1e-9) return 0.355028053887817;
    if (x > 0) return x > 12 ? 0.0 : std::sqrt(x / 3) / kPi * std::cyl_bessel_k(third, argument);
    const double j = std::cyl_bessel_j(third, argument), y = std::cyl_neumann(third, argument);
    return std::sqrt(size) / 3 * (j + 0.5 * j - std::sqrt(0.75) * y);  // J(-1/3) by J and Y
}

// The energy of rays that are reflected inside `times` times, by scattering angle; the sum is their share of the light
// that meets the drop.
std::vector<double> geometric(double n, int times) {
    constexpr int kRays = 60'000;
    std::vector<double> energy(kAngles, 0.0);
    for (int ray = 0; ray < kRays; ++ray) {
        const double b = std::sqrt((ray + 0.5) / kRays), i = std::asin(b), r = std::asin(b / n);
        const double c = std::cos(i), t = std::cos(r);
        const double s_wave = (c - n * t) / (c + n * t), p_wave = (n * c - t) / (n * c + t);
        double through = 0;
        for (const double reflects : {s_wave * s_wave, p_wave * p_wave})
            through += 0.5 * (1 - reflects) * (1 - reflects) * std::pow(reflects, times);
        const double turned = times * kPi + 2 * i - 2 * (times + 1) * r;
        const double angle = std::acos(std::cos(turned)) / kDegree;
        energy[std::size_t(std::min(int(angle / kCell_deg), kAngles - 1))] += through / kRays;
    }
    return energy;
}

// The kernel of Airy's theory at cells of u from -kKernel_deg to kKernel_deg, mean over the drops.
std::vector<double> airy_kernel(double n, double wavelength_nm, int times) {
    const double p = (times + 1) * (times + 1), square = n * n - 1;
    const double h = (p - 1) * (p - 1) / (p * square) * std::sqrt((p - n * n) / square);
    const int reach = int(kKernel_deg / kCell_deg);
    std::vector<double> kernel(std::size_t(2 * reach + 1), 0.0);
    double all = 0;
    for (double d_mm = 0.4; d_mm < 3; d_mm += 0.2) {
        const double weight = d_mm * d_mm * std::exp(-kSlope_per_mm * d_mm);
        const double k = std::pow(kPi * d_mm * 1e6 / wavelength_nm, 2.0 / 3) / std::cbrt(h);
        const double per_cell = std::pow(2.0, 2.0 / 3) * k * kCell_deg * kDegree;
        for (int u = -reach; u <= reach; ++u) {
            // What oscillates faster than cells has a mean of 0.
            if (per_cell * std::sqrt(std::abs(u * per_cell)) > 2) continue;
            kernel[std::size_t(u + reach)] += weight * per_cell * airy(u * per_cell);
        }
    }
    for (const double value : kernel) all += value;
    for (double& value : kernel) value /= all;
    return kernel;
}

std::vector<double> sun_disc() {
    const int reach = int(kSunRadius_deg / kCell_deg);
    std::vector<double> disc;
    double all = 0;
    for (int u = -reach; u <= reach; ++u) {
        disc.push_back(std::sqrt(std::max(0.0, 1 - double(u) * u / (double(reach) * reach))));
        all += disc.back();
    }
    for (double& value : disc) value /= all;
    return disc;
}

// out(angle) = sum over u of of(angle + side u) kernel(u); what leaves the range stays at its end.
std::vector<double> convolved(const std::vector<double>& of, const std::vector<double>& kernel, int side) {
    const int reach = int(kernel.size() / 2);
    std::vector<double> out(of.size(), 0.0);
    for (int from = 0; from < int(of.size()); ++from) {
        if (of[std::size_t(from)] == 0) continue;
        for (int u = -reach; u <= reach; ++u) {
            const int to = std::clamp(from - side * u, 0, int(of.size()) - 1);
            out[std::size_t(to)] += of[std::size_t(from)] * kernel[std::size_t(u + reach)];
        }
    }
    return out;
}

Rainbow make_rainbow() {
    Rainbow bow;
    for (std::size_t c = 0; c < 3; ++c) {
        std::vector<double> energy(kAngles, 0.0);
        for (int w = 0; w < kWavelengths; ++w) {
            const double wavelength =
                kWavelength_nm[c] + kHalfChannel_nm * (2.0 * w / (kWavelengths - 1) - 1);
            const double n = index_of_water(wavelength);
            for (const int times : {1, 2}) {
                // The lit side of the primary bow has larger angles, that of the secondary smaller ones.
                const std::vector<double> spread =
                    convolved(geometric(n, times), airy_kernel(n, wavelength, times), times == 1 ? 1 : -1);
                for (std::size_t a = 0; a < energy.size(); ++a) energy[a] += spread[a] / kWavelengths;
            }
        }
        energy = convolved(energy, sun_disc(), 1);
        double all = 0;
        for (double& value : energy) {
            value = std::max(value, 0.0);
            all += value;
        }
        bow.share += all / 3;
        for (int node = 0; node <= Rainbow::kCells; ++node) {
            const double half =
                double(node) / Rainbow::kCells;  // sqrt((1 + cos) / 2), of theta = 180 degrees at node 0
            const double angle = 180 - 2 * std::asin(half) / kDegree;
            const double wide = std::max(0.06, kCell_deg);  // a mean over about a node
            const int first = std::clamp(int((angle - wide / 2) / kCell_deg), 0, kAngles - 1),
                      last = std::clamp(int((angle + wide / 2) / kCell_deg), 0, kAngles - 1);
            double sum = 0;
            for (int a = first; a <= last; ++a) sum += energy[std::size_t(a)];
            const double solid =
                2 * kPi *
                (std::cos(first * kCell_deg * kDegree) - std::cos((last + 1) * kCell_deg * kDegree));
            bow.nodes[c].push_back(float(kPi * sum / solid));
        }
    }
    return bow;
}

}  // namespace

std::array<double, 3> Rainbow::at(double cos_theta) const {
    const double place = std::sqrt(std::clamp(0.5 + 0.5 * cos_theta, 0.0, 1.0)) * kCells;
    const auto below = std::size_t(std::min(int(place), kCells - 1));
    const double part = place - double(below);
    std::array<double, 3> phase;
    for (std::size_t c = 0; c < 3; ++c)
        phase[c] = (1 - part) * double(nodes[c][below]) + part * double(nodes[c][below + 1]);
    return phase;
}

const Rainbow& rainbow() {
    static const Rainbow bow = make_rainbow();
    return bow;
}

}  // namespace nephos
