// SPDX-License-Identifier: Apache-2.0
// Heights of OpenEXR: each compression and type is read, and a chunk that does not give its pixels is damage, whatever memory held.

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfCompressionAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfTileDescriptionAttribute.h>
#include <OpenEXR/ImfTiledOutputFile.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "core/error.h"
#include "render/terrain/height_file.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr int kColumns = 20, kRows = 70;  // several chunks of each compression but DWAB
constexpr int kTile = 16;

// Whole numbers that a half holds.
std::vector<float> heights() {
    std::vector<float> values;
    for (int n = 0; n < kColumns * kRows; ++n) values.push_back(float(n / kColumns * 20 + n % kColumns));
    return values;
}

Imf::Header header_of(Imf::Compression compression) {
    Imf::Header header(kColumns, kRows);
    header.compression() = compression;
    header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
    return header;
}

template <typename File>
void set_pixels(File& file, const std::vector<float>& values) {
    Imf::FrameBuffer buffer;
    buffer.insert("Z", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(values.data())),
                                  sizeof(float), sizeof(float) * kColumns));
    file.setFrameBuffer(buffer);
}

void write_rows(const fs::path& path, const Imf::Header& header) {
    const std::vector<float> values = heights();
    Imf::OutputFile file(path.c_str(), header, 0);
    set_pixels(file, values);
    file.writePixels(kRows);
}

void write_tiles(const fs::path& path, Imf::Header header) {
    const std::vector<float> values = heights();
    header.setTileDescription(Imf::TileDescription(kTile, kTile, Imf::ONE_LEVEL));
    Imf::TiledOutputFile file(path.c_str(), header, 0);
    set_pixels(file, values);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
}

