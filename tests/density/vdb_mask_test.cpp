// SPDX-License-Identifier: Apache-2.0
// Cloud masks of VDB files: which voxels are cloud, whatever their type, and where they are, whatever their shape.

#include <array>
#include <cmath>
#include <utility>

#include <gtest/gtest.h>
#include <openvdb/tools/Prune.h>

#include "core/error.h"
#include "density/vdb/mask_file.h"
#include "tests/density/vdb_test_files.h"

namespace nephos {
namespace {

using openvdb::BoolGrid;
using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::MaskGrid;
using test::TemporaryFolder;
using test::write_with_openvdb;

const CoordBBox kBox(Coord(3, -5, 2), Coord(22, 8, 11));  // 20 x 14 x 10

bool is_cloud(const Coord& c) { return (c.x() * 7 + c.y() * 13 + c.z() * 5) % 11 == 0; }

template <typename Grid>
typename Grid::Ptr grid_of(const openvdb::Vec3d& edges) {
    openvdb::initialize();
    auto grid = Grid::create();
    grid->setName("cld");
    auto transform = openvdb::math::Transform::createLinearTransform(1.0);
    transform->preScale(edges);
    grid->setTransform(transform);
    return grid;
}

// All of its box is active, so that the box is known.
BoolGrid::Ptr bool_grid(const openvdb::Vec3d& edges) {
    const auto grid = grid_of<BoolGrid>(edges);
    for (auto c = kBox.begin(); c; ++c) grid->tree().setValueOn(*c, is_cloud(*c));
    return grid;
}

void expect_voxels_of_the_file(const DensityGrid& found) {
    ASSERT_EQ(found.extent(), (Extent{20, 14, 10}));
    for (auto c = kBox.begin(); c; ++c) {
        const Coord at = *c - kBox.min();
        EXPECT_EQ(found.value(at.x(), at.y(), at.z()), is_cloud(*c) ? 1 : 0) << at;
    }
}

TEST(VdbMask, VoxelsAreThoseOfTheFileWhateverTheirHeight) {
    const TemporaryFolder folder;
    for (const double height : {100.0, 40.0, 99.9, 250.0}) {
        write_with_openvdb(folder / "mask.vdb", {bool_grid({100, 100, height})});
        const LoadedDensity loaded = load_mask(folder / "mask.vdb");
        expect_voxels_of_the_file(loaded.density);
        EXPECT_TRUE(loaded.notes.empty());
        EXPECT_DOUBLE_EQ(loaded.density.placement().cell_size_m, 100);
        EXPECT_DOUBLE_EQ(loaded.level_height_m, height);
        EXPECT_NEAR(loaded.density.placement().origin_m.z, 1.5 * height, 1e-9);
        EXPECT_NEAR(loaded.density.placement().origin_m.y, -550, 1e-9);
    }
}

TEST(VdbMask, OfAFogVolumeAreItsVoxels) {
    const TemporaryFolder folder;
    const auto fog = grid_of<openvdb::FloatGrid>({50, 50, 20});
    for (auto c = kBox.begin(); c; ++c) fog->tree().setValueOn(*c, is_cloud(*c) ? 1.0f : 0.0f);
    write_with_openvdb(folder / "fog.vdb", {fog});
    VdbReadOptions options;
    options.grid = "cld";
    const LoadedDensity loaded = load_mask(folder / "fog.vdb", 0, options);
    expect_voxels_of_the_file(loaded.density);
    EXPECT_DOUBLE_EQ(loaded.level_height_m, 20);
}

// A double of 0.1 is not above 0.1, though the nearest float is; and 1e300 is a number.
TEST(VdbMask, DoublesAreComparedAsTheyAre) {
    const TemporaryFolder folder;
    const auto fog = grid_of<openvdb::DoubleGrid>({50, 50, 50});
    const std::array<double, 5> values{0.1, 0.3, 1e-50, 1e300, -1};
    for (int n = 0; n < 5; ++n) fog->tree().setValueOn(Coord(n, 0, 0), values[std::size_t(n)]);
    write_with_openvdb(folder / "fog.vdb", {fog});
    for (const auto& [threshold, expected] : {std::pair(0.0, std::array<int, 5>{1, 1, 1, 1, 0}),
                                              std::pair(0.1, std::array<int, 5>{0, 1, 0, 1, 0}),
                                              std::pair(0.3, std::array<int, 5>{0, 0, 0, 1, 0})}) {
        VdbReadOptions options;
        options.grid = "cld";
        const DensityGrid found = load_mask(folder / "fog.vdb", threshold, options).density;
        ASSERT_EQ(found.extent(), (Extent{5, 1, 1}));
        for (int n = 0; n < 5; ++n)
            EXPECT_EQ(found.value(n, 0, 0), expected[std::size_t(n)]) << threshold << ", " << n;
    }
}

// Axes in another order: the voxels' height lies along the file's first one.
TEST(VdbMask, AxesMayBeExchanged) {
    const TemporaryFolder folder;
    const auto grid = grid_of<BoolGrid>({1, 1, 1});
    grid->setTransform(openvdb::math::Transform::createLinearTransform(
        openvdb::Mat4d(0, 0, 40, 0, 100, 0, 0, 0, 0, -100, 0, 0, 0, 0, 0, 1)));
    for (auto c = kBox.begin(); c; ++c) grid->tree().setValueOn(*c, is_cloud(*c));
    write_with_openvdb(folder / "turned.vdb", {grid});
    const LoadedDensity loaded = load_mask(folder / "turned.vdb");
    ASSERT_EQ(loaded.density.extent(), (Extent{14, 10, 20}));
    EXPECT_DOUBLE_EQ(loaded.level_height_m, 40);
    for (auto c = kBox.begin(); c; ++c)
        EXPECT_EQ(loaded.density.value((*c).y() - kBox.min().y(), kBox.max().z() - (*c).z(),
                                       (*c).x() - kBox.min().x()),
                  is_cloud(*c) ? 1 : 0);
}

// Notices what is below 0, or no number, where voxels are resampled, too, in parts without cloud.
TEST(VdbMask, ResampledValuesBelowZeroAreCounted) {
    const TemporaryFolder folder;
    for (const double edge : {100.0, 60.0}) {
        const auto fog = grid_of<openvdb::FloatGrid>({100, edge, edge});
        fog->tree().setValueOn(Coord(0), 1.0f);
        fog->tree().setValueOn(Coord(64, 0, 0), -1.0f);
        write_with_openvdb(folder / "fog.vdb", {fog});
        VdbReadOptions options;
        options.grid = "cld";
        EXPECT_GT(load_mask(folder / "fog.vdb", -0.5, options).negative, 0u);
        fog->tree().setValueOn(Coord(64, 0, 0), std::nanf(""));
        write_with_openvdb(folder / "fog.vdb", {fog});
        for (const double threshold : {-0.5, 0.5})
            EXPECT_THROW(load_mask(folder / "fog.vdb", threshold, options), Error);
    }
}

// The value of a mask is 1, which is not above 1.
TEST(VdbMask, ThresholdsAreThoseOfMasksToo) {
    const TemporaryFolder folder;
    write_with_openvdb(folder / "mask.vdb", {bool_grid({100, 100, 100})});
    EXPECT_GT(load_mask(folder / "mask.vdb", 0.99).density.active_voxels(), 0u);
    const DensityGrid none = load_mask(folder / "mask.vdb", 1).density;
    EXPECT_EQ(none.extent(), (Extent{20, 14, 10}));
    EXPECT_EQ(none.value(0, 0, 0), 0);
    EXPECT_EQ(none.active_voxels(), 0u);
}

// Means of neighbours would make cloud of the clear voxels beside a cloud.
TEST(VdbMask, ResampledVoxelsAreTheNearestOnes) {
    const TemporaryFolder folder;
    const auto grid = bool_grid({100, 50, 50});
    write_with_openvdb(folder / "wide.vdb", {grid});
    const LoadedDensity loaded = load_mask(folder / "wide.vdb");
    EXPECT_EQ(loaded.notes.size(), 1u);
    EXPECT_DOUBLE_EQ(loaded.level_height_m, 50);
    ASSERT_EQ(loaded.density.extent(), (Extent{40, 14, 10}));
    for (int k = 0; k < 10; ++k)
        for (int j = 0; j < 14; ++j)
            for (int i = 0; i < 40; ++i)
                EXPECT_EQ(loaded.density.value(i, j, k), is_cloud(kBox.min() + Coord(i / 2, j, k)) ? 1 : 0);
}

// A mask grid's tiles store a value that says nothing: topologyUnion() makes active ones that store false.
TEST(VdbMask, TilesOfMaskGridsAreCloudWhereTheyAreActive) {
    const TemporaryFolder folder;
    const auto fog = openvdb::FloatGrid::create(0.0f);
    fog->denseFill(CoordBBox(Coord(0), Coord(31, 31, 15)), 1.0f);
    fog->tree().setValueOn(Coord(32, 3, 3), 1.0f);
    openvdb::tools::pruneTiles(fog->tree());
    for (const bool with_union : {true, false}) {
        auto mask = grid_of<MaskGrid>({10, 10, 10});
        if (with_union)
            mask->topologyUnion(*fog);
        else
            for (auto c = fog->evalActiveVoxelBoundingBox().begin(); c; ++c)
                if (fog->tree().isValueOn(*c)) mask->tree().setValueOn(*c);
        write_with_openvdb(folder / "mask.vdb", {mask});
        const DensityGrid found = load_mask(folder / "mask.vdb").density;
        EXPECT_EQ(found.extent(), (Extent{33, 32, 16}));
        EXPECT_EQ(found.active_voxels(), 32u * 32 * 16 + 1);
    }
}

TEST(VdbMask, StatesTakeTilesOfMaskGrids) {
    const TemporaryFolder folder;
    openvdb::GridPtrVec grids;
    for (const char* name : {"hum", "act", "cld"}) {
        auto mask = grid_of<MaskGrid>({1, 1, 1});
        mask->setName(name);
        mask->tree().addTile(1, Coord(8, 0, 0), false, true);
        mask->tree().setValueOn(Coord(1, 2, 3));
        grids.push_back(mask);
    }
    write_with_openvdb(folder / "state.vdb", grids);
    const Lattice state = read_state(folder / "state.vdb", {16, 8, 8}, {{0, 0, 0}, 1}, {});
    EXPECT_EQ(state.hum.count(), 513u);
    EXPECT_TRUE(state.cld.get(15, 7, 7));
    EXPECT_TRUE(state.cld.get(1, 2, 3));
}

// A hundredth of a voxel at the far side, and not a small angle, is what may be turned.
TEST(VdbSamples, OfAxesThatAreTurnedAreRefused) {
    const TemporaryFolder folder;
    for (const double angle : {1e-7, 1e-3}) {
        auto wind = grid_of<openvdb::Vec3SGrid>({100, 100, 100});
        wind->setName("vel");
        wind->transform().postRotate(angle, openvdb::math::Z_AXIS);
        wind->tree().fill(CoordBBox(Coord(0), Coord(999, 3, 3)), openvdb::Vec3s(1, 2, 0));
        write_with_openvdb(folder / "wind.vdb", {wind});
        if (angle < 1e-6)
            EXPECT_EQ(read_samples(folder / "wind.vdb", "vel", 3).points[0], 1000);
        else
            EXPECT_THROW(read_samples(folder / "wind.vdb", "vel", 3), Error);
    }
}

}  // namespace
}  // namespace nephos
