// SPDX-License-Identifier: Apache-2.0
#include "render/options/mie_scattering.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace nephos {
namespace {

using Complex = std::complex<double>;

// D_n(z) at index n, 0 at index 0, from well beyond where it forgets how it began.
std::vector<Complex> logarithmic_derivatives(Complex z, std::size_t orders) {
    const double size = std::abs(z);
    const std::size_t begin = std::max(orders, std::size_t(size)) + std::size_t(8 * std::cbrt(size)) + 16;
    std::vector<Complex> derivatives(begin + 1);
    for (std::size_t n = begin; n >= 1; --n) {
        const Complex ratio = double(n) / z;
        derivatives[n - 1] = ratio - 1.0 / (derivatives[n] + ratio);
    }
    return derivatives;
}

// (2 n + 1) / (n (n + 1))
double weight_of_order(double n) { return (2 * n + 1) / (n * (n + 1)); }

}  // namespace

MieCoefficients mie_coefficients(double size_parameter, std::complex<double> index) {
    const double x = size_parameter;
    assert(x > 0 && index.real() > 0 && index.imag() >= 0);
    const auto orders = std::size_t(x + 4 * std::cbrt(x) + 2);
    const std::vector<Complex> derivatives = logarithmic_derivatives(index * x, orders);
    MieCoefficients sphere{.size_parameter = x, .a = {}, .b = {}};
    sphere.a.reserve(orders);
    sphere.b.reserve(orders);
    // Of the two orders before: psi_(-1), psi_0, and chi.
    double psi_before = std::cos(x), psi = std::sin(x), chi_before = -std::sin(x), chi = std::cos(x);
    for (std::size_t order = 1; order <= orders; ++order) {
        const auto n = double(order);
        const double psi_next = (2 * n - 1) / x * psi - psi_before,
                     chi_next = (2 * n - 1) / x * chi - chi_before;
        const Complex xi(psi, -chi), xi_next(psi_next, -chi_next);
        const Complex electric = derivatives[order] / index + n / x,
                      magnetic = derivatives[order] * index + n / x;
        sphere.a.push_back((electric * psi_next - psi) / (electric * xi_next - xi));
        sphere.b.push_back((magnetic * psi_next - psi) / (magnetic * xi_next - xi));
        psi_before = psi;
        psi = psi_next;
        chi_before = chi;
        chi = chi_next;
    }
    return sphere;
}

MieEfficiencies mie_efficiencies(const MieCoefficients& sphere) {
    MieEfficiencies sums;
    for (std::size_t i = 0; i < sphere.a.size(); ++i) {
        const auto n = double(i + 1);
        const Complex a = sphere.a[i], b = sphere.b[i];
        sums.extinction += (2 * n + 1) * (a + b).real();
        sums.scattering += (2 * n + 1) * (std::norm(a) + std::norm(b));
        sums.asymmetry += weight_of_order(n) * (a * std::conj(b)).real();
        if (i + 1 == sphere.a.size()) break;
        const Complex along = a * std::conj(sphere.a[i + 1]) + b * std::conj(sphere.b[i + 1]);
        sums.asymmetry += n * (n + 2) / (n + 1) * along.real();
    }
    const double per_area = 2 / (sphere.size_parameter * sphere.size_parameter);
    return {.extinction = per_area * sums.extinction,
            .scattering = per_area * sums.scattering,
            .asymmetry = 2 * sums.asymmetry / sums.scattering};
}

MieAngles::MieAngles(std::span<const double> cosines, std::size_t orders)
    : angles_(cosines.size()), sums_(angles_ * orders), differences_(angles_ * orders) {
    for (std::size_t angle = 0; angle < angles_; ++angle) {
        double before = 0, pi = 1;  // pi_0, pi_1
        for (std::size_t order = 1; order <= orders; ++order) {
            const auto n = double(order);
            const double tau = n * cosines[angle] * pi - (n + 1) * before;
            sums_[(order - 1) * angles_ + angle] = pi + tau;
            differences_[(order - 1) * angles_ + angle] = pi - tau;
            const double next = ((2 * n + 1) * cosines[angle] * pi - (n + 1) * before) / n;
            before = pi;
            pi = next;
        }
    }
}

void MieAngles::add_intensities(const MieCoefficients& sphere, double weight,
                                std::span<double> intensities) const {
    assert(sphere.a.size() <= orders() && intensities.size() == angles_);
    // Real and imaginary parts of S1 + S2 and of S1 - S2.
    std::vector<double> plus_real(angles_), plus_imaginary(angles_), minus_real(angles_),
        minus_imaginary(angles_);
    for (std::size_t i = 0; i < sphere.a.size(); ++i) {
        const double factor = weight_of_order(double(i + 1));
        const Complex plus = factor * (sphere.a[i] + sphere.b[i]),
                      minus = factor * (sphere.a[i] - sphere.b[i]);
        const double* const sum = &sums_[i * angles_];
        const double* const difference = &differences_[i * angles_];
        for (std::size_t angle = 0; angle < angles_; ++angle) {
            plus_real[angle] += plus.real() * sum[angle];
            plus_imaginary[angle] += plus.imag() * sum[angle];
            minus_real[angle] += minus.real() * difference[angle];
            minus_imaginary[angle] += minus.imag() * difference[angle];
        }
    }
    // |S1|^2 + |S2|^2 is half of |S1 + S2|^2 + |S1 - S2|^2.
    for (std::size_t angle = 0; angle < angles_; ++angle)
        intensities[angle] +=
            0.25 * weight *
            (plus_real[angle] * plus_real[angle] + plus_imaginary[angle] * plus_imaginary[angle] +
             minus_real[angle] * minus_real[angle] + minus_imaginary[angle] * minus_imaginary[angle]);
}

double index_of_water(double wavelength_nm) { return 1.3241 + 3098 / (wavelength_nm * wavelength_nm); }

}  // namespace nephos
