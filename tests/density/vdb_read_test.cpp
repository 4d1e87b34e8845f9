// SPDX-License-Identifier: Apache-2.0

// Files that others made, and files that nobody should have made.

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"
#include "density/smoothing.h"
#include "density/vdb/block_stream.h"
#include "density/vdb/sanitized.h"
#include "density/vdb/vdb_file.h"
#include "tests/density/foreign_fog.h"
#include "tests/density/naive_smoothing.h"
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
using test::write_with_openvdb;

// A file of nephos' own; returns the grid in it.
DensityGrid write_own(const std::filesystem::path& path) {
    const Extent extent{33, 20, 11};
    const BitPlane plane = test::random_plane(extent, 0.1, 8);
    const TimedPlane timed[] = {{plane.view(), 0}};
    const Placement placement{{-100, 200, 50}, 25};
    const DensityGrid grid = smooth(timed, {SmoothingKernel::box, 1, 1, 1, 0}, placement, {});
    VdbContent content;
    content.density = &grid;
    content.hum = content.act = content.cld = plane.view();
    content.cells = placement;
    write_vdb(path, content, {0.03, 7, 2, 24, 120, 99, "a", "b", "c", 3});
    return grid;
}

TEST(VdbRead, OwnFilesComeBackAsTheyWere) {
    const TemporaryFolder folder;
    const DensityGrid grid = write_own(folder / "own.vdb");
    const LoadedDensity loaded = load_density(folder / "own.vdb");
    EXPECT_EQ(loaded.density.to_dense(), grid.to_dense());
    EXPECT_EQ(loaded.density.extent(), grid.extent());
    EXPECT_EQ(loaded.density.placement(), grid.placement());
    EXPECT_EQ(loaded.grid_name, "density");
    ASSERT_TRUE(loaded.metadata);
    EXPECT_EQ(*loaded.metadata, (VdbMetadata{0.03, 7, 2, 24, 120, 99, "a", "b", "c", 3}));
    EXPECT_TRUE(loaded.notes.empty());
}

TEST(VdbRead, ForeignVoxelsKeepValuesAndPlace) {
    const TemporaryFolder folder;
    const auto grid = foreign_fog();
    write_with_openvdb(folder / "fog.vdb", {grid});
    const LoadedDensity loaded = load_density(folder / "fog.vdb");
    const CoordBBox box = grid->evalActiveVoxelBoundingBox();
    EXPECT_EQ(loaded.density.extent(), (Extent{box.dim().x(), box.dim().y(), box.dim().z()}));
    EXPECT_FALSE(loaded.metadata);
    expect_same_voxels(*grid, loaded.density, [&](const Coord& c) { return c - box.min(); });
    const Placement placement = loaded.density.placement();
    EXPECT_DOUBLE_EQ(placement.cell_size_m, 2.5);
    const openvdb::Vec3d corner = grid->indexToWorld(box.min().asVec3d() - 0.5);
    EXPECT_NEAR(placement.origin_m.x, corner.x(), 1e-9);
    EXPECT_NEAR(placement.origin_m.y, corner.y(), 1e-9);
    EXPECT_NEAR(placement.origin_m.z, corner.z(), 1e-9);
}

TEST(VdbRead, FindsTheGridThatIsMeant) {
    const TemporaryFolder folder;
    auto first = foreign_fog(), second = foreign_fog();
    first->setName("smoke");
    second->setName("density");
    second->setTransform(openvdb::math::Transform::createLinearTransform(9.0));
    auto bits = openvdb::BoolGrid::create(false);
    bits->setName("mask");
    write_with_openvdb(folder / "two.vdb", {bits, first, second});
    EXPECT_EQ(load_density(folder / "two.vdb").grid_name, "density");
    VdbReadOptions options;
    options.grid = "smoke";
    EXPECT_EQ(load_density(folder / "two.vdb", options).density.placement().cell_size_m, 2.5);
    options.grid = "mask";
    EXPECT_NE(error_of(folder / "two.vdb", options).find("not a float fog volume"), std::string::npos);
    options.grid = "fire";
    EXPECT_NE(error_of(folder / "two.vdb", options).find("smoke"), std::string::npos);
    write_with_openvdb(folder / "one.vdb", {bits, first});
    EXPECT_EQ(load_density(folder / "one.vdb").grid_name, "smoke");
}