std::string content(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void write(const fs::path& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

std::uint32_t number_at(const std::string& bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

// The place of the size of the last chunk: what follows it is the chunk, to the end of the file.
std::size_t last_size(const std::string& bytes) {
    for (std::size_t at = bytes.size() - 4; at > 0; --at)
        if (number_at(bytes, at) == bytes.size() - at - 4 && number_at(bytes, at) > 0) return at;
    ADD_FAILURE() << "no chunk";
    return 0;
}

std::string with_last_chunk(const std::string& bytes, const std::string& chunk) {
    const auto size = std::uint32_t(chunk.size());
    return bytes.substr(0, last_size(bytes)) + std::string(reinterpret_cast<const char*>(&size), 4) + chunk;
}

std::string reason_of(const fs::path& path) {
    try {
        read_height_file(path, 0, 0);
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        return error.what();
    }
    return "";
}

class ExrHeights : public testing::TestWithParam<Imf::Compression> {
  protected:
    fs::path path(const char* name) const { return folder_.path() / name; }

  private:
    TemporaryFolder folder_;
};

TEST_P(ExrHeights, AreThoseOfTheFile) {
    const bool is_exact = GetParam() < Imf::DWAA_COMPRESSION && GetParam() != Imf::PXR24_COMPRESSION;
    write_rows(path("rows.exr"), header_of(GetParam()));
    write_tiles(path("tiles.exr"), header_of(GetParam()));
    for (const char* name : {"rows.exr", "tiles.exr"}) {
        const std::vector<float> found = read_height_file(path(name), 0, 0).image.heights,
                                 expected = heights();
        ASSERT_EQ(found.size(), expected.size());
        for (std::size_t n = 0; n < found.size(); ++n)
            EXPECT_NEAR(found[n], expected[n], is_exact ? 0 : 1e-2 * (1 + double(expected[n]))) << name << n;
    }
}

TEST_P(ExrHeights, OfAChunkThatLacksSomeAreDamage) {
    write_rows(path("rows.exr"), header_of(GetParam()));
    write_tiles(path("tiles.exr"), header_of(GetParam()));
    for (const char* name : {"rows.exr", "tiles.exr"}) {
        const std::string whole = content(path(name));
        const std::string chunk = whole.substr(last_size(whole) + 4);
        for (const std::size_t size :
             {std::size_t(0), std::size_t(1), chunk.size() / 2, chunk.size() - 1, std::size_t(1000)}) {
            std::string other = chunk;
            other.resize(
                size);  // 1,000 are more than its pixels have, but not more than those of a whole chunk
            write(path("damaged.exr"), with_last_chunk(whole, other));
            EXPECT_NE(reason_of(path("damaged.exr")).find("damaged.exr: cannot read heights of OpenEXR: "),
                      std::string::npos)
                << name << ", " << size << " of " << chunk.size() << ": " << reason_of(path("damaged.exr"));
        }
    }
}

// One bit of the head: the chunks have fewer rows or columns than it says.
TEST_P(ExrHeights, OfAHeadThatClaimsMoreAreDamage) {
    write_rows(path("rows.exr"), header_of(GetParam()));
    write_tiles(path("tiles.exr"), header_of(GetParam()));
    for (const char* name : {"rows.exr", "tiles.exr"})
        for (const std::size_t corner :
             {std::size_t(8), std::size_t(12)}) {  // the larger x or y of a box of four numbers
            std::string bytes = content(path(name));
            for (const char* window : {"dataWindow", "displayWindow"}) {
                const std::size_t at = bytes.find(std::string(window) + '\0' + "box2i");
                ASSERT_NE(at, bytes.npos);
                const std::size_t number = at + std::strlen(window) + 1 + 6 + 4 + corner;
                std::uint32_t value = number_at(bytes, number) + 1;
                std::memcpy(&bytes[number], &value, sizeof value);
            }
            write(path("claims.exr"), bytes);
            EXPECT_NE(reason_of(path("claims.exr")).find("claims.exr: cannot read heights of OpenEXR: "),
                      std::string::npos)
                << name << ", " << corner << ": " << reason_of(path("claims.exr"));
        }
}

INSTANTIATE_TEST_SUITE_P(All, ExrHeights,
                         testing::Values(Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION,
                                         Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION, Imf::PXR24_COMPRESSION,
                                         Imf::B44_COMPRESSION, Imf::B44A_COMPRESSION));

// Whatever channels are beside it: of other sizes, or with fewer samples than pixels.
TEST_P(ExrHeights, MayHaveOtherChannelsBesideThem) {
    struct Beside {
        const char* name;
        Imf::PixelType type;
        int sampling;
    };
    for (const std::vector<Beside>& others : {std::vector<Beside>{{"A", Imf::HALF, 1}},
                                              std::vector<Beside>{{"A", Imf::HALF, 1}, {"aaa", Imf::UINT, 1}},
                                              std::vector<Beside>{{"BY", Imf::HALF, 2}, {"RY", Imf::HALF, 2}},
                                              std::vector<Beside>{{"BY", Imf::FLOAT, 5}}}) {
        Imf::Header header = header_of(GetParam());
        std::vector<std::vector<float>> samples;
        samples.reserve(others.size());
        Imf::FrameBuffer buffer;
        const std::vector<float> values = heights();
        const auto add = [&](const char* name, Imf::PixelType type, int sampling, const float* from) {
            const std::size_t size = type == Imf::HALF ? 2 : 4;
            buffer.insert(name, Imf::Slice(type, reinterpret_cast<char*>(const_cast<float*>(from)), size,
                                           size * std::size_t(kColumns / sampling), sampling, sampling));
        };
        for (const Beside& other : others) {
            header.channels().insert(other.name, Imf::Channel(other.type, other.sampling, other.sampling));
            samples.emplace_back(std::size_t(kColumns * kRows), 0.0f);
            for (std::size_t n = 0; n < samples.back().size(); ++n) samples.back()[n] = float(n * 7 % 31);
            add(other.name, other.type, other.sampling, samples.back().data());
        }
        add("Z", Imf::FLOAT, 1, values.data());
        {
            Imf::OutputFile file(path("beside.exr").c_str(), header, 0);
            file.setFrameBuffer(buffer);
            file.writePixels(kRows);
        }
        if (others[0].sampling > 2) {
            EXPECT_NE(reason_of(path("beside.exr")).find("its channel BY has less than half the rows"),
                      std::string::npos);
            continue;
        }
        const std::vector<float> found = read_height_file(path("beside.exr"), 0, 0).image.heights;
        ASSERT_EQ(found.size(), values.size());
        for (std::size_t n = 0; n < found.size(); ++n)
            EXPECT_NEAR(found[n], values[n], 1e-2 * (1 + double(values[n]))) << others[0].name << n;
    }
}

// Halves, whose last chunk has one row and does not become smaller.
TEST_P(ExrHeights, MayBeHalves) {
    Imf::Header header(33, 65);
    header.compression() = GetParam();
    header.channels().insert("Z", Imf::Channel(Imf::HALF));
    std::vector<Imath::half> values;
    for (int n = 0; n < 33 * 65; ++n) values.emplace_back(float(n % 33 + 2 * (n / 33)));
    Imf::FrameBuffer buffer;
    buffer.insert("Z", Imf::Slice(Imf::HALF, reinterpret_cast<char*>(values.data()), 2, 2 * 33));
    for (const bool in_tiles : {false, true}) {
        if (in_tiles) {
            header.setTileDescription(Imf::TileDescription(kTile, kTile, Imf::ONE_LEVEL));
            Imf::TiledOutputFile file(path("half.exr").c_str(), header, 0);
            file.setFrameBuffer(buffer);
            file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
        } else {
            Imf::OutputFile file(path("half.exr").c_str(), header, 0);
            file.setFrameBuffer(buffer);
            file.writePixels(65);
        }
        const std::vector<float> found = read_height_file(path("half.exr"), 0, 0).image.heights;
        ASSERT_EQ(found.size(), values.size());
        for (std::size_t n = 0; n < found.size(); ++n)
            EXPECT_NEAR(found[n], float(values[n]), 0.1f * (20 + float(values[n])));
    }
}

// One bit of the head: without its attribute, or for an unknown value, both of the library's readers would take ZIP for it.
TEST(ExrHeightsWithoutCompression, AreRefused) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    write_rows(path, header_of(Imf::PXR24_COMPRESSION));
    const std::string whole = content(path);
    const std::size_t name = whole.find("compression");
    ASSERT_NE(name, whole.npos);
    const auto reason = [&](std::size_t at, char bit) {
        std::string bytes = whole;
        bytes[name + at] ^= bit;
        write(path, bytes);
        return reason_of(path);
    };
    EXPECT_NE(reason(2, 1).find("its head has no compression"), std::string::npos);
    EXPECT_NE(reason(12, 1).find("its compression is not of the type compression"), std::string::npos);
    EXPECT_NE(reason(28, '\x80').find("its compression is 133, which is none"), std::string::npos);
}

TEST(ExrHeightsWithTwoCompressions, AreRefused) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    Imf::Header header = header_of(Imf::ZIP_COMPRESSION);
    header.insert("compressios", Imf::CompressionAttribute(Imf::PXR24_COMPRESSION));
    write_rows(path, header);
    std::string bytes = content(path);
    bytes[bytes.find("compressios") + 10] = 'n';
    write(path, bytes);
    EXPECT_NE(reason_of(path).find("its head has two of compression"), std::string::npos) << reason_of(path);
}

// Names that the format has for other files may be those of anybody's attributes in one of rows.
TEST(ExrHeightsWithAttributes, OfReservedNamesAreRead) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    for (const char* name : {"version", "chunkCount", "name"}) {
        Imf::Header header = header_of(Imf::ZIP_COMPRESSION);
        if (name == std::string("version"))
            header.insert(name, Imf::StringAttribute("1.2.3"));
        else
            header.insert("placeholder", Imf::V2fAttribute({1, 2}));
        write_rows(path, header);
        if (std::string bytes = content(path); name != std::string("version")) {
            const std::size_t at = bytes.find("placeholder");
            const std::size_t table =
                bytes.size();  // places of chunks would move with the head: it keeps its length
            const std::string filled = std::string(name) + '\0' + "string" + '\0';
            ASSERT_NE(at, bytes.npos);
            const std::size_t length = std::strlen("placeholder") + 1 + std::strlen("v2f") + 1 + 4 + 8;
            const auto size = std::uint32_t(length - filled.size() - 4);
            std::string attribute = filled + std::string(reinterpret_cast<const char*>(&size), 4);
            attribute += std::string(size, 'a');
            bytes.replace(at, length, attribute);
            ASSERT_EQ(bytes.size(), table);
            write(path, bytes);
        }
        EXPECT_EQ(read_height_file(path, 0, 0).image.heights, heights()) << name << ": " << reason_of(path);
    }
}

