// SPDX-License-Identifier: Apache-2.0
#pragma once

// PNG files of anybody (not installed): textures, cloud masks, pictures of a run or an export. libpng parses them, from memory: a
// file that is no regular one, as a pipe without a writer, is refused and not waited for, and a head that claims more pixels
// than the file can hold takes no memory. So are files with a chunk of any kind whose checksum is wrong, without an end, or whose
// pixels name a colour that the palette lacks. Colours are those of sRGB, or where a file has a gAMA chunk and no sRGB chunk, of
// that power; ICC profiles and primaries are not looked at. libpng is asked for samples alone: it takes sRGB for a power, which is
// 10 of 255 too much in dark greys, and in Debian 12 its simple interface mixes passes of 16 bits (its issue 853).

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace nephos {

// Limits what is accepted of a picture.
struct PngLimits {
    int side = std::numeric_limits<int>::max();  // pixels of the longer one; libpng takes a million
    std::uint64_t pixels = std::numeric_limits<std::uint64_t>::max();
    bool texts = false;  // of its text chunks, at most 64 of 64 KiB each are kept; else none
};

// An open PNG. Every function throws Error(io) "PATH: cannot be read as PNG: REASON", std::bad_alloc where memory is short.
class PngInput {
  public:
    // Reads the file, of at most 1 GiB, and its head.
    PngInput(const std::filesystem::path& path, const PngLimits& limits);
    // The same of a file in memory, which stays there. Errors are without "PATH: ".
    PngInput(std::span<const std::byte> file, const PngLimits& limits);
    ~PngInput();
    PngInput(const PngInput&) = delete;
    PngInput& operator=(const PngInput&) = delete;

    int width() const;
    int height() const;
    bool has_alpha() const;
    bool is_interlaced() const;
    // Returns how many samples a pixel has as it is stored: 1 grey, 2 grey and alpha, 3 red, green and blue, 4 these and
    // alpha; a palette's has 3 or 4.
    int channels() const;
    int bits() const;  // of a sample, 16, or 8 for 8 and fewer
    // Returns the text of that keyword in the chunks before the pixels; nothing without PngLimits::texts.
    std::optional<std::string> text(const std::string& keyword) const;

    // Decodes the pixels, once, with one of these. Rows from the top. What is transparent is over black, mixed as light.
    // Calls use(n, grey) of each: luminance (ITU-R BT.709) in sRGB, 0 to 255, not rounded.
    void each_grey(const std::function<void(std::size_t, double)>& use);
    std::vector<std::uint8_t> rgb();               // three a pixel, sRGB
    std::vector<std::byte> samples();              // as stored, 16 bits in this machine's order
    std::vector<std::uint16_t> luminance_alpha();  // two a pixel, of 65,535: linear light times alpha, alpha
    // Returns whether the file goes on behind the picture that has been decoded.
    bool goes_on() const;

  private:
    struct Decoder;
    struct Pixel;
    [[noreturn]] void fail(const std::string& reason) const;
    void open(std::span<const std::byte> file, const PngLimits& limits);
    template <typename Use>
    void read_rows(Use&& use);  // use(y, row) of each, from the top
    template <typename Use>
    void decode(Use&& use);  // use(n, pixel) of each, from the top

    std::filesystem::path path_;
    std::string file_;
    std::unique_ptr<Decoder> decoder_;
};

// Returns whether libpng gives this reason for a lack of memory.
bool is_lack_of_memory(std::string_view reason);

}  // namespace nephos
