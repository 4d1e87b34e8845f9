// SPDX-License-Identifier: Apache-2.0
#pragma once

// The equation of diffusion.h on cells of two lattice cells, and its solution. Eight cells make a brick of CoverageField,
// and are numbers next to each other: x fastest, as the bits of a cell's number. Along an axis a cell has one neighbour
// in its own brick, the inner one, whose number differs in the axis' bit, and one in the brick beside, the outer one,
// with that same number. Neighbours are then whole bricks, with lanes exchanged. Private to the module.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "density/detail.h"

namespace nephos {

inline constexpr std::size_t kDiffusionCells = 8;  // of a brick

// A number of each cell of a brick.
struct alignas(32) BrickOfCells {
    std::array<float, kDiffusionCells> of{};
};

// An immutable value once made. Those of its vectors that hold cells have an element more, for bricks without cloud.
struct DiffusionCells {
    // `extinction`: per metre, one number for each lattice cell of each brick, x fastest. `mean_cosine`: g < 1.
    DiffusionCells(const CoverageField& field, std::span<const float> extinction, double mean_cosine);

    std::size_t bricks = 0;  // that hold cloud
    float mean_cosine = 0;
    std::vector<BrickOfCells> thickness;  // reduced optical, along an edge; 0: no cloud
    // Flux per difference of fluence: to the inner and to the outer neighbour on each axis, 0 where it is no cloud; and
    // through each face beyond which there is none.
    std::vector<std::array<BrickOfCells, 6>> to_neighbours;
    std::vector<BrickOfCells> to_outside;
    // The bricks below and above each on each axis, and the 27 around each and itself, x fastest; `bricks` where there is
    // none. Of a field that repeats, with edges of whole bricks, they are those of the first period throughout.
    std::vector<std::array<std::int32_t, 6>> beside;
    std::vector<std::array<std::int32_t, 27>> around;
    std::vector<std::int32_t> active;  // bricks with a thickness above 0, rising
};

// Fluence beyond faces without cloud: below and above a cell on each axis.
using FluenceOutside = std::array<float, 6>;

// Returns the light that comes in through faces without cloud.
std::vector<BrickOfCells> light_from_outside(const DiffusionCells& cells, const FluenceOutside& outside);

// Light that starts in the cells of a brick. `place`: the mean of where, on each axis, from -1 at the lower face of a cell
// to 1 at the upper one.
struct StartingLight {
    BrickOfCells light;
    std::array<BrickOfCells, 3> place;
};

// A number of each face of the cells of a brick, in the order of DiffusionCells::to_neighbours.
using NumbersOfFaces = std::array<BrickOfCells, 6>;

// `source`: light that starts in the middles of cells. `leaving`: light that leaves through faces without cloud at once.
struct SharedLight {
    std::vector<BrickOfCells> source;
    std::vector<NumbersOfFaces> leaving;
};

// Returns the light of middles of cells that has the fluence of light that starts anywhere in them. Sunlight starts near
// lit faces where cells are optically thick: from their middles too little of it would come back, and too much would come
// through. Along a line the fluence of a source between two points of a lattice is that of two sources on these points,
// which share its light by the resistance to them; so each axis takes its share, and all together take at most all.
SharedLight share_light(const DiffusionCells& cells, const std::vector<StartingLight>& starting);

// Returns the fluence in all cells. `source`: the light that each of them scatters first or gets from outside. `albedo`:
// of single scattering. Results depend neither on the number of threads nor on the instruction set.
std::vector<BrickOfCells> solve(const DiffusionCells& cells, const std::vector<BrickOfCells>& source, double albedo);

// The light of a cell for interpolation: its weight, and the weight times fluence, and times flux to the east, north and
// up. In places between cells light is nearest to that of the optically thinner one. A cell without cloud has the light
// at the faces of those beside it; weight 0 where there are none.
using LightOfCells = std::array<BrickOfCells, 5>;

// Returns that of all bricks and, last, of none. `leaving`: that of SharedLight, or none.
std::vector<LightOfCells> light_of_cells(const DiffusionCells& cells, const std::vector<BrickOfCells>& fluence,
                                         const FluenceOutside& outside, const std::vector<NumbersOfFaces>& leaving = {});

}  // namespace nephos
