// SPDX-License-Identifier: Apache-2.0
#include <charconv>
#include <cmath>
#include <csetjmp>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include <png.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/png/png_input.h"
#include "core/text.h"
#include "render/image/exposure.h"
#include "render/image/image_file.h"
#include "render/image/tone_map.h"

namespace nephos {
namespace {

constexpr int kMaxSide = 16384;
constexpr int kCompressionLevel = 4;

using Texts = std::vector<std::pair<std::string, std::string>>;

// State shared with the callbacks of libpng while it writes. libpng reports errors by longjmp, so the functions between
// setjmp and the call have no objects with destructors; all memory is here, outside of them.
struct Exchange {
    std::string error;
    std::string file;  // written
    int width = 0, height = 0;
    std::vector<png_text> chunks;
    std::vector<png_bytep> rows;
};

void on_error(png_structp png, png_const_charp message) {
    static_cast<Exchange*>(png_get_error_ptr(png))->error = message;
    png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

void on_write(png_structp png, png_bytep bytes, png_size_t count) {
    bool stored = true;
    try {
        static_cast<Exchange*>(png_get_io_ptr(png))->file.append(reinterpret_cast<const char*>(bytes), count);
    } catch (const std::exception&) {
        stored = false;
    }
    if (!stored) png_error(png, "out of memory");
}

void on_flush(png_structp) {}

// False when libpng failed; then exchange.error says why.
bool encode(Exchange& exchange, png_structp png, png_infop info) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_set_write_fn(png, &exchange, on_write, on_flush);
    png_set_IHDR(png, info, png_uint_32(exchange.width), png_uint_32(exchange.height), 8, PNG_COLOR_TYPE_RGB,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
    // Dither makes a pixel a bad guess of the one below. With this one filter and level a file is as small,
    // up to a tenth, as with the choice among all filters at level 6, and takes a fourth of the time.
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    png_set_compression_level(png, kCompressionLevel);
    png_set_text(png, info, exchange.chunks.data(), int(exchange.chunks.size()));
    png_write_info(png, info);
    png_write_image(png, exchange.rows.data());
    png_write_end(png, nullptr);
    return true;
}

void point_rows(Exchange& exchange, std::uint8_t* rgb, int width, int height) {
    exchange.width = width;
    exchange.height = height;
    exchange.rows.resize(std::size_t(height));
    const std::size_t row = 3 * std::size_t(width);
    for (std::size_t y = 0; y < exchange.rows.size(); ++y) exchange.rows[y] = rgb + y * row;
}

std::string exact(double value) { return number_text(value, 17); }

Texts text_of(const PictureMetadata& metadata, const RenderOptions& options) {
    Texts texts{{"Software", "nephos" + (metadata.version.empty() ? "" : " " + metadata.version)}};
    const auto add = [&](const char* key, const std::string& value) {
        if (!value.empty()) texts.emplace_back(key, value);
    };
    add("scene", metadata.scene);
    add("seed", std::to_string(metadata.seed));
    add("sceneHash", metadata.scene_hash);
    add("stateHash", metadata.state_hash);
    add("backend", metadata.backend);
    add("device", metadata.device);
    add("time", exact(metadata.time_s));
    if (metadata.extinction_per_m > 0) add("extinctionPerMetre", exact(metadata.extinction_per_m));
    add("exposure", exact(options.camera.exposure_ev));
    return texts;
}

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what,
                       const std::string& reason) {
    throw Error(ErrorCode::io, path.string() + ": " + what + ": " + reason);
}

}  // namespace

RenderOptions with_exposure(const RenderOptions& options, const Picture& picture) {
    RenderOptions exposed = options;
    exposed.camera.exposure_ev = exposure_ev(picture, options.camera);
    exposed.camera.exposure = Exposure::manual;
    return exposed;
}

Rgb8Image srgb8_image(const Picture& picture, const RenderOptions& options) {
    if (picture.width < 1 || picture.height < 1 || picture.beauty.size() != 3 * picture.pixels())
        throw Error(ErrorCode::usage, "picture: its layers do not have the size that it states");
    return {picture.width, picture.height, to_srgb8(picture, options.camera)};
}

void write_png(const std::filesystem::path& path, const Picture& picture, const RenderOptions& options,
               const PictureMetadata& metadata) {
    const RenderOptions exposed = with_exposure(options, picture);
    write_png(path, srgb8_image(picture, exposed), exposed, metadata);
}

void write_png(const std::filesystem::path& path, const Rgb8Image& image, const RenderOptions& options,
               const PictureMetadata& metadata) {
    if (image.width < 1 || image.height < 1 ||
        image.rgb.size() != std::size_t(3) * std::size_t(image.width) * std::size_t(image.height))
        throw Error(ErrorCode::usage, "image: its pixels do not have the size that it states");
    Exchange exchange;
    // libpng does not write to the rows that it takes as changeable.
    point_rows(exchange, const_cast<std::uint8_t*>(image.rgb.data()), image.width, image.height);
    Texts texts = text_of(metadata, options);
    for (auto& [key, value] : texts) {
        png_text chunk{};
        chunk.compression = PNG_ITXT_COMPRESSION_NONE;  // the chunk kind that holds UTF-8
        chunk.key = key.data();
        chunk.text = value.data();
        chunk.itxt_length = value.size();
        exchange.chunks.push_back(chunk);
    }
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &exchange, on_error, on_warning);
    png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
    const bool encoded = info != nullptr && encode(exchange, png, info);
    png_destroy_write_struct(&png, &info);
    if (!encoded) fail(path, "cannot write PNG", exchange.error.empty() ? "out of memory" : exchange.error);
    write_atomically(path, std::string_view(exchange.file));
}

double read_png_exposure(const std::filesystem::path& path) {
    const std::optional<std::string> text =
        PngInput(path, {.side = kMaxSide, .texts = true}).text("exposure");
    double value = 0;
    const char* end = text ? text->data() + text->size() : nullptr;
    if (text)
        if (const auto [rest, error] = std::from_chars(text->data(), end, value);
            error == std::errc() && rest == end && std::isfinite(value))
            return value;
    fail(path, "cannot read the exposure of the PNG", "it has no text chunk \"exposure\" with a number");
}

Rgb8Image read_png(const std::filesystem::path& path) {
    PngInput png(path, {.side = kMaxSide});
    return {png.width(), png.height(), png.rgb()};
}

}  // namespace nephos
