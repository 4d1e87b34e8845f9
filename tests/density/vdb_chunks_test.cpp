// SPDX-License-Identifier: Apache-2.0

// Chunks of voxels whose sizes lie, and numbers that only look like such sizes.

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>

#include "density/vdb/vdb_file.h"
#include "tests/density/foreign_fog.h"
#include "tests/density/vdb_test_files.h"

namespace nephos {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using test::error_of;
using test::expect_same_voxels;
using test::foreign_fog;
using test::TemporaryFolder;

// OpenVDB reads as many bytes as the negated size of a chunk says into memory that has no room for them.
TEST(VdbRead, ChunksOfNegativeSizeOverrunNothing) {
    const TemporaryFolder folder;
    for (const std::uint32_t compression : {openvdb::io::COMPRESS_BLOSC, openvdb::io::COMPRESS_ZIP}) {
        auto grid = FloatGrid::create(0.0f);
        grid->setName("density");
        for (int n = 0; n < 4000; ++n)
            grid->tree().setValue(Coord(n % 16, n / 16 % 16, n / 256), float(n % 7) + 1);
        openvdb::initialize();
        openvdb::io::File out((folder / "whole.vdb").string());
        out.setCompression(compression | openvdb::io::COMPRESS_ACTIVE_MASK);
        out.write({grid});
        out.close();
        EXPECT_EQ(load_density(folder / "whole.vdb").density.value(1, 0, 0), 2);
        const std::vector<char> whole = test::bytes_of(folder / "whole.vdb");
        int chunks = 0;
        for (std::size_t at = 100; at + 40 < whole.size(); ++at) {
            std::int64_t size = 0;
            std::memcpy(&size, &whole[at], sizeof size);
            std::uint32_t inner = 0;
            std::memcpy(&inner, &whole[at + 8 + 12], sizeof inner);
            const bool blosc = whole[at + 8] == 2 && std::int64_t(inner) == size,
                       zip = size > 8 && size < 4000 && whole[at + 8] == 0x78 &&
                             std::uint8_t(whole[at + 9]) == 0x9C;
            if (!(compression == openvdb::io::COMPRESS_BLOSC ? blosc : zip)) continue;
            ++chunks;
            for (const std::int64_t more : {std::int64_t(4096), std::int64_t(whole.size() - at - 8)}) {
                std::vector<char> damaged = whole;
                const std::int64_t negative = -more;
                std::memcpy(&damaged[at], &negative, sizeof negative);
                test::write_bytes(folder / "negative.vdb", damaged);
                try {
                    load_density(folder / "negative.vdb");
                    ADD_FAILURE() << "chunk at byte " << at << " read as " << more;
                } catch (const Error& error) {
                    // OpenVDB says so itself where the file has no more bytes than there is room for.
                    const bool fits = more <= 512 * std::int64_t(sizeof(float));
                    EXPECT_NE(
                        std::string(error.what()).find(fits ? "Expected to read" : "where fewer belong"),
                        std::string::npos)
                        << error.what();
                }
            }
        }
        EXPECT_GT(chunks, 0);
    }
}

// Says whether voxels are doubles.
class VdbChunks : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(OfFloatsAndDoubles, VdbChunks, testing::Bool());

// Blosc reads as many bytes of a chunk as the chunk's own head says, whatever room they have in memory.
TEST_P(VdbChunks, OfBloscThatStateAnotherSizeAreDamage) {
    const TemporaryFolder folder;
    openvdb::initialize();
    const auto fog = foreign_fog();
    openvdb::GridBase::Ptr grid = fog;
    if (GetParam()) {
        grid = openvdb::DoubleGrid::create(openvdb::DoubleTree::Ptr(new openvdb::DoubleTree(fog->tree())));
        grid->setName("density");
    }
    openvdb::io::File out((folder / "whole.vdb").string());
    out.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
    out.write({grid});
    out.close();
    const std::vector<char> whole = test::bytes_of(folder / "whole.vdb");
    constexpr std::size_t kHead = 8, kSize = 12;  // of a chunk behind its size; of the size in it
    int chunks = 0;
    for (std::size_t at = 100; at + 40 < whole.size(); ++at) {
        std::int64_t size = 0;
        std::uint32_t inner = 0;
        std::memcpy(&size, &whole[at], sizeof size);
        std::memcpy(&inner, &whole[at + kHead + kSize], sizeof inner);
        if (whole[at + kHead] != 2 || size < 16 || std::int64_t(inner) != size) continue;
        ++chunks;
        for (const std::uint32_t stated : {inner + 1, inner - 1, 1u << 20, 0xFFFFFFFFu}) {
            std::vector<char> damaged = whole;
            std::memcpy(&damaged[at + kHead + kSize], &stated, sizeof stated);
            test::write_bytes(folder / "damaged.vdb", damaged);
            EXPECT_NE(error_of(folder / "damaged.vdb").find("states another size"), std::string::npos)
                << error_of(folder / "damaged.vdb");
        }
        if (chunks == 8) break;
    }
    EXPECT_EQ(chunks, 8);
}

// Numbers of 8 bytes in metadata, before the 4 bytes of the next name's length: 4 voxels, and a name of as many letters as Blosc's
// version or as that in the last byte of 2.
TEST(VdbRead, MetadataAreNoChunks) {
    const TemporaryFolder folder;
    openvdb::initialize();
    for (const bool with_offsets : {true, false})
        for (const std::size_t letters : {1u, 2u, 258u}) {
            auto grid = openvdb::FloatGrid::create();
            grid->setName("density");
            grid->setGridClass(openvdb::GRID_FOG_VOLUME);
            for (int i = 0; i < 4; ++i) grid->tree().setValue(Coord(i, 0, 0), 0.5f);
            grid->insertMeta("file_voxel_counu", openvdb::Int64Metadata(4));
            grid->insertMeta("file_voxel_counv" + std::string(letters, 'a'), openvdb::Int64Metadata(4));
            grid->insertMeta(std::string(letters, 'i'), openvdb::Vec2IMetadata(openvdb::Vec2i(4, 0)));
            grid->insertMeta(std::string(letters, 'j'), openvdb::Int64Metadata(1));
            if (with_offsets) {
                openvdb::io::File out((folder / "small.vdb").string());
                out.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
                out.write({grid});
                out.close();
            } else {
                std::ofstream file(folder / "small.vdb", std::ios::binary);
                openvdb::io::Stream out(file);
                out.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
                out.write(openvdb::GridCPtrVec{grid});
            }
            EXPECT_EQ(load_density(folder / "small.vdb").density.value(3, 0, 0), 0.5f) << letters;
            EXPECT_EQ(read_vdb_info(folder / "small.vdb").grids.size(), 1u);
        }
}

// Inactive values of 8 bytes before the mask of which voxel has which, of 64 or 4,096 bytes.
TEST(VdbRead, InactiveValuesAreNoSizesOfChunks) {
    const TemporaryFolder folder;
    openvdb::initialize();
    for (const std::uint32_t compression : {openvdb::io::COMPRESS_ZIP, openvdb::io::COMPRESS_BLOSC})
        for (const std::int64_t value : {-64, -512, -4096, 64, 4096}) {
            auto ids = openvdb::Int64Grid::create(0);
            ids->setName("ids");
            for (int i = 0; i < 40; ++i) {
                ids->tree().setValueOn(Coord(3 * i, 0, 0), i);
                ids->tree().setValueOff(Coord(3 * i + 1, 0, 0), value);
                ids->tree().addTile(2, Coord(0, 128 * i, 0), value, i % 2 == 0);
            }
            std::ofstream file(folder / "ids.vdb", std::ios::binary);
            openvdb::io::Stream out(file);
            out.setCompression(compression | openvdb::io::COMPRESS_ACTIVE_MASK);
            out.write(openvdb::GridCPtrVec{ids, foreign_fog()});
            file.close();
            EXPECT_EQ(read_vdb_info(folder / "ids.vdb").grids.size(), 2u) << value;
            EXPECT_NO_THROW(load_density(folder / "ids.vdb")) << value;
        }
}

// The flag of a tile is a byte on the stack, too. Taken for one that tells of inactive values, it would hide the size of the chunk.
TEST(VdbRead, FlagsOfTilesHideNoSizesOfChunks) {
    const TemporaryFolder folder;
    openvdb::initialize();
    auto mask = openvdb::BoolGrid::create(false);
    mask->setName("cld");
    {
        std::ofstream file(folder / "empty.vdb", std::ios::binary);
        openvdb::io::Stream out(file);
        out.setCompression(openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK);
        out.write(openvdb::GridCPtrVec{mask});
    }
    std::vector<char> file = test::bytes_of(folder / "empty.vdb");
    const auto add = [&](const auto& value) {
        const auto* bytes = reinterpret_cast<const char*>(&value);
        file.insert(file.end(), bytes, bytes + sizeof value);
    };
    constexpr std::size_t kEmptyTree = 13;  // number of buffers, background, numbers of tiles and children
    constexpr std::size_t kMask = 32 * 32 * 32 / 8;
    constexpr std::int64_t kMore = 200'000;
    const std::vector<char> head(file.begin(), file.end() - kEmptyTree);
    for (const char flag : {1, 2, 4, 5}) {
        file = head;
        add(std::int32_t(1));
        add(char(0));
        add(std::uint32_t(1));
        add(std::uint32_t(1));
        add(std::array<std::int32_t, 3>{0, 0, 0});
        add(char(0));
        add(flag);
        add(std::array<std::int32_t, 3>{4096, 0, 0});
        file.insert(file.end(), 2 * kMask, 0);
        file[file.size() - kMask] = 0x20;  // a value
        add(char(openvdb::io::NO_MASK_AND_ONE_INACTIVE_VAL));
        add(flag);  // the inactive value
        add(-kMore);
        file.insert(file.end(), std::size_t(kMore), 'A');
        test::write_bytes(folder / "hostile.vdb", file);
        EXPECT_NE(error_of(folder / "hostile.vdb").find("a chunk of 200000 bytes where fewer belong"),
                  std::string::npos)
            << int(flag) << ": " << error_of(folder / "hostile.vdb");
    }
}

// Inactive values of 8 bytes, all that their nodes store, before the mask of the node below. OpenVDB writes no such bits itself.
TEST(VdbRead, InactiveValuesOfHalvedDoublesAreNoSizesOfChunks) {
    const TemporaryFolder folder;
    openvdb::initialize();
    constexpr double kInactive = 5;
    for (const std::uint32_t compression : {openvdb::io::COMPRESS_ZIP, openvdb::io::COMPRESS_BLOSC})
        for (const int sign : {-1, 1}) {
            auto halves = openvdb::DoubleGrid::create(0);
            halves->setSaveFloatAsHalf(true);
            halves->tree().addTile(3, Coord(0), kInactive, false);
            halves->tree().setValueOn(Coord(1, 0, 0), 0.5);
            std::ofstream file(folder / "halves.vdb", std::ios::binary);
            openvdb::io::Stream out(file);
            out.setCompression(compression | openvdb::io::COMPRESS_ACTIVE_MASK);
            out.write(openvdb::GridCPtrVec{halves});
            file.close();
            std::vector<char> bytes = test::bytes_of(folder / "halves.vdb");
            std::vector<std::int64_t> sizes{64, 512};  // of the masks below nodes of level 1 and 2
            for (std::size_t at = 0; at + sizeof kInactive < bytes.size() && !sizes.empty(); ++at) {
                if (std::memcmp(&bytes[at], &kInactive, sizeof kInactive) != 0) continue;
                const std::int64_t number = sign * sizes.back();
                std::memcpy(&bytes[at], &number, sizeof number);
                sizes.pop_back();
            }
            ASSERT_TRUE(sizes.empty());
            test::write_bytes(folder / "halves.vdb", bytes);
            EXPECT_EQ(read_vdb_info(folder / "halves.vdb").grids.size(), 1u) << sign;
        }
}

TEST(VdbRead, FormatsOfAnotherAgeAreRefused) {
    const TemporaryFolder folder;
    openvdb::initialize();
    openvdb::io::File out((folder / "old.vdb").string());
    out.write({foreign_fog()});
    out.close();
    std::vector<char> bytes = test::bytes_of(folder / "old.vdb");
    constexpr std::size_t kVersion = 8;
    const std::uint32_t version = 215;
    std::memcpy(&bytes[kVersion], &version, sizeof version);
    test::write_bytes(folder / "old.vdb", bytes);
    EXPECT_NE(error_of(folder / "old.vdb").find("its format has version 215; expected at least 216"),
              std::string::npos)
        << error_of(folder / "old.vdb");
}

// Tiles whose 8 bytes are all the values of their node, before the mask of the node below, of 64 or 512 bytes.
TEST(VdbRead, TilesAreNoSizesOfChunks) {
    const TemporaryFolder folder;
    openvdb::initialize();
    const auto is_read = [&](const openvdb::GridBase::Ptr& grid, std::uint32_t compression) {
        grid->setName("ids");
        const auto fog = foreign_fog();
        std::ofstream file(folder / "tile.vdb", std::ios::binary);
        openvdb::io::Stream out(file);
        out.setCompression(compression | openvdb::io::COMPRESS_ACTIVE_MASK);
        out.write(openvdb::GridCPtrVec{grid, fog});
        file.close();
        const CoordBBox box = fog->evalActiveVoxelBoundingBox();
        expect_same_voxels(*fog, read_density(folder / "tile.vdb"),
                           [&](const Coord& c) { return c - box.min(); });
    };
    for (const std::uint32_t compression :
         {openvdb::io::COMPRESS_NONE, openvdb::io::COMPRESS_ZIP, openvdb::io::COMPRESS_BLOSC})
        for (const auto& [level, place, size] :
             {std::tuple(1, Coord(0, 0, 8), 64), std::tuple(2, Coord(0, 0, 128), 512)})
            for (const int sign : {-1, 1}) {
                for (const std::int64_t background : {std::int64_t(0), std::int64_t(1) << 62}) {
                    auto ids = openvdb::Int64Grid::create(background);
                    ids->tree().addTile(level, place, sign * size, true);
                    ids->tree().setValueOn(Coord(1, 0, 0), 5);
                    is_read(ids, compression);
                }
                auto pairs = openvdb::Int32Grid::create(0);
                pairs->tree().addTile(level, place, sign * size, true);
                pairs->tree().addTile(level, Coord(2 * place.z(), 0, 0), sign < 0 ? -1 : 0, true);
                pairs->tree().setValueOn(Coord(1, 0, 0), 5);
                is_read(pairs, compression);
            }
}

}  // namespace
}  // namespace nephos
