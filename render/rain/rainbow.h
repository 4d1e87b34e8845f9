// SPDX-License-Identifier: Apache-2.0
#pragma once

// Light that leaves raindrops after one and two reflections inside: the primary bow 42 degrees from the point opposite to
// the sun, the secondary one at 51, the dark band of Alexander between them, and the brighter sky within the primary.
//
// Geometric optics gives the energy by scattering angle, with Fresnel's coefficients, from rays spread evenly over the drop's
// cross-section; at the bow's angle it is infinite. Airy's theory of a drop with the size parameter x has there
//
//     I(d) ~ Ai(-k d)^2,    k = x^(2/3) / h^(1/3),    h = ((p + 1)^2 - 1)^2 / ((p + 1)^2 (n^2 - 1)) sqrt(((p + 1)^2 - n^2) / (n^2 - 1))
//
// at an angle d on the lit side, p reflections, n the index (van de Hulst 1957, 13.2). As Ai^2 is a convolution of 1 / sqrt
// with Ai, this is the geometric intensity convolved with 2^(2/3) k Ai(2^(2/3) k .), which has the right energy everywhere.
// The kernel is the mean over the drops of rain, and the result that over the sun's disc. Private to the module.

#include <array>
#include <vector>

namespace nephos {

struct Rainbow {
    static constexpr int kCells = 2048;
    // pi times the phase function for red, green and blue at kCells + 1 nodes, even in sqrt((1 + cos theta) / 2); theta as in
    // phase_function.h, so that node 0 is opposite to the sun.
    std::array<std::vector<float>, 3> nodes;
    double share = 0;  // of the light that a drop scatters, about 0.05

    // Returns it at a cosine, linear between nodes.
    std::array<double, 3> at(double cos_theta) const;
};

// Returns the table; computed at the first call. Thread-safe.
const Rainbow& rainbow();

}  // namespace nephos
