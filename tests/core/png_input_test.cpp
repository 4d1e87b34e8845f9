// SPDX-License-Identifier: Apache-2.0
#include "core/png/png_input.h"

#include <array>
#include <cmath>
#include <csetjmp>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <png.h>
#include <sys/resource.h>
#include <zlib.h>

#include "core/error.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

struct Kind {
    int colour, depth, interlace;
    int width = 13, height = 11;  // odd, so that the passes of interlaced pictures have ends of all kinds
};

// Holds what a pixel is, 0..1: red, green, blue as coded, alpha.
using Pixel = std::array<double, 4>;

struct Source {
    std::vector<Pixel> pixels;
    std::vector<std::vector<std::uint8_t>> rows;  // packed as the file has them
    std::vector<png_color> palette;
    std::vector<png_byte> palette_alpha;
    std::optional<png_color_16> clear;  // what is transparent, of grey or colours without alpha
    std::optional<double> gamma;        // of a gAMA chunk
    std::vector<std::pair<std::string, std::string>> texts;
};

int channels_of(int colour) {
    return colour == PNG_COLOR_TYPE_GRAY || colour == PNG_COLOR_TYPE_PALETTE ? 1
           : colour == PNG_COLOR_TYPE_GRAY_ALPHA                             ? 2
           : colour == PNG_COLOR_TYPE_RGB                                    ? 3
                                                                             : 4;
}

// A picture whose samples are all over the range, and differ from pixel to pixel.
Source source_of(const Kind& kind) {
    Source source;
    const unsigned most = (1u << kind.depth) - 1;
    const int channels = channels_of(kind.colour);
    if (kind.colour == PNG_COLOR_TYPE_PALETTE)
        for (unsigned n = 0; n <= most; ++n) {
            source.palette.push_back({png_byte(37 * n), png_byte(91 * n + 5), png_byte(200 - 53 * n)});
            source.palette_alpha.push_back(png_byte(255 - 29 * n));
        }
    std::uint32_t state = 1;
    for (int y = 0; y < kind.height; ++y) {
        std::vector<std::uint8_t> row((std::size_t(kind.width * channels * kind.depth) + 7) / 8);
        for (int x = 0; x < kind.width; ++x) {
            std::array<unsigned, 4> samples{};
            for (int c = 0; c < channels; ++c) {
                state = state * 1664525u + 1013904223u;
                samples[std::size_t(c)] = (state >> 12) % (most + 1);
                const std::size_t at = std::size_t(x * channels + c);
                if (kind.depth == 16) {
                    row[2 * at] = std::uint8_t(samples[std::size_t(c)] >> 8);
                    row[2 * at + 1] = std::uint8_t(samples[std::size_t(c)]);
                } else {
                    const std::size_t bit = at * std::size_t(kind.depth);
                    row[bit / 8] = std::uint8_t(row[bit / 8] | samples[std::size_t(c)]
                                                                   << (8 - kind.depth - int(bit % 8)));
                }
            }
            const auto part = [&](int c) { return samples[std::size_t(c)] / double(most); };
            switch (kind.colour) {
                case PNG_COLOR_TYPE_GRAY:
                    source.pixels.push_back({part(0), part(0), part(0), 1});
                    break;
                case PNG_COLOR_TYPE_GRAY_ALPHA:
                    source.pixels.push_back({part(0), part(0), part(0), part(1)});
                    break;
                case PNG_COLOR_TYPE_RGB:
                    source.pixels.push_back({part(0), part(1), part(2), 1});
                    break;
                case PNG_COLOR_TYPE_PALETTE: {
                    const png_color colour = source.palette[samples[0]];
                    source.pixels.push_back({colour.red / 255.0, colour.green / 255.0, colour.blue / 255.0,
                                             source.palette_alpha[samples[0]] / 255.0});
                    break;
                }
                default:
                    source.pixels.push_back({part(0), part(1), part(2), part(3)});
            }
        }
        source.rows.push_back(row);
    }
    return source;
}

