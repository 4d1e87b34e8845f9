// SPDX-License-Identifier: Apache-2.0
#pragma once

// Occlusion of the interior of a cloud by its surroundings, for all directions of view: parts behind enough
// optical depth are invisible from anywhere. Private to the module.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace nephos {

// One number for each octant of a block (4 x 4 x 4 of its voxels).
using OfOctants = std::array<float, 8>;  // x fastest

// Returns for each octant of each block the least optical depth between it and the outside, clamped to
// `most`: the minimum, over all chains of octants that touch at faces, edges or corners, of the sum of
// `depths` without the octant's own. It is clamped to twice the octant's own depth as well, so that an octant
// in a hollow that fills gradually is not covered at once. All space without blocks is outside. `blocks`:
// numbers (voxel_blocks.h), rising.
std::vector<OfOctants> cover_of_octants(std::span<const std::uint64_t> blocks,
                                        std::span<const OfOctants> depths, float most);

}  // namespace nephos