std::uint64_t place_at(const std::string& bytes, std::size_t at) {
    std::uint64_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

// The place of the table of places, whose first entry is that of what follows it.
std::size_t table_of(const std::string& bytes, std::size_t chunks) {
    for (std::size_t at = 8; at + 8 * chunks < bytes.size(); ++at)
        if (place_at(bytes, at) == at + 8 * chunks) return at;
    ADD_FAILURE() << "no table";
    return 0;
}

std::string number_bytes(std::uint64_t value, std::size_t size) {
    return {reinterpret_cast<const char*>(&value), size};
}

// Readers that go by the order in the file take the first chunk where another stands in its place.
TEST(ExrHeightsOfATable, AreThoseOfTheChunksThatItNames) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    write_rows(path, header_of(Imf::ZIPS_COMPRESSION));
    std::string bytes = content(path);
    const std::size_t table = table_of(bytes, kRows);
    const std::size_t first = place_at(bytes, table), second = place_at(bytes, table + 8);
    const std::string chunk = bytes.substr(first, second - first);
    bytes.replace(table, 8, number_bytes(bytes.size(), 8));
    bytes.replace(first + 4, 4, number_bytes(1, 4));  // of one byte
    write(path, bytes + chunk);
    EXPECT_EQ(read_height_file(path, 0, 0).image.heights, heights()) << reason_of(path);
}

