// SPDX-License-Identifier: Apache-2.0
#pragma once

// Which of the dimensions of a NetCDF variable are time, levels, y and x. Private to study/.
//
// In this order: the attribute `axis` of the coordinate variable (T, Z, Y, X), its `standard_name`, its `units` ("hours
// since ...", degrees_north, degrees_east, a pressure), its `positive` (levels) (CF conventions 1.11, chapters 4 and 5); then
// the usual names of dimensions, in any case. Others are taken by their places, with a note.

#include <filesystem>
#include <string>

#include "study/netcdf_file.h"

namespace nephos {

struct MaskAxes {
    bool has_time = false, has_levels = false;
    bool downwards = false;  // the first level is the highest
    std::string note;        // of dimensions that are taken by their places; empty of none
};

// Throws Error(usage) when the variable has another number of dimensions or another order than (time,) (levels,) y, x,
// and says how to reorder it.
MaskAxes mask_axes(const std::filesystem::path& path, const NetcdfSource& source);

}  // namespace nephos
