// SPDX-License-Identifier: Apache-2.0
#pragma once

// The noise lattice of one octave of a veil that repeats (not installed).
//
// A point has the lattice coordinates u = M (along, across) + phase. M is chosen so that both edges of the period, (Px, 0)
// and (0, Py) in the world, are whole vectors e1 and e2 of the lattice: of all such matrices the one whose vectors are
// nearest to those of the wanted wavelengths. Gradients then belong to lattice points modulo e1 and e2. The representative
// of a point is the one in the box 0 <= i < wide, 0 <= j < high of the Hermite normal form of (e1, e2):
//
//     lattice vectors  (wide, 0) and (shift, high):   high = gcd(e1.j, e2.j),  wide = |det(e1, e2)| / high
//
// so that subtracting q (shift, high) and then a multiple of (wide, 0) takes any point there.

#include <array>
#include <cstdint>

#include "core/math.h"
#include "core/vec.h"

namespace nephos {

struct VeilLattice {
    std::array<std::array<double, 2>, 2> per_m{};   // M: cells along and across, per metre along and across
    std::int32_t wide = 0, high = 0, shift = 0;      // wide = 0: the noise does not repeat
};

// Most different lattice cells on a level.
inline constexpr std::int64_t kMostVeilCells = 1 << 20;

// Returns the lattice; wide = 0 when its cells are too large or too many: |det(e1, e2)| is not 1..kMostVeilCells.
// Wavelengths and periods are above 0. Pure.
VeilLattice veil_lattice(const Vec2& wavelength_m, const Rotation& fibres, const Vec2& period_m);

// Returns the representative of a lattice point. Precondition: lattice.wide > 0.
std::array<std::int64_t, 2> representative(const VeilLattice& lattice, std::int64_t i, std::int64_t j);

}  // namespace nephos
