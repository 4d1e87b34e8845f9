// SPDX-License-Identifier: Apache-2.0
#pragma once

// Computes how far rays through a CoverageField may go without meeting cloud (not installed).

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "density/detail.h"

namespace nephos {

// Returns CoverageField::clearance() for its nodes(), places(), table() and bricks(), and three bytes more: kernels read
// words. A cell may hold cloud when the coverage of one of its nodes is above `least_coverage` at `most` times
// the density.
std::vector<std::uint8_t> clearance_of_cells(std::span<const std::uint8_t> nodes, std::span<const std::int32_t> places,
                                             std::span<const std::int32_t> table, const std::array<int, 3>& bricks,
                                             float least_coverage, float most);

// Replaces the negative numbers of CoverageField::table() by -n, n the distance in bricks to the next with cloud along
// the axis on which it is largest, at most 127.
void set_distances(std::span<std::int32_t> table, const std::array<int, 3>& bricks);

}  // namespace nephos
