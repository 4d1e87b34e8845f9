// SPDX-License-Identifier: Apache-2.0
#include "study/thumbnail.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include <png.h>

#include "core/error.h"

namespace nephos {
namespace {

constexpr int kSide = 96;     // pixels at most
constexpr double kDepth = 3;  // cloud cells of a column at which 1 - 1/e of full white is reached
constexpr int kGreys = 16;

std::string base64(const std::vector<std::uint8_t>& bytes) {
    constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    for (std::size_t n = 0; n < bytes.size(); n += 3) {
        std::uint32_t word = 0;
        for (std::size_t byte = 0; byte < 3; ++byte)
            word = word << 8 | (n + byte < bytes.size() ? bytes[n + byte] : 0u);
        for (std::size_t digit = 0; digit < 4; ++digit)
            text += n + digit <= bytes.size() ? kDigits[word >> (18 - 6 * digit) & 63] : '=';
    }
    return text;
}

std::vector<std::uint8_t> grey_png(const std::vector<std::uint8_t>& pixels, int width, int height) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = png_uint_32(width);
    image.height = png_uint_32(height);
    image.format = PNG_FORMAT_GRAY;
    png_alloc_size_t size = 0;
    std::vector<std::uint8_t> png;
    if (png_image_write_to_memory(&image, nullptr, &size, 0, pixels.data(), width, nullptr) != 0) {
        png.resize(size);
        if (png_image_write_to_memory(&image, png.data(), &size, 0, pixels.data(), width, nullptr) != 0) {
            png.resize(size);
            return png;
        }
    }
    throw Error(ErrorCode::io, std::string("cannot make a picture of a state: ") + image.message);
}

}  // namespace

std::string thumbnail_of(const BitPlaneView& cld) {
    const Extent& extent = cld.extent;
    std::vector<int> depths(std::size_t(extent.x) * std::size_t(extent.y));
    for (int k = 0; k < extent.z; ++k)
        for (int j = 0; j < extent.y; ++j) {
            const std::uint64_t* row = cld.row(j, k);
            for (int word = 0; word < int(cld.words_per_row); ++word)
                for (std::uint64_t bits = row[word]; bits != 0; bits &= bits - 1)
                    ++depths[linear_index(extent, word * 64 + std::countr_zero(bits), j, 0)];
        }
    std::vector<double> whiteness(std::size_t(extent.z) + 1);  // of a column of so many cells
    for (std::size_t n = 0; n < whiteness.size(); ++n) whiteness[n] = 1 - std::exp(-int(n) / kDepth);
    const int square = (std::max(extent.x, extent.y) + kSide - 1) / kSide;
    const int width = (extent.x + square - 1) / square, height = (extent.y + square - 1) / square;
    std::vector<std::uint8_t> pixels;
    for (int y = height; y-- > 0;)
        for (int x = 0; x < width; ++x) {
            double sum = 0;
            int columns = 0;
            for (int j = y * square; j < std::min((y + 1) * square, extent.y); ++j)
                for (int i = x * square; i < std::min((x + 1) * square, extent.x); ++i, ++columns)
                    sum += whiteness[std::size_t(depths[linear_index(extent, i, j, 0)])];
            pixels.push_back(std::uint8_t(std::lround(sum / columns * (kGreys - 1)) * (255 / (kGreys - 1))));
        }
    return base64(grey_png(pixels, width, height));
}

}  // namespace nephos
