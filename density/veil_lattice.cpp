// SPDX-License-Identifier: Apache-2.0
#include "density/veil_lattice.h"

#include <cmath>
#include <cstdlib>
#include <utility>

namespace nephos {
namespace {

// Returns n modulo m, 0 .. m - 1, and the quotient.
std::pair<std::int64_t, std::int64_t> divided(std::int64_t n, std::int64_t m) {
    const std::int64_t quotient = n / m - (n % m < 0 ? 1 : 0);
    return {n - quotient * m, quotient};
}

}  // namespace

VeilLattice veil_lattice(const Vec2& wavelength_m, const Rotation& fibres, const Vec2& period_m) {
    const auto whole = [&](double along, double across) {
        const auto of = [](double cells) { return std::int64_t(std::llround(std::min(std::max(cells, -1e9), 1e9))); };
        return std::array{of(along / wavelength_m.x), of(across / wavelength_m.y)};
    };
    std::array e1 = whole(period_m.x * fibres.cos, -period_m.x * fibres.sin),
               e2 = whole(period_m.y * fibres.sin, period_m.y * fibres.cos);
    VeilLattice lattice;
    const double area = std::abs(double(e1[0]) * double(e2[1]) - double(e1[1]) * double(e2[0]));
    if (!(area >= 1 && area <= double(kMostVeilCells))) return lattice;
    // M (Px cos, -Px sin) = e1 and M (Py sin, Py cos) = e2.
    for (std::size_t row = 0; row < 2; ++row) {
        const double east = double(e1[row]) / period_m.x, north = double(e2[row]) / period_m.y;
        lattice.per_m[row] = {east * fibres.cos + north * fibres.sin, north * fibres.cos - east * fibres.sin};
    }
    while (e1[1] != 0) {  // Euclid's algorithm on the second components
        const std::int64_t times = e2[1] / e1[1];
        const std::array rest{e2[0] - times * e1[0], e2[1] - times * e1[1]};
        e2 = std::exchange(e1, rest);
    }
    if (e2[1] < 0) e2 = {-e2[0], -e2[1]};
    lattice.wide = std::int32_t(std::abs(e1[0]));
    lattice.high = std::int32_t(e2[1]);
    lattice.shift = std::int32_t(divided(e2[0], lattice.wide).first);
    return lattice;
}

std::array<std::int64_t, 2> representative(const VeilLattice& lattice, std::int64_t i, std::int64_t j) {
    const auto [row, times] = divided(j, lattice.high);
    return {divided(i - times * lattice.shift, lattice.wide).first, row};
}

}  // namespace nephos
