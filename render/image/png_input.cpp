// SPDX-License-Identifier: Apache-2.0
#include "render/image/png_input.h"

#include <cstdint>
#include <system_error>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr std::size_t kMostBytes = std::size_t(1) << 30;
// Deflate makes at most 1,032 bytes of one, and a pixel has at least a bit.
constexpr std::uint64_t kPixelsOfByte = 8 * 1032;

}  // namespace

PngInput::PngInput(const std::filesystem::path& path, png_uint_32 most) : path_(path) {
    image_.version = PNG_IMAGE_VERSION;
    require_regular_file(path);
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    if (error) fail(error.message());
    if (size > kMostBytes)
        fail("it has " + std::to_string(size) + " bytes; expected at most " + std::to_string(kMostBytes));
    file_ = read_beginning(path, std::size_t(size));
    if (png_image_begin_read_from_memory(&image_, file_.data(), file_.size()) == 0) fail(image_.message);
    image_.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;  // else 16 bits that do not say so are taken for linear light
    const std::string claim =
        std::to_string(image_.width) + " x " + std::to_string(image_.height) + " pixels";
    std::string reason;
    if (image_.width > most || image_.height > most)
        reason = "it is " + claim + "; expected at most " + std::to_string(most) + " on a side";
    else if (std::uint64_t(image_.width) * image_.height > file_.size() * kPixelsOfByte)
        reason = "it is damaged: its head claims " + claim + ", more than " + std::to_string(file_.size()) +
                 " bytes can hold";
    if (reason.empty()) return;
    png_image_free(&image_);
    fail(reason);
}

std::size_t PngInput::bytes(png_uint_32 format) {
    image_.format = format;
    return PNG_IMAGE_SIZE(image_);
}

void PngInput::read(void* pixels) {
    if (png_image_finish_read(&image_, nullptr, pixels, 0, nullptr) == 0) fail(image_.message);
}

void PngInput::fail(const std::string& reason) const {
    throw Error(ErrorCode::io, path_.string() + ": cannot be read as PNG: " + reason);
}

}  // namespace nephos
