// SPDX-License-Identifier: Apache-2.0

// Where voxels of a file lie: axes in another order, turned, of another length, and what resampling makes of them.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include "density/vdb/vdb_file.h"
#include "tests/density/foreign_fog.h"
#include "tests/density/vdb_test_files.h"

namespace nephos {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using test::expect_same_voxels;
using test::foreign_fog;
using test::TemporaryFolder;
using test::write_with_openvdb;

// Voxels of no binary size, the first of them far from the origin: what is written of them lies at the same place again.
TEST(VdbRead, PlacesKeepEveryDigit) {
    const TemporaryFolder folder;
    for (const double size : {0.05, 0.1, 0.3, 30.48}) {
        for (const int first : {-3000, -64, 150}) {
            const auto grid = FloatGrid::create(0.0f);
            grid->setName("density");
            grid->setTransform(openvdb::math::Transform::createLinearTransform(size));
            grid->fill(CoordBBox::createCube({first, first + 3, first - 1}, 8), 0.5f);
            write_with_openvdb(folder / "fog.vdb", {grid});
            const DensityGrid fog = load_density(folder / "fog.vdb").density;
            EXPECT_EQ(fog.placement().cell_size_m, size);
            VdbContent content;
            content.density = &fog;
            content.cells = fog.placement();
            write_vdb(folder / "own.vdb", content, {});
            const Placement again = load_density(folder / "own.vdb").density.placement();
            EXPECT_EQ(again.cell_size_m, size) << first;
            for (int a = 0; a < 3; ++a)
                EXPECT_NEAR(again.origin_m[a], fog.placement().origin_m[a],
                            1e-15 * std::abs(fog.placement().origin_m[a]));
        }
    }
}

TEST(VdbRead, YUpFilesArePermuted) {
    const TemporaryFolder folder;
    const auto grid = foreign_fog();
    write_with_openvdb(folder / "fog.vdb", {grid});
    VdbReadOptions options;
    options.up_axis = UpAxis::y;
    options.metres_per_unit = 2;
    const LoadedDensity loaded = load_density(folder / "fog.vdb", options);
    const CoordBBox box = grid->evalActiveVoxelBoundingBox();
    EXPECT_EQ(loaded.density.extent(), (Extent{box.dim().x(), box.dim().z(), box.dim().y()}));
    expect_same_voxels(*grid, loaded.density, [&](const Coord& c) {
        return Coord(c.x() - box.min().x(), box.max().z() - c.z(), c.y() - box.min().y());
    });
    // World: x stays, the file's z points south, its y up; twice as large.
    const Placement placement = loaded.density.placement();
    EXPECT_DOUBLE_EQ(placement.cell_size_m, 5.0);
    EXPECT_NEAR(placement.origin_m.x, 2 * 2.5 * (box.min().x() - 0.5), 1e-9);
    EXPECT_NEAR(placement.origin_m.y, 2 * 2.5 * (-box.max().z() - 0.5), 1e-9);
    EXPECT_NEAR(placement.origin_m.z, 2 * 2.5 * (box.min().y() - 0.5), 1e-9);
    // The file may say so itself.
    grid->insertMeta("nephos_up_axis", openvdb::StringMetadata("y"));
    write_with_openvdb(folder / "said.vdb", {grid});
    EXPECT_EQ(load_density(folder / "said.vdb").density.extent(), loaded.density.extent());
}

// Axes in another order and direction in the transform itself.
TEST(VdbRead, PermutedTransformsArePermuted) {
    const TemporaryFolder folder;
    const auto grid = foreign_fog();
    // Index x runs along world z, y against world x, z along world y.
    const openvdb::Mat4d matrix(0, 0, 4, 0, -4, 0, 0, 0, 0, 4, 0, 0, 10, 20, 30, 1);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(matrix));
    write_with_openvdb(folder / "turned.vdb", {grid});
    const LoadedDensity loaded = load_density(folder / "turned.vdb");
    EXPECT_TRUE(loaded.notes.empty());
    const DensityGrid& density = loaded.density;
    for (auto value = grid->cbeginValueOn(); value; ++value) {
        for (auto c = value.getBoundingBox().begin(); c; ++c) {
            const openvdb::Vec3d w = grid->indexToWorld(*c);
            const Placement p = density.placement();
            const auto at = [](double world, double origin, double size) {
                return int(std::floor((world - origin) / size));
            };
            ASSERT_EQ(density.value(at(w.x(), p.origin_m.x, 4), at(w.y(), p.origin_m.y, 4),
                                    at(w.z(), p.origin_m.z, 4)),
                      *value);
        }
    }
}

