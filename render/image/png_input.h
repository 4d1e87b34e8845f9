// SPDX-License-Identifier: Apache-2.0
#pragma once

// PNG files of anybody (not installed). libpng parses them, from memory: a file that is no regular one, as a pipe without
// a writer, is refused and not waited for, and a head that claims more pixels than the file can hold takes no memory.

#include <cstddef>
#include <filesystem>
#include <string>

#include <png.h>

namespace nephos {

// An open PNG. Every function throws Error(io) "PATH: cannot be read as PNG: REASON".
class PngInput {
  public:
    // Reads the file, of at most 1 GiB, and its head; `most`: pixels on a side that are accepted.
    PngInput(const std::filesystem::path& path, png_uint_32 most);
    ~PngInput() { png_image_free(&image_); }
    PngInput(const PngInput&) = delete;
    PngInput& operator=(const PngInput&) = delete;

    int width() const { return int(image_.width); }
    int height() const { return int(image_.height); }
    bool has_alpha() const { return (image_.format & PNG_FORMAT_FLAG_ALPHA) != 0; }
    // Bytes that read() fills with this format (PNG_FORMAT_...).
    std::size_t bytes(png_uint_32 format);
    // Decodes; once, after bytes() with the format.
    void read(void* pixels);

  private:
    [[noreturn]] void fail(const std::string& reason) const;

    std::filesystem::path path_;
    std::string file_;
    png_image image_{};
};

}  // namespace nephos
