// SPDX-License-Identifier: Apache-2.0
// Heights of OpenEXR: what heads say, the table of chunks, and chunks that are not what these say.

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <OpenEXR/ImfCompressionAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfTileDescriptionAttribute.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <gtest/gtest.h>

#include "tests/render/exr_maps.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

using namespace exr_maps;

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
            header.insert("long.enough", Imf::V2fAttribute({1, 2}));
        write_rows(path, header);
        if (std::string bytes = content(path); name != std::string("version")) {
            const std::size_t at = bytes.find("long.enough");
            const std::size_t table =
                bytes.size();  // places of chunks would move with the head: it keeps its length
            const std::string filled = std::string(name) + '\0' + "string" + '\0';
            ASSERT_NE(at, bytes.npos);
            const std::size_t length = std::strlen("long.enough") + 1 + std::strlen("v2f") + 1 + 4 + 8;
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

// Another level may follow, which is not read.
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

}  // namespace
}  // namespace nephos
