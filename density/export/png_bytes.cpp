// SPDX-License-Identifier: Apache-2.0
#include "density/export/png_bytes.h"

#include <bit>
#include <csetjmp>
#include <cstring>
#include <exception>
#include <new>
#include <utility>
#include <vector>

#include <png.h>
#include <zlib.h>

#include "core/error.h"
#include "core/png/png_input.h"

namespace nephos {
namespace {

// A picture while it is written; outlives the jumps of libpng.
struct Writing {
    const PngShape& shape;
    const std::function<void(std::uint32_t y, std::span<std::byte> row)>& fill;
    std::string bytes;
    std::vector<std::byte> row;
    char reason[128] = "";  // why libpng gave up
};

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
    auto& writing = *static_cast<Writing*>(png_get_error_ptr(png));
    std::strncpy(writing.reason, message, sizeof writing.reason - 1);
    png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

void append(png_structp png, png_bytep data, png_size_t size) {
    bool stored = true;
    try {
        static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), size);
    } catch (const std::exception&) {
        stored = false;
    }
    if (!stored) png_error(png, "out of memory");
}

void write_rows(png_structp png, png_infop info, Writing& writing) {
    const PngShape& shape = writing.shape;
    png_set_write_fn(png, &writing.bytes, append, nullptr);
    png_set_IHDR(png, info, shape.width, shape.height, shape.bits,
                 shape.channels == 1 ? PNG_COLOR_TYPE_GRAY : PNG_COLOR_TYPE_RGBA, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    png_set_compression_level(png, 1);
    png_set_compression_strategy(png, Z_RLE);
    png_write_info(png, info);
    if (shape.bits == 16 && std::endian::native == std::endian::little)
        png_set_swap(png);  // PNG is big-endian
    for (std::uint32_t y = 0; y < shape.height; ++y) {
        writing.fill(y, writing.row);
        png_write_row(png, reinterpret_cast<png_const_bytep>(writing.row.data()));
    }
    png_write_end(png, nullptr);
}

// Returns false when libpng cannot encode it.
bool encode(Writing& writing) {
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &writing, on_error, on_warning);
    png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
    if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {  // NOLINT: libpng reports by longjmp
        png_destroy_write_struct(&png, &info);
        return false;
    }
    write_rows(png, info, writing);
    png_destroy_write_struct(&png, &info);
    return true;
}

}  // namespace

std::string png_bytes(const std::filesystem::path& path, const PngShape& shape,
                      const std::function<void(std::uint32_t y, std::span<std::byte> row)>& fill) {
    const std::size_t pixel = std::size_t(shape.channels) * std::size_t(shape.bits / 8);
    Writing writing{shape, fill, {}, std::vector<std::byte>(std::size_t(shape.width) * pixel), {}};
    if (encode(writing)) return std::move(writing.bytes);
    if (*writing.reason == '\0' || is_lack_of_memory(writing.reason)) throw std::bad_alloc();
    throw Error(ErrorCode::io, path.string() + ": libpng cannot encode a picture of " +
                                   std::to_string(shape.width) + " x " + std::to_string(shape.height) +
                                   " pixels: " + writing.reason);
}

}  // namespace nephos
