// SPDX-License-Identifier: Apache-2.0
#pragma once

// Single clouds: the connected components of the cloud, seen from above or in space.
//
//     2-D   components of the shadow S (a column with any cloud cell); columns that share a side are connected, with
//           Neighbours::eight also those that share a corner. A cloud over another one counts as one with it.
//     3-D   components of the cloud cells; cells that share a face are connected.
//
// Clouds are joined across periodic sides. At an open side a cloud is `cut`: its true size is not known. Components are
// found by union-find over the runs of 1 bits of each row (Hoshen and Kopelman 1976, in the form of runs): the cost is
// that of runs, not of cells.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "statistics/cell_runs.h"

#include "automaton/lattice.h"

namespace nephos {

enum class Neighbours { four, eight };

// One cloud, in units of cells.
struct ConnectedCloud {
    std::uint64_t cells = 0;  // 2-D: covered columns; 3-D: cloud cells
    // Sides of columns (2-D) or faces of cells (3-D) towards clear air. The side of the box does not count where it is open.
    std::uint64_t edges = 0;
    // Centroid in cells, 0 <= x < nx; along a periodic axis the circular mean of the cells' positions.
    double x = 0, y = 0, z = 0;   // z = 0 of a 2-D cloud
    int lowest = 0, highest = 0;  // levels of its lowest and highest cell; 0 of a 2-D cloud
    bool cut = false;             // touches an open side
    bool spans = false;           // reaches from one open side to the opposite one
};

// Return the clouds in the order of their first cell in memory. Thread-safe.
std::vector<ConnectedCloud> clouds_2d(const BitPlaneView& cld, const Boundaries& boundaries,
                                      Neighbours neighbours = Neighbours::four);
std::vector<ConnectedCloud> clouds_3d(const BitPlaneView& cld, const Boundaries& boundaries);

// Returns how many runs of covered columns the shadow has, row by row.
std::uint64_t count_shadow_runs(const BitPlaneView& cld);
// Returns how many bytes clouds_2d() needs at most while it works, and organisation() (statistics/organisation.h) of what it
// returns, for a shadow with that many runs: each may be a cloud of its own.
std::size_t clouds_2d_bytes(const Extent& extent, std::uint64_t runs);

// Returns the clouds of clouds_2d() with four neighbours, but all centroids 0: sizes and edges take half the time.
std::vector<ConnectedCloud> cloud_sizes_2d(const BitPlaneView& cld, const Boundaries& boundaries);

// Where the clouds of clouds_2d() with four neighbours are: the shadow, its runs and the number of the cloud of each.
struct LabelledClouds {
    BitPlane shadow;
    RunNumbers runs;
    std::vector<std::uint32_t> cloud;  // of each run
    std::vector<std::uint8_t> cut;     // of each cloud: not 0 where it touches an open side
};
LabelledClouds labelled_clouds_2d(const BitPlaneView& cld, const Boundaries& boundaries);

}  // namespace nephos
