// SPDX-License-Identifier: Apache-2.0
#include "core/png/png_input.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <csetjmp>
#include <cstring>
#include <new>
#include <system_error>

#include <png.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/srgb.h"

namespace nephos {
namespace {

constexpr std::size_t kMostBytes = std::size_t(1) << 30;
constexpr std::uint64_t kMostInflated = 1032;  // bytes that deflate makes of one
constexpr png_uint_32 kMostTexts = 64;
constexpr png_alloc_size_t kMostText = png_alloc_size_t(1) << 16;  // bytes of each
constexpr double kPowerOfSrgb = 2.2, kNear = 0.05;  // 1 / gAMA, to that part, means the curve of sRGB

std::uint8_t byte_of_light(float light) { return std::uint8_t(std::lround(255 * encode_srgb(light))); }

}  // namespace

// Holds what libpng has of a file. It reports errors by longjmp(): between setjmp() and its calls nothing has a destructor. The functions
// return false where it failed.
struct PngInput::Decoder {
    std::span<const std::byte> left;  // of the file
    png_structp png = nullptr;
    png_infop info = nullptr;
    char error[200] = "";
    png_uint_32 width = 0, height = 0;
    bool has_alpha = false;
    double power = 0;             // of a code, to its light; 0: the curve of sRGB
    int channels = 0, bytes = 0;  // of a pixel, and of a sample, of the rows
    int passes = 1;
    int colours = 0;  // of the palette; 0: none
    std::array<std::array<png_byte, 4>, 256> palette{};

    Decoder() = default;
    Decoder(const Decoder&) = delete;
    Decoder& operator=(const Decoder&) = delete;
    ~Decoder() { png_destroy_read_struct(&png, &info, nullptr); }

    bool read_head(bool keep_texts);
    bool begin_rows();
    bool read_row(std::uint8_t* row);
    bool read_end();
    // Writes the colours of a row of indices; false where the palette lacks one.
    bool fill_colours(const std::uint8_t* indices, std::uint8_t* row) const {
        for (std::size_t x = 0; x < width; ++x, row += channels) {
            if (indices[x] >= colours) return false;
            std::copy_n(palette[indices[x]].data(), channels, row);
        }
        return true;
    }
    std::size_t stored_row_bytes() const { return colours > 0 ? std::size_t(width) : row_bytes(); }
    std::size_t row_bytes() const { return std::size_t(width) * std::size_t(channels) * std::size_t(bytes); }

  private:
    void take_palette();
    [[noreturn]] static void on_error(png_structp png, png_const_charp message) {
        auto* self = static_cast<Decoder*>(png_get_error_ptr(png));
        std::strncpy(self->error, message, sizeof self->error - 1);
        png_longjmp(png, 1);
    }
    static void on_warning(png_structp, png_const_charp) {}
    static void take(png_structp png, png_bytep to, png_size_t size) {
        auto* self = static_cast<Decoder*>(png_get_io_ptr(png));
        if (size > self->left.size()) png_error(png, "it ends early");
        std::memcpy(to, self->left.data(), size);
        self->left = self->left.subspan(size);
    }
};

bool PngInput::Decoder::read_head(bool keep_texts) {
    png = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning);
    info = png != nullptr ? png_create_info_struct(png) : nullptr;
    if (info == nullptr) throw std::bad_alloc();
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_set_read_fn(png, this, take);
    png_set_crc_action(png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
    // Leaves out what else may be in a file: profiles, and texts that may be packed.
    constexpr png_byte kKept[] = "gAMA\0sRGB\0tEXt\0zTXt\0iTXt";
    png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_AS_DEFAULT, kKept, keep_texts ? 5 : 2);
    png_set_chunk_cache_max(png, kMostTexts);
    png_set_chunk_malloc_max(png, kMostText);
    png_read_info(png, info);
    width = png_get_image_width(png, info);
    height = png_get_image_height(png, info);
    has_alpha = (png_get_color_type(png, info) & PNG_COLOR_MASK_ALPHA) != 0 ||
                png_get_valid(png, info, PNG_INFO_tRNS) != 0;
    double gamma = 0;
    if (png_get_valid(png, info, PNG_INFO_sRGB) == 0 && png_get_gAMA(png, info, &gamma) != 0 && gamma > 0 &&
        std::abs(gamma * kPowerOfSrgb - 1) > kNear)
        power = 1 / gamma;
    return true;
}

