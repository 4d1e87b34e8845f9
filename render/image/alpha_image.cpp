// SPDX-License-Identifier: Apache-2.0
#include "render/image/alpha_image.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>

#include <png.h>

#include "core/error.h"

namespace nephos {
namespace {

constexpr png_uint_32 kMaxSide = 8192;

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
    throw Error(ErrorCode::io, path.string() + ": " + reason);
}

}  // namespace

AlphaImage read_alpha_image(const std::filesystem::path& path) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    const std::unique_ptr<png_image, void (*)(png_image*)> cleanup(&png, png_image_free);
    const auto require = [&](bool done) {
        if (!done) fail(path, std::string("cannot be read as PNG: ") + png.message);
    };
    require(png_image_begin_read_from_file(&png, path.c_str()) != 0);
    if (png.width > kMaxSide || png.height > kMaxSide) {
        fail(path, "is " + std::to_string(png.width) + " x " + std::to_string(png.height) +
                       " pixels; expected at most " + std::to_string(kMaxSide) + " on a side");
    }
    if ((png.format & PNG_FORMAT_FLAG_ALPHA) == 0)
        fail(path, "has no alpha channel; expected a PNG with transparency, whose alpha is the opacity");
    png.format = PNG_FORMAT_LINEAR_Y_ALPHA;  // 16 bits, luminance times alpha
    std::vector<std::uint16_t> pixels(PNG_IMAGE_SIZE(png) / sizeof(std::uint16_t));
    require(png_image_finish_read(&png, nullptr, pixels.data(), 0, nullptr) != 0);
    AlphaImage image;
    image.width = int(png.width);
    image.height = int(png.height);
    for (std::size_t at = 0; at + 1 < pixels.size(); at += 2) {
        image.opacity.push_back(float(pixels[at + 1]) / 65535.0f);
        image.bright.push_back(std::min(float(pixels[at]), float(pixels[at + 1])) / 65535.0f);
    }
    if (std::ranges::all_of(image.opacity, [](float opacity) { return opacity == 0; }))
        fail(path, "is transparent everywhere; expected something to see");
    return image;
}

}  // namespace nephos