TEST(VdbRead, OtherKindsOfFloats) {
    const TemporaryFolder folder;
    const auto grid = foreign_fog();
    const CoordBBox box = grid->evalActiveVoxelBoundingBox();
    const auto index = [&](const Coord& c) { return c - box.min(); };
    // Double precision.
    auto wide = openvdb::DoubleGrid::create(openvdb::DoubleTree::Ptr(new openvdb::DoubleTree(grid->tree())));
    wide->setName("density");
    wide->setTransform(grid->transformPtr());
    write_with_openvdb(folder / "double.vdb", {wide});
    expect_same_voxels(*grid, read_density(folder / "double.vdb"), index);
    // Two grids that share one tree; the one that is asked for is the instance.
    auto twin = FloatGrid::create(grid->treePtr());
    twin->setName("twin");
    twin->setTransform(openvdb::math::Transform::createLinearTransform(7.0));
    write_with_openvdb(folder / "shared.vdb", {grid, twin});
    VdbReadOptions options;
    options.grid = "twin";
    expect_same_voxels(*grid, read_density(folder / "shared.vdb", options), index);
    EXPECT_DOUBLE_EQ(read_density(folder / "shared.vdb", options).placement().cell_size_m, 7.0);
    // A stream without offsets.
    {
        std::ofstream stream(folder / "stream.vdb", std::ios::binary);
        openvdb::io::Stream(stream).write(openvdb::GridCPtrVec{grid, twin});
    }
    expect_same_voxels(*grid, read_density(folder / "stream.vdb"), index);
    // Half.
    grid->setSaveFloatAsHalf(true);
    write_with_openvdb(folder / "half.vdb", {grid});
    const DensityGrid half = read_density(folder / "half.vdb");
    for (auto value = grid->cbeginValueOn(); value; ++value) {
        const Coord at = index(value.getCoord());
        ASSERT_NEAR(half.value(at.x(), at.y(), at.z()), *value, *value * 0x1p-11);
    }
}

TEST(VdbRead, NegativeValuesBecomeZeroAndAreNoted) {
    const TemporaryFolder folder;
    auto grid = foreign_fog();
    grid->tree().setValue(Coord(0, 0, 10), -0.5f);
    grid->tree().setValue(Coord(1, 0, 10), -0.25f);
    write_with_openvdb(folder / "negative.vdb", {grid});
    const LoadedDensity loaded = load_density(folder / "negative.vdb");
    ASSERT_EQ(loaded.notes.size(), 1u);
    EXPECT_EQ(loaded.notes[0], "2 values below 0 were set to 0");
    grid->tree().addTile(1, Coord(8, 0, 0), -1.0f, true);  // one of 8 x 8 x 8 voxels
    write_with_openvdb(folder / "tile.vdb", {grid});
    EXPECT_EQ(load_density(folder / "tile.vdb").notes[0], "514 values below 0 were set to 0");
}

TEST(VdbRead, RefusesWhatIsNoFogVolume) {
    const TemporaryFolder folder;
    write_with_openvdb(folder / "sphere.vdb",
                       {openvdb::tools::createLevelSetSphere<FloatGrid>(10, {0, 0, 0}, 0.5f)});
    EXPECT_NE(error_of(folder / "sphere.vdb").find("no float fog volume"), std::string::npos);
    auto fog = foreign_fog();
    fog->tree().setValue(Coord(0, 0, 10), std::numeric_limits<float>::quiet_NaN());
    write_with_openvdb(folder / "nan.vdb", {fog});
    EXPECT_NE(error_of(folder / "nan.vdb").find("finite"), std::string::npos);
    auto everywhere = FloatGrid::create(0.5f);
    everywhere->setName("density");
    write_with_openvdb(folder / "background.vdb", {everywhere});
    EXPECT_NE(error_of(folder / "background.vdb").find("background"), std::string::npos);
    auto frustum = foreign_fog();
    frustum->setTransform(
        openvdb::math::Transform::createFrustumTransform(openvdb::BBoxd({0, 0, 0}, {50, 50, 50}), 0.5, 10));
    write_with_openvdb(folder / "frustum.vdb", {frustum});
    EXPECT_NE(error_of(folder / "frustum.vdb").find("frustum"), std::string::npos);
    write_with_openvdb(folder / "none.vdb", {});
    EXPECT_NE(error_of(folder / "none.vdb"), "");
    VdbReadOptions options;
    options.metres_per_unit = 0;
    EXPECT_THROW(load_density(folder / "nan.vdb", options), Error);
}