bool PngInput::Decoder::begin_rows() {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_set_chunk_malloc_max(png, 0);  // what follows the pixels is skipped, however long
    png_set_benign_errors(png, 0);     // more pixels than there are, or another checksum of them, is damage
    if (png_get_color_type(png, info) == PNG_COLOR_TYPE_PALETTE) {
        png_set_packing(png);  // a byte an index
        take_palette();
    } else {
        png_set_expand(png);
    }
    if (std::endian::native == std::endian::little) png_set_swap(png);  // PNG has the high byte first
    passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    channels = colours == 0 ? png_get_channels(png, info) : has_alpha ? 4 : 3;
    bytes = png_get_bit_depth(png, info) / 8;
    return true;
}

void PngInput::Decoder::take_palette() {
    png_colorp found = nullptr;
    png_get_PLTE(png, info, &found, &colours);
    png_bytep alpha = nullptr;
    int count = 0;
    png_get_tRNS(png, info, &alpha, &count, nullptr);
    for (int n = 0; n < colours; ++n)
        palette[std::size_t(n)] = {found[n].red, found[n].green, found[n].blue,
                                   n < count ? alpha[n] : png_byte(255)};
}

// Reads a row; of an interlaced picture once a pass, into what was read of it.
bool PngInput::Decoder::read_row(std::uint8_t* row) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_read_row(png, row, nullptr);
    return true;
}

bool PngInput::Decoder::read_end() {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_read_end(png, nullptr);
    return true;
}

// A pixel, with what its codes are: light 0..1, and bytes of sRGB.
struct PngInput::Pixel {
    std::array<unsigned, 3> codes;  // red, green, blue
    float alpha;
    const float* light;
    const std::uint8_t* shown;

    bool is_grey() const { return codes[0] == codes[1] && codes[1] == codes[2]; }
    float luminance() const {
        if (is_grey()) return light[codes[0]];
        return 0.2126f * light[codes[0]] + 0.7152f * light[codes[1]] + 0.0722f * light[codes[2]];
    }
    std::uint8_t byte(unsigned code) const {
        return alpha == 1 ? shown[code] : byte_of_light(light[code] * alpha);
    }
};

PngInput::PngInput(const std::filesystem::path& path, const PngLimits& limits)
    : path_(path), decoder_(std::make_unique<Decoder>()) {
    require_regular_file(path);
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    if (error) fail(error.message());
    if (size > kMostBytes)
        fail("it has " + std::to_string(size) + " bytes; expected at most " + std::to_string(kMostBytes));
    file_ = read_beginning(path, std::size_t(size));
    open(std::as_bytes(std::span(file_)), limits);
}

PngInput::PngInput(std::span<const std::byte> file, const PngLimits& limits)
    : decoder_(std::make_unique<Decoder>()) {
    open(file, limits);
}

void PngInput::open(std::span<const std::byte> file, const PngLimits& limits) {
    decoder_->left = file;
    if (!decoder_->read_head(limits.texts)) fail(decoder_->error);
    const std::string claim =
        std::to_string(decoder_->width) + " x " + std::to_string(decoder_->height) + " pixels";
    const std::uint64_t pixels = std::uint64_t(decoder_->width) * decoder_->height;
    const auto side = std::uint64_t(limits.side);
    if (decoder_->width > side || decoder_->height > side || pixels > limits.pixels) {
        const bool counts = limits.pixels < side * side;
        fail("it is " + claim + "; expected at most " + std::to_string(side) + " on a side" +
             (counts ? " and " + std::to_string(limits.pixels) + " in all" : ""));
    }
    if (png_get_rowbytes(decoder_->png, decoder_->info) * std::uint64_t(decoder_->height) >
        file.size() * kMostInflated)
        fail("it is damaged: its head claims " + claim + ", more than " + std::to_string(file.size()) +
             " bytes can hold");
    if (!decoder_->begin_rows()) fail(decoder_->error);
}

PngInput::~PngInput() = default;

int PngInput::width() const { return int(decoder_->width); }
int PngInput::height() const { return int(decoder_->height); }
bool PngInput::has_alpha() const { return decoder_->has_alpha; }
bool PngInput::is_interlaced() const { return decoder_->passes > 1; }
int PngInput::channels() const { return decoder_->channels; }
int PngInput::bits() const { return 8 * decoder_->bytes; }
bool PngInput::goes_on() const { return !decoder_->left.empty(); }

std::optional<std::string> PngInput::text(const std::string& keyword) const {
    png_textp texts = nullptr;
    const int count = png_get_text(decoder_->png, decoder_->info, &texts, nullptr);
    for (int n = 0; n < count; ++n)
        if (texts[n].key == keyword) return texts[n].text;
    return std::nullopt;
}