// As in cubes, where they are 0, too: a program may take voxels out of a cloud without setting their values.
TEST(VdbRead, InactiveVoxelsAddNothingWhereVoxelsAreResampled) {
    const TemporaryFolder folder;
    std::vector<float> first;
    for (const float inactive : {0.0f, 100.0f, std::numeric_limits<float>::quiet_NaN()}) {
        auto grid = FloatGrid::create(0.0f);
        grid->setName("density");
        grid->setTransform(openvdb::math::Transform::createLinearTransform(1.0));
        grid->transform().preScale(openvdb::Vec3d(1, 1, 2));
        for (auto c = CoordBBox(Coord(0), Coord(7)).begin(); c; ++c) {
            if (((*c).x() + (*c).y()) % 2 == 0)
                grid->tree().setValueOn(*c, 0.5f);
            else
                grid->tree().setValueOff(*c, inactive);
        }
        write_with_openvdb(folder / "flat.vdb", {grid});
        const DensityGrid found = load_density(folder / "flat.vdb").density;
        std::vector<float> values;
        for (auto c = CoordBBox(Coord(0), Coord(7)).begin(); c; ++c)
            values.push_back(found.value((*c).x(), (*c).y(), (*c).z()));
        if (first.empty()) first = values;
        EXPECT_EQ(values, first) << inactive;
        EXPECT_EQ(*std::ranges::max_element(values), 0.5f) << inactive;
    }
}

// A field that is linear in space survives trilinear resampling: rotated, and with voxels that are no cubes.
TEST(VdbRead, SkewedVoxelsAreResampled) {
    const TemporaryFolder folder;
    for (bool rotated : {true, false}) {
        auto transform = openvdb::math::Transform::createLinearTransform(1.0);
        if (rotated) {
            transform->preRotate(0.5, openvdb::math::Z_AXIS);
        } else {
            transform->preScale(openvdb::Vec3d(1, 2, 3));
        }
        auto grid = FloatGrid::create(0.0f);
        grid->setName("density");
        grid->setTransform(transform);
        const auto field = [](const openvdb::Vec3d& w) {
            return 2.0 + 0.01 * w.x() + 0.02 * w.y() - 0.01 * w.z();
        };
        auto voxels = grid->getAccessor();
        for (auto c = CoordBBox(Coord(-10, 3, 0), Coord(25, 33, 20)).begin(); c; ++c) {
            voxels.setValue(*c, float(field(grid->indexToWorld(*c))));
        }
        write_with_openvdb(folder / "skewed.vdb", {grid});
        const LoadedDensity loaded = load_density(folder / "skewed.vdb");
        EXPECT_EQ(loaded.notes.size(), 1u);
        const Placement p = loaded.density.placement();
        EXPECT_NEAR(p.cell_size_m, 1.0, 1e-9);
        int checked = 0;
        for (auto c = CoordBBox(Coord(-9, 4, 1), Coord(24, 32, 19)).begin(); c; ++c) {
            // The voxel whose centre is nearest; compare at that centre when it lies inside the old voxels.
            const openvdb::Vec3d w = grid->indexToWorld(*c);
            const int i = int(std::floor(w.x() - p.origin_m.x)), j = int(std::floor(w.y() - p.origin_m.y));
            const int k = int(std::floor(w.z() - p.origin_m.z));
            const openvdb::Vec3d centre(p.origin_m.x + i + 0.5, p.origin_m.y + j + 0.5,
                                        p.origin_m.z + k + 0.5);
            ASSERT_NEAR(loaded.density.value(i, j, k), field(centre), 1e-4);
            ++checked;
        }
        EXPECT_GT(checked, 10000);
    }
}

}  // namespace
}  // namespace nephos
