// SPDX-License-Identifier: Apache-2.0
#pragma once

// Options of ground that is not level; plain data. render/terrain/height_map.h has what they make.

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>

namespace nephos {

// Heights that are generated.
enum class Relief {
    none,
    hills,   // rounded
    ridges,  // mountains with crests and valleys
};

struct TerrainOptions {
    // A picture of heights, north up: PNG of 16 bits, raw 16-bit numbers or EXR in metres (render/terrain/height_file.h).
    std::optional<std::filesystem::path> height_map;
    Relief relief = Relief::none;       // instead of a file
    int raw_columns = 0, raw_rows = 0;  // of a raw file, which does not say it
    double x_m = 0, y_m = 0;            // world position of its middle
    double width_m = 40'000, length_m = 40'000;  // from west to east, from south to north, 10..1e6
    // Height of the largest number of 16 bits above 0; of relief: of its highest summit above its deepest valley. Without
    // effect on EXR. 0..20,000 m.
    double height_scale_m = 2'000;
    double offset_m = 0;   // world height of number 0, added to the metres of EXR, -1e5..1e5
    double edge = 0.1;     // outer share of the sides over which it goes down to Ground::height_m, 0..0.5
    int cells = 1024;      // of relief, on a side, 16..4096
    double feature_m = 9'000;  // of relief: distance between large summits, 100..1e5
    std::uint64_t seed = 1;    // of relief
    // What covers it: Ground's albedo and pattern on gentle slopes, rock from about this slope on, snow above a height.
    double rock_slope_deg = 36;  // 0..90; 90: no rock
    std::array<double, 3> rock_albedo{0.17, 0.155, 0.14};  // 0..1
    double snow_line_m = std::numeric_limits<double>::infinity();  // world height; infinity: no snow
    bool operator==(const TerrainOptions&) const = default;
    bool any() const { return height_map.has_value() || relief != Relief::none; }
};

}  // namespace nephos
