// SPDX-License-Identifier: Apache-2.0
#pragma once

// Computes how far rays through a CoverageField may go without meeting cloud (not installed).

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "density/detail.h"

namespace nephos {

// Returns CoverageField::cells() for its nodes(), places(), table() and bricks(). A cell may hold cloud when the largest
// of its nodes may at `most` times the density; `cloud_odds`: ErosionConstants::cloud_odds().
std::vector<std::uint8_t> cells_of(std::span<const std::uint8_t> nodes, std::span<const std::int32_t> places,
                                   std::span<const std::int32_t> table, const std::array<int, 3>& bricks,
                                   float cloud_odds, float most);

// Replaces the negative numbers of CoverageField::table() by the empty cubes that begin there.
void set_distances(std::span<std::int32_t> table, const std::array<int, 3>& bricks);

}  // namespace nephos
