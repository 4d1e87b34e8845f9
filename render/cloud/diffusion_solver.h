// SPDX-License-Identifier: Apache-2.0
#pragma once

// The solution of the equation of diffusion.h on its cells. Private to the module.

#include <array>
#include <vector>

#include "render/cloud/diffusion_cells.h"

namespace nephos {

// Fluence beyond faces without cloud: below and above a cell on each axis.
using FluenceOutside = std::array<float, 6>;

// Returns the light that comes in through faces without cloud.
std::vector<Octet> light_from_outside(const DiffusionCells& cells, const FluenceOutside& outside);

// Light that starts in the cells of an octet. `place`: the mean of where, on each axis, from -1 at the lower face of a cell
// to 1 at the upper one.
struct StartingLight {
    Octet light;
    std::array<Octet, 3> place;
};

// A number of each face of the cells of an octet, in the order of DiffusionCells::to_neighbours.
using NumbersOfFaces = std::array<Octet, 6>;

// `source`: light that starts in the middles of cells. `leaving`: light that leaves through faces without cloud at once.
struct SharedLight {
    std::vector<Octet> source;
    std::vector<NumbersOfFaces> leaving;
};

// Returns the light of middles of cells that has the fluence of light that starts anywhere in them. Sunlight starts near
// lit faces where cells are optically thick: from their middles too little of it would come back, and too much would come
// through. Along a line the fluence of a source between two points of a lattice is that of two sources on these points,
// which share its light by the resistance to them; so each axis takes its share, and all together take at most all.
SharedLight share_light(const DiffusionCells& cells, const std::vector<StartingLight>& starting);

// Returns the fluence in all cells. `source`: the light that each of them scatters first or gets from outside; the element
// for no octet may be left out. `albedo`: of single scattering. Results depend neither on the number of threads nor on the
// instruction set.
std::vector<Octet> solve(const DiffusionCells& cells, const std::vector<Octet>& source, double albedo);

// Returns the same for `fine` cells, which are halved(wide), to a residual of 0.005: `wide` ones find quickly what differs
// over many cells. It takes three to six turns.
std::vector<Octet> solve(const DiffusionCells& fine, const DiffusionCells& wide, const std::vector<Octet>& source,
                         double albedo, int most_turns = 50);

// The light of a cell for interpolation: its weight, and the weight times fluence, and times flux to the east, north and
// up. In places between cells light is nearest to that of the optically thinner one. A cell without cloud has the light
// at the faces of those beside it; weight 0 where there are none.
using LightOfCells = std::array<Octet, 5>;

// Returns that of all octets and, last, of none. `leaving`: that of SharedLight, or none.
std::vector<LightOfCells> light_of_cells(const DiffusionCells& cells, const std::vector<Octet>& fluence,
                                         const FluenceOutside& outside, const std::vector<NumbersOfFaces>& leaving = {});

}  // namespace nephos
