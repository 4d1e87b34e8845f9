// SPDX-License-Identifier: Apache-2.0
#pragma once

// How much cloud lies around each part of a cloud, whichever way one looks: what is covered by enough of it
// cannot be seen. No Vulkan here. Private to the module.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace nephos {

// A number for each octant of a block: 4 x 4 x 4 of its voxels
using OfOctants = std::array<float, 8>;  // x fastest

// The least optical depth between the outside and each octant of each block, at most `most`: over all chains
// of octants that touch each other, at their faces, edges or corners, the least sum of `depths`, without the
// octant's own, and at most twice that: what is thin is outside itself, so that a hollow that fills is not
// covered at once. What is in no block is outside. `blocks`: numbers
// (voxel_blocks.h), rising.
std::vector<OfOctants> cover_of_octants(std::span<const std::uint64_t> blocks,
                                        std::span<const OfOctants> depths, float most);

}  // namespace nephos