// The library finds the chunks where they are.
TEST(ExrHeightsOfATable, WithAPlaceBeyondAnyFileAreThoseOfItsChunks) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    for (const bool in_tiles : {false, true}) {
        if (in_tiles)
            write_tiles(path, header_of(Imf::ZIP_COMPRESSION));
        else
            write_rows(path, header_of(Imf::ZIPS_COMPRESSION));
        std::string bytes = content(path);
        bytes[table_of(bytes, in_tiles ? 2 * 5 : kRows) + 7] ^= '\x80';
        write(path, bytes);
        EXPECT_EQ(read_height_file(path, 0, 0).image.heights, heights()) << reason_of(path);
    }
}

// Without compression a size with one other bit may be that of two chunks.
TEST(ExrHeightsOfChunks, ThatShareBytesAreDamage) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    write_rows(path, header_of(Imf::ZIPS_COMPRESSION));
    std::string bytes = content(path);
    const std::size_t first = place_at(bytes, table_of(bytes, kRows));
    bytes.replace(first + 4, 4, number_bytes(4 * kColumns, 4));
    write(path, bytes);
    EXPECT_NE(reason_of(path).find("two chunks of its pixels share bytes"), std::string::npos)
        << reason_of(path);
}

// A chunk that reaches into the head of the next one alone.
TEST(ExrHeightsOfChunks, ThatShareAHeadAreDamage) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    for (int columns = 8; columns < 200; ++columns) {
        Imf::Header header(columns, 2);
        header.compression() = Imf::ZIPS_COMPRESSION;
        header.channels().insert("Z", Imf::Channel(Imf::HALF));
        std::vector<Imath::half> values;
        for (int n = 0; n < 2 * columns; ++n) values.emplace_back(float(n * n % 61));
        Imf::FrameBuffer buffer;
        buffer.insert(
            "Z", Imf::Slice(Imf::HALF, reinterpret_cast<char*>(values.data()), 2, 2 * std::size_t(columns)));
        {
            Imf::OutputFile file(path.c_str(), header, 0);
            file.setFrameBuffer(buffer);
            file.writePixels(2);
        }
        std::string bytes = content(path);
        const std::size_t size_at = place_at(bytes, table_of(bytes, 2)) + 4;
        const std::uint32_t raw = 2 * std::uint32_t(columns), packed = number_at(bytes, size_at);
        if (packed >= raw || packed + 8 < raw) continue;
        bytes.replace(size_at, 4, number_bytes(raw, 4));
        write(path, bytes);
        EXPECT_NE(reason_of(path).find("two chunks of its pixels share bytes"), std::string::npos)
            << reason_of(path);
        return;
    }
    FAIL() << "no row of such a size";
}