TEST(VdbRead, HugeBoundsAreRefusedBeforeTheyCostMemory) {
    const TemporaryFolder folder;
    auto far = FloatGrid::create(0.0f);
    far->setName("density");
    far->tree().setValue(Coord(-2000000000), 1.0f);
    far->tree().setValue(Coord(2000000000), 1.0f);
    write_with_openvdb(folder / "far.vdb", {far});
    EXPECT_NE(error_of(folder / "far.vdb").find("too large"), std::string::npos)
        << error_of(folder / "far.vdb");
    // The same without OpenVDB's statistics in the file.
    {
        openvdb::io::File file((folder / "silent.vdb").string());
        file.setGridStatsMetadataEnabled(false);
        file.write(openvdb::GridPtrVec{far});
    }
    EXPECT_NE(error_of(folder / "silent.vdb").find("too large"), std::string::npos);
    auto full = FloatGrid::create(0.0f);
    full->setName("density");
    full->tree().addTile(3, Coord(0), 1.0f, true);  // 4096^3 voxels in a few bytes
    write_with_openvdb(folder / "full.vdb", {full});
    EXPECT_NE(error_of(folder / "full.vdb").find("memory"), std::string::npos)
        << error_of(folder / "full.vdb");
    VdbReadOptions options;
    options.limits.seconds = 1e-9;  // over before the reader can have begun, however slow this process is
    write_with_openvdb(folder / "fog.vdb", {foreign_fog()});
    EXPECT_NE(error_of(folder / "fog.vdb", options).find("longer"), std::string::npos);
}

#if !NEPHOS_SANITIZED  // which keep the reading process from having limits
// A length of 4 GiB for a text in the header of 100 bytes: OpenVDB makes room for it before it reads.
TEST(VdbRead, MemoryIsBoundedByTheSizeOfTheFile) {
    const TemporaryFolder folder;
    write_own(folder / "whole.vdb");
    auto bytes = test::bytes_of(folder / "whole.vdb");
    constexpr std::size_t kTextLength = 61;
    bytes.resize(100);
    std::fill_n(bytes.begin() + kTextLength, 4, char(0xFF));
    test::write_bytes(folder / "greedy.vdb", bytes);
    std::string message;
    try {
        read_vdb_info(folder / "greedy.vdb");
    } catch (const Error& error) {
        message = error.what();
    }
    EXPECT_NE(message.find("more than 256 MiB of memory, the most for a file of its size"), std::string::npos)
        << message;
    EXPECT_EQ(message.find("damaged"), std::string::npos) << message;
    // A file of a kilobyte may still hold a box of 256^3 voxels.
    auto full = FloatGrid::create(0.0f);
    full->setName("density");
    full->fill(openvdb::CoordBBox(Coord(0), Coord(255)), 1.0f);
    write_with_openvdb(folder / "full.vdb", {full});
    EXPECT_EQ(error_of(folder / "full.vdb"), "");
}
#endif

TEST(VdbRead, WhatIsNoFileIsAClearError) {
    const TemporaryFolder folder;
    EXPECT_NE(error_of(folder / "missing.vdb"), "");
    std::filesystem::create_directory(folder / "folder.vdb");
    EXPECT_NE(error_of(folder / "folder.vdb").find("folder"), std::string::npos);
    test::write_bytes(folder / "empty.vdb", {});
    EXPECT_NE(error_of(folder / "empty.vdb").find("empty"), std::string::npos);
    test::write_bytes(folder / "text.vdb", std::vector<char>(5000, 'x'));
    EXPECT_NE(error_of(folder / "text.vdb").find("not an OpenVDB file"), std::string::npos);
    ASSERT_EQ(::mkfifo((folder / "pipe.vdb").c_str(), 0600), 0);
    EXPECT_NE(error_of(folder / "pipe.vdb").find("regular"), std::string::npos);
    std::filesystem::create_symlink(folder / "loop.vdb", folder / "loop.vdb");
    EXPECT_NE(error_of(folder / "loop.vdb"), "");
}

TEST(VdbRead, UnreadableFileIsAClearError) {
    if (::geteuid() == 0) GTEST_SKIP() << "root may read every file";
    const TemporaryFolder folder;
    write_own(folder / "secret.vdb");
    std::filesystem::permissions(folder / "secret.vdb", std::filesystem::perms::none);
    EXPECT_NE(error_of(folder / "secret.vdb").find("Permission denied"), std::string::npos);
}

