// SPDX-License-Identifier: Apache-2.0
#pragma once

// Light that a homogeneous sphere scatters, exactly: Mie's solution of Maxwell's equations.
//
// A sphere of radius r and refractive index m in light of the wavelength lambda has the size parameter x = 2 pi r / lambda.
// Its scattering coefficients follow from Riccati and Bessel's functions psi, xi = psi - i chi, and from the logarithmic
// derivative D of psi inside (Bohren and Huffman 1983, Absorption and Scattering of Light by Small Particles, 4.88):
//
//     a_n = ((D_n / m + n / x) psi_n - psi_(n-1)) / ((D_n / m + n / x) xi_n - xi_(n-1))
//     b_n = ((D_n m + n / x) psi_n - psi_(n-1)) / ((D_n m + n / x) xi_n - xi_(n-1))
//
// D by downward recurrence (4.89), psi and chi by upward recurrence, and n up to x + 4 cbrt(x) + 2 (appendix A). The amplitudes
// of the two polarisations are (4.74)
//
//     S1 = sum (2 n + 1) / (n (n + 1)) (a_n pi_n + b_n tau_n),    S2 = sum (2 n + 1) / (n (n + 1)) (a_n tau_n + b_n pi_n)
//
// Pure functions, thread-safe.

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace nephos {

struct MieCoefficients {
    double size_parameter = 0;
    std::vector<std::complex<double>> a, b;  // of order n at index n - 1
};

// Precondition: size_parameter > 0; index: its real part > 0, its imaginary part >= 0 absorbs.
MieCoefficients mie_coefficients(double size_parameter, std::complex<double> index);

// Cross-sections over the sphere's own, and the mean cosine of the scattered light (Bohren and Huffman 4.61, 4.62, 4.5.3).
struct MieEfficiencies {
    double extinction = 0, scattering = 0, asymmetry = 0;
};
MieEfficiencies mie_efficiencies(const MieCoefficients& sphere);

// The angular functions pi_n and tau_n at some angles, for all orders up to a largest (Bohren and Huffman 4.47), as their sums
// and differences: (S1 + S2) needs the sums alone, (S1 - S2) the differences.
class MieAngles {
  public:
    // cosines: of the angles between the directions of travel, -1..1; orders >= 1.
    MieAngles(std::span<const double> cosines, std::size_t orders);
    std::size_t angles() const { return angles_; }
    std::size_t orders() const { return angles_ == 0 ? 0 : sums_.size() / angles_; }

    // Adds weight (|S1|^2 + |S2|^2) / 2 at each angle to `intensities`: of unpolarised light. Precondition: no more orders
    // than here, and as many intensities as angles.
    void add_intensities(const MieCoefficients& sphere, double weight, std::span<double> intensities) const;

  private:
    std::size_t angles_;
    std::vector<double> sums_, differences_;  // by order, then by angle
};

// Returns the real refractive index of water at 10 to 20 degrees in visible light: Cauchy's law between 1.3401 at 440 nm and
// 1.3308 at 680 nm.
double index_of_water(double wavelength_nm);

}  // namespace nephos