// What follows may be of another level, which is not read.
TEST(ExrHeightsOfChunks, ThatShareBytesWithAnotherLevelAreDamage) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    Imf::Header header = header_of(Imf::ZIP_COMPRESSION);
    header.setTileDescription(Imf::TileDescription(kTile, kTile, Imf::MIPMAP_LEVELS));
    const std::vector<float> values = heights();
    {
        Imf::TiledOutputFile file(path.c_str(), header, 0);
        set_pixels(file, values);
        for (int level = 0; level < file.numLevels(); ++level)
            file.writeTiles(0, file.numXTiles(level) - 1, 0, file.numYTiles(level) - 1, level);
    }
    ASSERT_EQ(read_height_file(path, 0, 0).image.heights, values);
    std::string bytes = content(path);
    const std::uint32_t raw = 4 * (kColumns % kTile) * (kRows % kTile);
    // The last of ten tiles of full size; five levels of 35 x 10, 17 x 5, ... pixels have 3, 2, 1, 1, 1 and 1.
    std::size_t table = 8;
    while (place_at(bytes, table) <= table || place_at(bytes, table) > table + 8 * 40) ++table;
    const std::size_t size_at = place_at(bytes, table + 9 * 8) + 16;
    ASSERT_LT(number_at(bytes, size_at), raw);
    bytes.replace(size_at, 4, number_bytes(raw, 4));
    write(path, bytes);
    EXPECT_NE(reason_of(path).find("two chunks of its pixels share bytes"), std::string::npos)
        << reason_of(path);
}

// A head that says of a channel beside the heights that it has fewer bytes than its pixels take.
TEST(ExrHeightsOfChunks, OfMorePixelsThanTheirChannelsHaveAreDamage) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    for (const Imf::Compression compression :
         {Imf::PXR24_COMPRESSION, Imf::B44_COMPRESSION, Imf::B44A_COMPRESSION}) {
        Imf::Header header = header_of(compression);
        header.channels().insert("A", Imf::Channel(Imf::HALF));
        const std::vector<float> values = heights();
        std::vector<Imath::half> others;
        for (std::size_t n = 0; n < values.size(); ++n) others.emplace_back(float(n * n % 61));
        Imf::FrameBuffer buffer;
        buffer.insert("A", Imf::Slice(Imf::HALF, reinterpret_cast<char*>(others.data()), 2, 2 * kColumns));
        {
            Imf::OutputFile file(path.c_str(), header, 0);
            buffer.insert("Z",
                          Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(values.data())),
                                     sizeof(float), sizeof(float) * kColumns));
            file.setFrameBuffer(buffer);
            file.writePixels(kRows);
        }
        EXPECT_EQ(reason_of(path), "");
        std::string bytes = content(path);
        bytes[bytes.find(std::string("A\0\1", 3)) + 2 + 4 + 4] = 2;  // samples along x: one of two
        write(path, bytes);
        EXPECT_NE(reason_of(path).find("cannot read heights of OpenEXR: a chunk has other pixels"),
                  std::string::npos)
            << reason_of(path);
    }
}

