// SPDX-License-Identifier: Apache-2.0
#include "render/image/alpha_image.h"

#include <algorithm>
#include <cstdint>
#include <string>

#include "core/error.h"
#include "core/png/png_input.h"

namespace nephos {
namespace {

constexpr int kMaxSide = 8192;

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
    throw Error(ErrorCode::io, path.string() + ": " + reason);
}

}  // namespace

AlphaImage read_alpha_image(const std::filesystem::path& path) {
    PngInput png(path, {.side = kMaxSide});
    if (!png.has_alpha())
        fail(path, "has no alpha channel; expected a PNG with transparency, whose alpha is the opacity");
    const std::vector<std::uint16_t> pixels = png.luminance_alpha();
    AlphaImage image;
    image.width = png.width();
    image.height = png.height();
    image.opacity.reserve(pixels.size() / 2);
    image.bright.reserve(pixels.size() / 2);
    for (std::size_t at = 0; at + 1 < pixels.size(); at += 2) {
        image.opacity.push_back(float(pixels[at + 1]) / 65535.0f);
        image.bright.push_back(std::min(float(pixels[at]), float(pixels[at + 1])) / 65535.0f);
    }
    if (std::ranges::all_of(image.opacity, [](float opacity) { return opacity == 0; }))
        fail(path, "is transparent everywhere; expected something to see");
    return image;
}

}  // namespace nephos