// A real file cut off anywhere: always an error, never a crash, a hang or a silent half.
TEST(VdbRead, TruncatedFilesAreErrors) {
    const TemporaryFolder folder;
    write_own(folder / "whole.vdb");
    const auto bytes = test::bytes_of(folder / "whole.vdb");
    ASSERT_EQ(error_of(folder / "whole.vdb"), "");
    const std::size_t step = std::max<std::size_t>(1, bytes.size() / 150);
    for (std::size_t size = 0; size < bytes.size(); size += size < 64 ? 7 : step) {
        test::write_bytes(folder / "cut.vdb", {bytes.begin(), bytes.begin() + std::ptrdiff_t(size)});
        const std::string message = error_of(folder / "cut.vdb");
        EXPECT_NE(message, "") << "cut at byte " << size;
        EXPECT_LT(message.size(), 600u) << "cut at byte " << size;
    }
    test::write_bytes(folder / "cut.vdb", {bytes.begin(), bytes.end() - 1});
    EXPECT_NE(error_of(folder / "cut.vdb"), "");
    EXPECT_THROW(read_state(folder / "cut.vdb", {33, 20, 11}, {{-100, 200, 50}, 25}), Error);
    EXPECT_THROW(read_vdb_info(folder / "cut.vdb"), Error);
}

// Bytes changed at random: a grid or an error, within the limits.
TEST(VdbRead, DamagedFilesNeverTakeTheProcessDown) {
    if (NEPHOS_SANITIZED) GTEST_SKIP() << "a sanitizer ends what asks for terabytes, where it would throw";
    const TemporaryFolder folder;
    write_own(folder / "whole.vdb");
    const auto bytes = test::bytes_of(folder / "whole.vdb");
    std::mt19937 random(17);
    VdbReadOptions options;
    options.limits.memory_bytes = std::size_t{512} << 20;
    options.limits.seconds = 20;
    int errors = 0;
    for (int n = 0; n < 120; ++n) {
        auto damaged = bytes;
        // The first half of the damage lies in the headers, where lengths and offsets are.
        const std::size_t reach = n % 2 ? damaged.size() : std::min<std::size_t>(damaged.size(), 1200);
        for (int m = 0; m < 1 + n % 8; ++m) damaged[8 + random() % (reach - 8)] = char(random());
        test::write_bytes(folder / "damaged.vdb", damaged);
        const std::string message = error_of(folder / "damaged.vdb", options);
        errors += !message.empty();
        EXPECT_LT(message.size(), 600u);
    }
    EXPECT_GT(errors, 20);
}

// Numbers that are none would go on into the wind and the place of what is rendered.
TEST(VdbRead, MetadataThatIsNotFiniteIsDamage) {
    const TemporaryFolder folder;
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN(),
                     kInfinite = std::numeric_limits<double>::infinity();
    const auto message_with = [&](const char* name, const openvdb::Metadata& value) {
        const auto grid = foreign_fog();
        grid->insertMeta("nephos_version", openvdb::StringMetadata("1"));
        grid->insertMeta("nephos_latitude_deg", openvdb::DoubleMetadata(50));
        grid->insertMeta(name, value);
        write_with_openvdb(folder / "metadata.vdb", {grid});
        return error_of(folder / "metadata.vdb");
    };
    EXPECT_EQ(message_with("nephos_heading_deg", openvdb::DoubleMetadata(90)), "");
    constexpr const char* kSays = "it is damaged: its metadata has a number that is not finite";
    for (const char* name :
         {"nephos_time_s", "nephos_latitude_deg", "nephos_longitude_deg", "nephos_height_m"})
        for (const double number : {kNone, kInfinite}) {
            const std::string message = message_with(name, openvdb::DoubleMetadata(number));
            EXPECT_NE(message.find(kSays), std::string::npos) << message;
        }
    const std::string message = message_with("nephos_period_m", openvdb::Vec3DMetadata({0, kNone, 0}));
    EXPECT_NE(message.find(kSays), std::string::npos) << message;
}

