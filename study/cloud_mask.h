// SPDX-License-Identifier: Apache-2.0
#pragma once

// Cloud masks of others, from observations or from other models, and their statistics by the definitions of the runs
// of a study, so that they can be the targets of a fit.
//
//     .vdb    a float grid above the threshold, or a bool or mask grid; voxel size and heights are those of the file
//     .nc     NetCDF classic (nccopy -k classic makes one of NetCDF-4): a variable over (time), (z,) y, x, the last
//             fastest; z upwards, y north. Several times are several snapshots. Values are unpacked, and missing ones (NaN,
//             _FillValue, missing_value, outside valid_range) are clear, and counted
//     .png    grey, seen from above, north up; one level; at most 2^30 pixels

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "statistics/organisation.h"
#include "study/run_statistics.h"

#include "automaton/lattice.h"

namespace nephos {

struct MaskOptions {
    std::string variable;  // of a NetCDF file, or the grid of a VDB file; empty: the only or the usual one
    std::optional<double> threshold;  // values above it are cloud; 0, of PNG 127
    // Edge of a column and height of a level in metres, above 0. A VDB file has both; the height is that edge by default.
    std::optional<double> cell_size_m, level_height_m;
    Boundaries boundaries;  // of x and y
    bool operator==(const MaskOptions&) const = default;
};

struct CloudMasks {
    std::vector<BitPlane> snapshots;                         // all of one extent, in the order of time
    double cell_size_m = 0, level_height_m = 0, base_m = 0;  // base_m: lower face of the lowest level
    Boundaries boundaries;
    std::uint64_t missing = 0;  // values of all snapshots that are missing, and count as clear
};

// Reads the masks of one or several files, one after the other. Throws Error(usage) on options that contradict the file or
// are missing, and when files differ in extent or cell size, Error(io) when one cannot be read.
CloudMasks read_masks(const std::vector<std::filesystem::path>& paths, const MaskOptions& options);

struct MaskStatistics {
    // In the order of kStatistics; NaN where a mask has none (act, hum, lifetime, period). Errors: of the mean over
    // the snapshots, sd sqrt(tau / n); NaN of a single one. Of exponents and dimension: of the fit.
    std::array<SeriesMean, kStatistics.size()> statistics;
    Organisation organisation;  // mean over the snapshots with two clouds or more
    NullOrganisation random;    // the same of random shadows of the same cover
};

// Thread-safe. Equal masks give equal values.
MaskStatistics mask_statistics(const CloudMasks& masks);

}  // namespace nephos
