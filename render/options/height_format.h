// SPDX-License-Identifier: Apache-2.0
#pragma once

// What can be said of TerrainOptions without reading its file.

#include <filesystem>

#include "render/options/terrain_options.h"

namespace nephos {

// Formats of height maps, by the ending of a file's name; `none`: another ending.
enum class HeightFormat { none, png, exr, raw };
HeightFormat height_format(const std::filesystem::path& file);

// Throws Error(usage) naming the option, its range and unit, unless all are in their ranges.
void check(const TerrainOptions& options);

}  // namespace nephos
