// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pictures with opacity from PNG files, for billboards.

#include <filesystem>
#include <vector>

namespace nephos {

// Row 0 is at the top, width * height values each.
struct AlphaImage {
    int width = 0, height = 0;
    std::vector<float> opacity;  // 0..1, alpha as it is in the file
    std::vector<float>
        bright;  // linear luminance of the file's colour (core/png/png_input.h), times opacity: 0..opacity
};

// Reads a PNG of any kind that has transparency, up to 8192 on a side. Throws Error(io) naming the file when it cannot
// be read, is no PNG, has no transparency or none but it: a billboard of it would be a rectangle, or nothing.
AlphaImage read_alpha_image(const std::filesystem::path& path);

}  // namespace nephos
