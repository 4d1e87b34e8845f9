// SPDX-License-Identifier: Apache-2.0
#pragma once

// Cloud masks of others, from observations or from other models, and their statistics by the definitions of the runs
// of a study, so that they can be the targets of a fit.
//
//     .vdb    a float grid above the threshold, or a bool or mask grid; voxel size and heights are those of the file
//     .nc     NetCDF classic (nccopy -k classic makes one of NetCDF-4): a variable over (time,) (z,) y, x, the last
//             fastest, as their CF attributes and names tell (cloud_mask_axes.h); levels of a coordinate that tells that they
//             go downwards are turned over. Several times are several snapshots. Values are unpacked, and missing ones (NaN,
//             _FillValue, missing_value, outside valid_range) are clear, and counted
//     .png    seen from above, north up; at most 2^28 pixels. Of a colour its luminance, of 255 as in sRGB, what is transparent over black
//
// A picture, and a variable without levels or with one whose height is not given, is a view from above: what needs a vertical
// has no value.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
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
    double cell_size_m = 0, level_height_m = 0;
    std::vector<double> bases_m;  // lower face of the lowest level, of each snapshot
    Boundaries boundaries;
    bool seen_from_above = false;  // the one level stands for all of them
    std::uint64_t missing = 0;     // values of all snapshots that are missing, and count as clear
    // Each with the file, or the first of several, that it is about: missing values, dimensions taken by their places.
    std::vector<std::string> notes;
    std::string files = {};  // that they are of, for messages: "a.nc", "a.nc and 3 more"
};

// Returns whether a statistic has no value in a view from above.
bool needs_levels(std::string_view statistic);

// Reads the masks of one or several files, one after the other. Throws Error(usage) on options that contradict the file or
// are missing, and when files differ in extent or cell size, Error(io) when one cannot be read.
CloudMasks read_masks(const std::vector<std::filesystem::path>& paths, const MaskOptions& options);

struct MaskStatistics {
    // In the order of kStatistics; NaN where a mask has none (act, hum, lifetime, period), or a view from above. Errors: of the mean over
    // the snapshots, sd sqrt(tau / n); NaN of a single one. Of exponents and dimension: of the fit.
    std::array<SeriesMean, kStatistics.size()> statistics;
    Organisation organisation;  // mean over the snapshots with two clouds or more
    NullOrganisation random;    // the same of random shadows of the same cover
};

// Thread-safe. Equal masks give equal values. Throws Error(usage) when the clouds take more memory than there is.
MaskStatistics mask_statistics(const CloudMasks& masks);

}  // namespace nephos
