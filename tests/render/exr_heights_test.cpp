// SPDX-License-Identifier: Apache-2.0
// Heights of OpenEXR: each compression and type is read, and a chunk that does not give its pixels is damage, whatever memory held.

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <zlib.h>

#include "tests/render/exr_maps.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

using namespace exr_maps;

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