std::string renamed(const fs::path& path, const std::string& from, const std::string& to) {
    std::string bytes = content(path);
    bytes.replace(bytes.find(from + '\0'), from.size(), to);
    write(path, bytes);
    return reason_of(path);
}

TEST(ExrHeightsWithAttributes, OfOtherPixelsAreRefused) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    Imf::Header deep = header_of(Imf::ZIPS_COMPRESSION), tiles = deep;
    deep.insert("typo", Imf::StringAttribute("deepscanline"));
    write_rows(path, deep);
    const std::string reason = renamed(path, "typo", "type");
    EXPECT_NE(reason.find("it holds deep data"), std::string::npos) << reason;
    tiles.insert("tilez", Imf::TileDescriptionAttribute(Imf::TileDescription(8, 8)));
    write_rows(path, tiles);
    EXPECT_NE(renamed(path, "tilez", "tiles").find("its rows have an attribute `tiles`"), std::string::npos);
}

// Whatever the first part is.
TEST(ExrHeightsBesideDeepData, AreRefused) {
    const TemporaryFolder folder;
    const fs::path path = folder.path() / "a.exr";
    write_rows(path, header_of(Imf::ZIP_COMPRESSION));
    std::string bytes = content(path);
    bytes[5] |= '\x08';
    write(path, bytes);
    EXPECT_NE(reason_of(path).find("it holds deep data"), std::string::npos) << reason_of(path);
}

// OpenEXR's core library cannot look at their chunks.
TEST(ExrHeightsOfDwa, AreRefused) {
    const TemporaryFolder folder;
    for (const Imf::Compression compression : {Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION}) {
        write_rows(folder.path() / "a.exr", header_of(compression));
        EXPECT_NE(
            reason_of(folder.path() / "a.exr").find("its compression is DWA, of which damage goes unnoticed"),
            std::string::npos);
    }
}

// Packs what is whole by itself, but too short for the pixels.
TEST(ExrHeightsOfZip, OfAShortChunkAreDamage) {
    const TemporaryFolder folder;
    write_rows(folder.path() / "a.exr", header_of(Imf::ZIP_COMPRESSION));
    const std::string few(10, '\0');
    uLongf size = compressBound(few.size());
    std::string chunk(size, '\0');
    ASSERT_EQ(compress(reinterpret_cast<Bytef*>(chunk.data()), &size,
                       reinterpret_cast<const Bytef*>(few.data()), few.size()),
              Z_OK);
    chunk.resize(size);
    write(folder.path() / "short.exr", with_last_chunk(content(folder.path() / "a.exr"), chunk));
    EXPECT_NE(reason_of(folder.path() / "short.exr").find("cannot read heights of OpenEXR: "),
              std::string::npos);
}

// One whose edges a program has cropped would be stretched over the whole map.
TEST(ExrHeightsOfAWindow, OfAPartOfTheMapAreRefused) {
    const TemporaryFolder folder;
    Imf::Header header = header_of(Imf::ZIP_COMPRESSION);
    header.displayWindow() = Imath::Box2i({0, 0}, {99, 99});
    write_rows(folder.path() / "crop.exr", header);
    EXPECT_NE(reason_of(folder.path() / "crop.exr")
                  .find("its data window is (0 0) to (19 69), its display window (0 0) to (99 99)"),
              std::string::npos)
        << reason_of(folder.path() / "crop.exr");
}

}  // namespace
}  // namespace nephos
