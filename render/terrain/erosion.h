// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where water runs on a height map, and how it wears it. Private to the module.

#include <cstdint>
#include <vector>

#include "render/terrain/height_map.h"

namespace nephos {

// The order in which water leaves a map: each node drains into the lowest of the eight around it once hollows are filled
// (Barnes, Lehman and Mulla 2014, priority flood), nodes of the sides out of the map.
struct Drainage {
    std::vector<std::uint32_t> order;     // nodes, each after the one that it drains into
    std::vector<std::uint32_t> receiver;  // of each node; itself where water leaves the map
    std::vector<float> filled_m;          // heights with hollows filled to their brims
};
Drainage drainage_of(const std::vector<float>& z_m, int columns, int rows);

// Returns the area that drains through each node, in cells: at least 1.
std::vector<float> drained_cells(const Drainage& drainage);

// Wears heights by the stream power law, dz/dt = uplift - K A^m dz/ds with m = 0.45, implicitly (Braun and Willett 2013),
// and rounds slopes by creep: rivers cut valleys that join like branches. Lengths are in cells, K is such that the result
// looks like mountains at some hundred cells on a side.
void erode(HeightImage& image);

}  // namespace nephos
