// SPDX-License-Identifier: Apache-2.0
#pragma once

// The cells of the equation of diffusion.h, as wide as two cells of the lattice or as one. Eight of them are an octet, numbers
// next to each other, x fastest, as the bits of a cell's number. Of wide cells each brick of CoverageField has one octet, of
// cells of the lattice eight, each in the wide cell of its number. Along an axis a cell has one neighbour in its own octet,
// the inner one, whose number differs in the axis' bit, and one in the octet beside, the outer one, with that same number.
// Neighbours are then whole octets, with lanes exchanged. Private to the module.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "density/detail.h"

namespace nephos {

inline constexpr std::size_t kDiffusionCells = 8;  // of an octet

// A number of each cell of an octet.
struct alignas(32) Octet {
    std::array<float, kDiffusionCells> of{};
};

// An immutable value once made. Those of its vectors that hold cells have an element more, for octets that there are not.
struct DiffusionCells {
    std::size_t octets = 0;           // wide: all bricks'; else those with cloud in them or beside them
    std::size_t octets_of_brick = 0;  // 1 or 8
    float mean_cosine = 0, edge_m = 0;
    std::vector<std::int32_t> places;   // of each octet: octets_of_brick * brick + its number in the brick, rising
    std::vector<std::int32_t> numbers;  // of octets by their place; `octets` where there is none
    std::vector<Octet> thickness;       // reduced optical, along an edge; 0: no cloud
    // Flux per difference of fluence: to the inner and to the outer neighbour on each axis, 0 where it is no cloud; and
    // through each face beyond which there is none.
    std::vector<std::array<Octet, 6>> to_neighbours;
    std::vector<Octet> to_outside;
    // The octets below and above each on each axis. Of a field that repeats, with edges of whole bricks, they are those of
    // the first period throughout, and so are the bricks around.
    std::vector<std::array<std::int32_t, 6>> beside;
    // The 27 bricks around each and itself, x fastest; their count where there is none.
    std::vector<std::array<std::int32_t, 27>> around;
    std::vector<std::int32_t> active;  // octets with a thickness above 0, rising

    std::size_t brick_of(std::size_t octet) const { return std::size_t(places[octet]) / octets_of_brick; }
    std::size_t within_brick(std::size_t octet) const { return std::size_t(places[octet]) % octets_of_brick; }
    // Returns an octet of a brick, or the one that stands for none.
    std::size_t octet_of(std::int32_t brick, std::size_t within) const {
        const std::size_t place = std::size_t(brick) * octets_of_brick + within;
        return std::size_t(brick) < around.size() ? std::size_t(numbers[place]) : octets;
    }
};

// Returns cells of two lattice cells. `extinction`: per metre, one number for each lattice cell of each brick, x fastest.
// `mean_cosine`: g < 1.
DiffusionCells wide_cells(const CoverageField& field, std::span<const float> extinction, double mean_cosine);

// Returns whether light changes much within wide cells where the extinction is the field's largest.
bool is_thick(const DiffusionCells& wide, double extinction_per_m);

// Returns the cells of the lattice in wide ones.
DiffusionCells halved(const DiffusionCells& wide, std::span<const float> extinction);

}  // namespace nephos