// Reads all rows of an interlaced picture in each pass, and uses them after the last one.
template <typename Use>
void PngInput::read_rows(Use&& use) {
    Decoder& d = *decoder_;
    const std::size_t row_bytes = d.stored_row_bytes();
    std::vector<std::uint8_t> colours(d.row_bytes());
    const auto use_row = [&](std::size_t y, const std::uint8_t* stored) {
        if (d.colours == 0) return use(y, stored);
        if (!d.fill_colours(stored, colours.data())) fail("a pixel names a colour that the palette lacks");
        use(y, static_cast<const std::uint8_t*>(colours.data()));
    };
    std::vector<std::uint8_t> rows(is_interlaced() ? row_bytes * d.height : row_bytes);
    const auto row = [&](std::size_t y) { return rows.data() + (is_interlaced() ? y * row_bytes : 0); };
    for (int pass = 0; pass < d.passes; ++pass)
        for (std::size_t y = 0; y < d.height; ++y) {
            if (!d.read_row(row(y))) fail(d.error);
            if (!is_interlaced()) use_row(y, row(y));
        }
    if (!d.read_end()) fail(d.error);
    for (std::size_t y = 0; is_interlaced() && y < d.height; ++y) use_row(y, row(y));
}

template <typename Use>
void PngInput::decode(Use&& use) {
    const Decoder& d = *decoder_;
    const unsigned most = d.bytes == 1 ? 255 : 65535;
    std::vector<float> light;
    std::vector<std::uint8_t> shown;
    for (unsigned code = 0; code <= most; ++code) {
        const float part = float(code) / float(most);
        light.push_back(d.power > 0 ? float(std::pow(double(part), d.power)) : decode_srgb(part));
        shown.push_back(d.power > 0 ? byte_of_light(light.back()) : std::uint8_t(std::lround(255 * part)));
    }
    const auto channels = std::size_t(d.channels);
    const std::size_t colours = channels < 3 ? 1 : 3;
    read_rows([&](std::size_t y, const std::uint8_t* row) {
        const auto code = [&](std::size_t at) -> unsigned {
            if (d.bytes == 1) return row[at];
            std::uint16_t value = 0;
            std::memcpy(&value, row + 2 * at, sizeof value);
            return value;
        };
        for (std::size_t x = 0, at = 0; x < d.width; ++x, at += channels) {
            Pixel pixel{{}, 1, light.data(), shown.data()};
            for (std::size_t c = 0; c < 3; ++c) pixel.codes[c] = code(at + (colours == 3 ? c : 0));
            if (channels > colours) pixel.alpha = float(code(at + colours)) / float(most);
            use(y * d.width + x, pixel);
        }
    });
}

void PngInput::each_grey(const std::function<void(std::size_t, double)>& use) {
    const unsigned most = decoder_->bytes == 1 ? 255 : 65535;
    const bool is_srgb = !(decoder_->power > 0);
    decode([&](std::size_t n, const Pixel& pixel) {
        const bool is_stored = is_srgb && pixel.is_grey() && pixel.alpha == 1;
        use(n, is_stored ? 255.0 * pixel.codes[0] / most
                         : 255 * double(encode_srgb(pixel.luminance() * pixel.alpha)));
    });
}

std::vector<std::uint8_t> PngInput::rgb() {
    std::vector<std::uint8_t> pixels(std::size_t(3) * std::size_t(width()) * std::size_t(height()));
    decode([&](std::size_t n, const Pixel& pixel) {
        for (std::size_t c = 0; c < 3; ++c) pixels[3 * n + c] = pixel.byte(pixel.codes[c]);
    });
    return pixels;
}

std::vector<std::byte> PngInput::samples() {
    const std::size_t row_bytes = decoder_->row_bytes();
    std::vector<std::byte> samples(row_bytes * decoder_->height);
    read_rows([&](std::size_t y, const std::uint8_t* row) {
        std::memcpy(samples.data() + y * row_bytes, row, row_bytes);
    });
    return samples;
}

std::vector<std::uint16_t> PngInput::luminance_alpha() {
    std::vector<std::uint16_t> pixels(std::size_t(2) * std::size_t(width()) * std::size_t(height()));
    const auto word = [](float part) { return std::uint16_t(std::lround(65535 * part)); };
    decode([&](std::size_t n, const Pixel& pixel) {
        pixels[2 * n] = word(pixel.luminance() * pixel.alpha);
        pixels[2 * n + 1] = word(pixel.alpha);
    });
    return pixels;
}

void PngInput::fail(const std::string& reason) const {
    if (is_lack_of_memory(reason)) throw std::bad_alloc();
    throw Error(ErrorCode::io,
                (path_.empty() ? "" : path_.string() + ": ") + "cannot be read as PNG: " + reason);
}

bool is_lack_of_memory(std::string_view reason) {  // not "invalid memory read", of a file that ends early
    return reason.find("nsufficient memory") != reason.npos || reason.find("ut of memory") != reason.npos;
}

}  // namespace nephos