// Tiles of 17 bytes, each alone in 4096 x 4096 x 4096 voxels, make a tree of 300 KB each; side by side they make one node.
TEST(VdbRead, ScatteredTilesTakeBoundedMemory) {
    const auto message_at = [](std::size_t shift) {
        constexpr SandboxLimits kLimits{.seconds = 60, .memory_bytes = 64u << 20, .most_bytes = 64u << 20};
        const Extent extent{1 << 19, 1 << 19, 1 << 19};
        try {
            run_sandboxed(
                "subject", "OpenVDB", kLimits, {},
                [&](SandboxWriter& writer) {
                    for (int n = 0; n < 16 * 16 * 16; ++n)
                        send_tile(writer, Coord(n >> 8, n >> 4 & 15, n & 15) << shift, 1);
                    send_end(writer);
                },
                [&](SandboxReader& reader) { receive_blocks(reader, extent, {}); });
        } catch (const Error& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(message_at(3), "");
    for (const std::size_t shift : {7, 12})
        EXPECT_EQ(message_at(shift),
                  "subject: cannot read: it takes more than the 64 MiB of memory that are allowed");
}

TEST(VdbRead, InfoListsEveryGrid) {
    const TemporaryFolder folder;
    const DensityGrid grid = write_own(folder / "own.vdb");
    const VdbInfo info = read_vdb_info(folder / "own.vdb");
    EXPECT_EQ(info.file_version, "10.0/224");
    ASSERT_EQ(info.grids.size(), 4u);
    const VdbGridInfo& density = info.grids[0];
    EXPECT_EQ(density.name, "density");
    EXPECT_EQ(density.type, "float");
    EXPECT_EQ(density.grid_class, "fog volume");
    EXPECT_EQ(density.voxel_size, (Vec3{25, 25, 25}));
    EXPECT_EQ(density.active_box, (VoxelBox{{0, 0, 0}, {32, 19, 10}}));
    EXPECT_EQ(info.grids[3].name, "cld");
    EXPECT_EQ(info.grids[3].type, "bool");
    const auto has = [](const auto& metadata, const std::string& name, const std::string& value) {
        return std::ranges::find_if(metadata, [&](const VdbMetadataEntry& e) {
                   return e.name == name && e.value == value;
               }) != metadata.end();
    };
    EXPECT_TRUE(has(density.metadata, "nephos_seed", "99"));
    EXPECT_TRUE(has(density.metadata, "nephos_extinction_per_m", "0.03"));
    EXPECT_TRUE(has(density.metadata, "nephos_bbox_max", "[32, 18, 9]") ||
                has(density.metadata, "nephos_bbox_max", "[32, 19, 10]"));
    const Vec3 origin = grid.placement().origin_m;
    EXPECT_EQ(density.world_from_index,
              (Matrix4{25, 0, 0, origin.x + 12.5, 0, 25, 0, origin.y + 12.5, 0, 0, 25, origin.z + 12.5, 0, 0, 0, 1}));
    EXPECT_TRUE(has(info.metadata, "nephos_scene_hash", "a"));
    // Without statistics in the file they are counted.
    auto fog = foreign_fog();
    fog->setSaveFloatAsHalf(true);
    {
        openvdb::io::File file((folder / "silent.vdb").string());
        file.setGridStatsMetadataEnabled(false);
        file.write(openvdb::GridPtrVec{fog});
    }
    const VdbInfo counted = read_vdb_info(folder / "silent.vdb");
    EXPECT_EQ(counted.grids[0].active_voxels, fog->activeVoxelCount());
    EXPECT_EQ(counted.grids[0].type, "half");
    EXPECT_EQ(counted.grids[0].active_box.min[0], fog->evalActiveVoxelBoundingBox().min().x());
}

// The cloud data set of Walt Disney Animation Studios, where somebody has it.
TEST(VdbRead, DisneyCloud) {
    const char* const variable = std::getenv("NEPHOS_TEST_DATA");
    const std::filesystem::path folder = variable != nullptr ? variable : NEPHOS_TEST_DATA;
    const std::filesystem::path path = folder / "wdas_cloud_sixteenth.vdb";
    if (!std::filesystem::exists(path))
        GTEST_SKIP() << path << " is not there: set NEPHOS_TEST_DATA to its folder";
    const auto file = test::read_with_openvdb(path);
    const auto grid = file.get<FloatGrid>("density");
    ASSERT_TRUE(grid);
    const CoordBBox box = grid->evalActiveVoxelBoundingBox();
    VdbReadOptions options;
    options.up_axis = UpAxis::y;
    const LoadedDensity loaded = load_density(path, options);
    EXPECT_EQ(loaded.density.extent(), (Extent{126, 154, 86}));
    expect_same_voxels(*grid, loaded.density, [&](const Coord& c) {
        return Coord(c.x() - box.min().x(), box.max().z() - c.z(), c.y() - box.min().y());
    });
    EXPECT_EQ(read_vdb_info(path).grids.at(0).active_voxels, 415642u);
    EXPECT_EQ(read_density(path).extent(), (Extent{126, 86, 154}));
}

}  // namespace
}  // namespace nephos