void write_file(const std::filesystem::path& path, const Kind& kind, Source& source) {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    ASSERT_NE(file, nullptr);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    std::vector<png_bytep> rows;
    for (std::vector<std::uint8_t>& row : source.rows) rows.push_back(row.data());
    if (setjmp(png_jmpbuf(png)) == 0) {
        png_init_io(png, file);
        png_set_IHDR(png, info, png_uint_32(kind.width), png_uint_32(kind.height), kind.depth, kind.colour,
                     kind.interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
        if (!source.palette.empty()) {
            png_set_PLTE(png, info, source.palette.data(), int(source.palette.size()));
            png_set_tRNS(png, info, source.palette_alpha.data(), int(source.palette_alpha.size()), nullptr);
        }
        if (source.clear) png_set_tRNS(png, info, nullptr, 0, &*source.clear);
        if (source.gamma) png_set_gAMA(png, info, *source.gamma);
        for (auto& [keyword, text] : source.texts) {
            png_text one{};
            one.compression = PNG_TEXT_COMPRESSION_zTXt;
            one.key = keyword.data();
            one.text = text.data();
            one.text_length = text.size();
            png_set_text(png, info, &one, 1);
        }
        png_set_check_for_invalid_index(png, 0);
        png_write_info(png, info);
        png_write_image(png, rows.data());
        png_write_end(png, nullptr);
    } else {
        ADD_FAILURE() << "libpng cannot write it";
    }
    png_destroy_write_struct(&png, &info);
    std::fclose(file);
}

double linear(double coded) {
    return coded <= 0.04045 ? coded / 12.92 : std::pow((coded + 0.055) / 1.055, 2.4);
}
double coded(double linear) {
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}
double luminance(const Pixel& p) {
    return 0.2126 * linear(p[0]) + 0.7152 * linear(p[1]) + 0.0722 * linear(p[2]);
}

std::vector<double> grey_of(const std::filesystem::path& path) {
    PngInput png(path, {});
    std::vector<double> grey;
    png.each_grey([&](std::size_t n, double value) {
        EXPECT_EQ(n, grey.size());
        grey.push_back(value);
    });
    return grey;
}

class PngKinds : public testing::TestWithParam<Kind> {
  protected:
    void SetUp() override {
        source_ = source_of(GetParam());
        write_file(path(), GetParam(), source_);
    }
    std::filesystem::path path() const { return folder_.path() / "a.png"; }
    static constexpr PngLimits kLimits{.side = 100};

    TemporaryFolder folder_;
    Source source_;
};

TEST_P(PngKinds, HaveTheirSizeAndOpacity) {
    const PngInput png(path(), kLimits);
    EXPECT_EQ(png.width(), GetParam().width);
    EXPECT_EQ(png.height(), GetParam().height);
    const int colour = GetParam().colour;
    EXPECT_EQ(png.has_alpha(), colour != PNG_COLOR_TYPE_GRAY && colour != PNG_COLOR_TYPE_RGB);
}

TEST_P(PngKinds, ColoursAreAsShown) {
    const std::vector<std::uint8_t> rgb = PngInput(path(), kLimits).rgb();
    ASSERT_EQ(rgb.size(), 3 * source_.pixels.size());
    for (std::size_t n = 0; n < source_.pixels.size(); ++n)
        for (std::size_t c = 0; c < 3; ++c) {
            const Pixel& p = source_.pixels[n];
            EXPECT_NEAR(rgb[3 * n + c], 255 * coded(linear(p[c]) * p[3]), 0.51) << n << ", " << c;
        }
}

TEST_P(PngKinds, GreyIsTheirLuminanceAsShown) {
    const std::vector<double> grey = grey_of(path());
    ASSERT_EQ(grey.size(), source_.pixels.size());
    for (std::size_t n = 0; n < grey.size(); ++n)
        EXPECT_NEAR(grey[n], 255 * coded(luminance(source_.pixels[n]) * source_.pixels[n][3]), 0.01) << n;
}

TEST_P(PngKinds, LightIsLinear) {
    const std::vector<std::uint16_t> light = PngInput(path(), kLimits).luminance_alpha();
    ASSERT_EQ(light.size(), 2 * source_.pixels.size());
    for (std::size_t n = 0; n < source_.pixels.size(); ++n) {
        const Pixel& p = source_.pixels[n];
        EXPECT_NEAR(light[2 * n], 65535 * luminance(p) * p[3], 0.6) << n;
        EXPECT_NEAR(light[2 * n + 1], 65535 * p[3], 1) << n;
    }
}

std::vector<Kind> all_kinds() {
    std::vector<Kind> kinds;
    for (const int interlace : {PNG_INTERLACE_NONE, PNG_INTERLACE_ADAM7}) {
        for (const int depth : {1, 2, 4, 8, 16}) kinds.push_back({PNG_COLOR_TYPE_GRAY, depth, interlace});
        for (const int depth : {1, 2, 4, 8}) kinds.push_back({PNG_COLOR_TYPE_PALETTE, depth, interlace});
        for (const int colour : {PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB, PNG_COLOR_TYPE_RGB_ALPHA})
            for (const int depth : {8, 16}) kinds.push_back({colour, depth, interlace});
    }
    return kinds;
}

INSTANTIATE_TEST_SUITE_P(All, PngKinds, testing::ValuesIn(all_kinds()),
                         [](const testing::TestParamInfo<Kind>& kind) {
                             return "Colour" + std::to_string(kind.param.colour) + "Depth" +
                                    std::to_string(kind.param.depth) +
                                    (kind.param.interlace == PNG_INTERLACE_NONE ? "" : "Interlaced");
                         });

// Nothing, or why it is refused.
std::string message_of(const std::filesystem::path& path, const PngLimits& limits) {
    try {
        PngInput(path, limits).each_grey([](std::size_t, double) {});
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        return error.what();
    }
    return "";
}

std::string content(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

std::string packed(const std::string& text) {
    uLongf size = compressBound(text.size());
    std::string bytes(size, '\0');
    EXPECT_EQ(compress2(reinterpret_cast<Bytef*>(bytes.data()), &size,
                        reinterpret_cast<const Bytef*>(text.data()), text.size(), 9),
              Z_OK);
    bytes.resize(size);
    return bytes;
}

// A number as PNG has it.
std::string word(std::uint32_t value) {
    return {char(value >> 24), char(value >> 16), char(value >> 8), char(value)};
}

std::string chunk_of(const std::string& kind, const std::string& data) {
    const std::string body = kind + data;
    return word(std::uint32_t(data.size())) + body +
           word(std::uint32_t(crc32(0, reinterpret_cast<const Bytef*>(body.data()), uInt(body.size()))));
}

class PngFiles : public testing::Test {
  protected:
    std::filesystem::path write(const Kind& kind, Source& source) const {
        write_file(folder_.path() / "a.png", kind, source);
        return folder_.path() / "a.png";
    }
    std::filesystem::path write(const std::string& bytes) const {
        std::ofstream(folder_.path() / "b.png", std::ios::binary) << bytes;
        return folder_.path() / "b.png";
    }
    static constexpr PngLimits kLimits{.side = 100};

  private:
    TemporaryFolder folder_;
};

TEST_F(PngFiles, MayBeNarrow) {
    for (const int interlace : {PNG_INTERLACE_NONE, PNG_INTERLACE_ADAM7})
        for (const auto& [width, height] :
             {std::pair(1, 1), std::pair(1, 9), std::pair(9, 1), std::pair(4, 2)}) {
            const Kind kind{PNG_COLOR_TYPE_GRAY, 16, interlace, width, height};
            Source source = source_of(kind);
            const std::vector<double> grey = grey_of(write(kind, source));
            ASSERT_EQ(grey.size(), source.pixels.size());
            for (std::size_t n = 0; n < grey.size(); ++n)
                EXPECT_NEAR(grey[n], 255 * source.pixels[n][0], 1e-9);
        }
}

// A colour of a tRNS chunk is compared with all of its bits.
TEST_F(PngFiles, MayHaveOneColourThatIsTransparent) {
    for (const int colour : {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_RGB})
        for (const int depth : {8, 16}) {
            const Kind kind{colour, depth, PNG_INTERLACE_NONE};
            Source source = source_of(kind);
            const double most = (1 << depth) - 1;
            const std::size_t clear = 20, near = 21;
            const auto word = [&](std::size_t c) {
                return png_uint_16(std::lround(most * source.pixels[clear][c]));
            };
            source.clear = png_color_16{0, word(0), word(1), word(2), word(0)};
            ASSERT_NE(source.pixels[near], source.pixels[clear]);
            PngInput png(write(kind, source), kLimits);
            EXPECT_TRUE(png.has_alpha());
            const std::vector<std::uint16_t> light = png.luminance_alpha();
            EXPECT_EQ(light[2 * clear], 0);
            EXPECT_EQ(light[2 * clear + 1], 0);
            EXPECT_EQ(light[2 * near + 1], 65535);
        }
}

TEST_F(PngFiles, PowersAreThoseOfTheFile) {
    const Kind kind{PNG_COLOR_TYPE_GRAY, 8, PNG_INTERLACE_NONE};
    for (const auto& [gamma, power] :
         {std::pair(1.0, 1.0), std::pair(0.55, 1 / 0.55), std::pair(0.45455, 0.0)}) {
        Source source = source_of(kind);
        source.gamma = gamma;
        const auto path = write(kind, source);
        const std::vector<std::uint16_t> light = PngInput(path, kLimits).luminance_alpha();
        const std::vector<double> grey = grey_of(path);
        for (std::size_t n = 0; n < source.pixels.size(); ++n) {
            const double code = source.pixels[n][0],
                         expected = power > 0 ? std::pow(code, power) : linear(code);
            EXPECT_NEAR(light[2 * n], 65535 * expected, 0.6 + 65535 * 1e-5) << gamma;
            EXPECT_NEAR(grey[n], 255 * coded(expected), 0.51) << gamma;
        }
    }
}

TEST_F(PngFiles, CutOrChangedAnywhereAreErrors) {
    for (const int interlace : {PNG_INTERLACE_NONE, PNG_INTERLACE_ADAM7}) {
        const Kind kind{PNG_COLOR_TYPE_RGB, 16, interlace, 5, 3};
        Source source = source_of(kind);
        source.gamma = 1;
        source.clear = png_color_16{0, 1, 2, 3, 0};
        source.texts = {{"Title", "of no use"}};
        const std::string whole = content(write(kind, source));
        ASSERT_EQ(message_of(write(whole), kLimits), "");
        for (std::size_t n = 0; n < whole.size(); ++n) {
            EXPECT_NE(message_of(write(whole.substr(0, n)), kLimits).find("b.png: cannot be read as PNG: "),
                      std::string::npos)
                << n;
            std::string changed = whole;
            changed[n] = char(changed[n] ^ 0x40);
            EXPECT_NE(message_of(write(changed), kLimits).find("b.png: cannot be read as PNG: "),
                      std::string::npos)
                << n;
        }
    }
}

// With checksums of chunks that are right: the one of zlib, over all pixels, is not, or there are more of them.
TEST_F(PngFiles, PixelsOfAnotherChecksumAreErrors) {
    for (const int interlace : {PNG_INTERLACE_NONE, PNG_INTERLACE_ADAM7}) {
        const Kind kind{PNG_COLOR_TYPE_GRAY, 8, interlace, 40, 30};
        Source source = source_of(kind);
        const std::string whole = content(write(kind, source));
        const std::size_t at = whole.find("IDAT"), size = whole.size() - at - 4 - 4 - 12;
        const std::string head = whole.substr(0, at - 4), data = whole.substr(at + 4, size),
                          end = whole.substr(whole.size() - 12);
        const std::vector<double> pixels = grey_of(write(head + chunk_of("IDAT", data) + end));
        std::size_t refused = 0;
        for (std::size_t n = 0; n < size; ++n)
            for (const int bit : {0, 3, 6}) {
                std::string changed = data;
                changed[n] = char(changed[n] ^ 1 << bit);
                const auto path = write(head + chunk_of("IDAT", changed) + end);
                if (!message_of(path, kLimits).empty())
                    ++refused;
                else  // what no pixel needs
                    EXPECT_EQ(grey_of(path), pixels) << n << ", " << bit;
            }
        EXPECT_GT(refused, 3 * size - 10);
    }
}

TEST_F(PngFiles, PixelsOfNoColourAreErrors) {
    for (const int depth : {4, 8}) {
        const Kind kind{PNG_COLOR_TYPE_PALETTE, depth, PNG_INTERLACE_NONE};
        Source source = source_of(kind);
        source.palette.resize(5);
        source.palette_alpha.resize(5);
        EXPECT_NE(
            message_of(write(kind, source), kLimits).find("a pixel names a colour that the palette lacks"),
            std::string::npos);
    }
}

TEST_F(PngFiles, TextsAreKeptForThoseWhoAsk) {
    const Kind kind{PNG_COLOR_TYPE_GRAY, 8, PNG_INTERLACE_NONE};
    Source source = source_of(kind);
    source.texts = {{"one", "1.5"}, {"long", std::string(20000, 'x')}};
    const auto path = write(kind, source);
    const PngInput png(path, {.side = 100, .texts = true});
    EXPECT_EQ(png.text("one"), "1.5");
    EXPECT_EQ(png.text("long"), source.texts[1].second);
    EXPECT_EQ(png.text("two"), std::nullopt);
    EXPECT_EQ(PngInput(path, kLimits).text("one"), std::nullopt);
}

TEST_F(PngFiles, ChunksOfOthersMayBeLarge) {
    const Kind kind{PNG_COLOR_TYPE_GRAY, 8, PNG_INTERLACE_NONE};
    Source source = source_of(kind);
    std::string file = content(write(kind, source));
    for (const char* name : {"iCCP", "tEXt", "prVt", "eXIf"}) {
        const std::string chunk = chunk_of(name, std::string(9 << 20, 'x'));
        file.insert(file.size() - 12, chunk);  // before the end
        file.insert(33, chunk);                // behind the head
    }
    EXPECT_EQ(message_of(write(file), kLimits), "");
}

// Packed, a text is a thousandth of what it takes.
TEST_F(PngFiles, TextsOfOthersTakeNoMemory) {
    const Kind kind{PNG_COLOR_TYPE_GRAY, 8, PNG_INTERLACE_NONE};
    Source source = source_of(kind);
    std::string file = content(write(kind, source));
    const std::string text = packed(std::string(4 << 20, 'x'));
    const std::string chunk = chunk_of("zTXt", std::string("bomb\0", 6) + text);
    for (int n = 0; n < 400; ++n) file.insert(33, chunk);  // behind signature and head
    const auto path = write(file);
    struct rusage before {
    }, after{};
    ::getrusage(RUSAGE_SELF, &before);
    EXPECT_EQ(message_of(path, kLimits), "");
    ::getrusage(RUSAGE_SELF, &after);
    EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 64 << 10) << "KiB";
}

TEST_F(PngFiles, SizesBeyondTheLimitsAreRefused) {
    const Kind kind{PNG_COLOR_TYPE_GRAY, 8, PNG_INTERLACE_NONE};
    Source source = source_of(kind);
    const auto path = write(kind, source);
    EXPECT_EQ(message_of(path, {.side = 13}), "");
    EXPECT_NE(message_of(path, {.side = 12})
                  .find("a.png: cannot be read as PNG: it is 13 x 11 pixels; expected at most 12 on a side"),
              std::string::npos);
    EXPECT_EQ(message_of(path, {.side = 13, .pixels = 143}), "");
    EXPECT_NE(message_of(path, {.side = 13, .pixels = 142}).find("at most 13 on a side and 142 in all"),
              std::string::npos);
}

}  // namespace
}  // namespace nephos
