// SPDX-License-Identifier: Apache-2.0
#pragma once

// A fog volume that is not of nephos, and what the tests that read one expect of it.

#include <cstdint>
#include <filesystem>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include "core/error.h"
#include "density/density_grid.h"
#include "density/vdb/vdb_file.h"

namespace nephos::test {

// A fog volume as another program may make it: at an odd place, with tiles large and small, values above 1.
inline openvdb::FloatGrid::Ptr foreign_fog() {
    auto grid = openvdb::FloatGrid::create(0.0f);
    grid->setName("density");
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(2.5));
    auto voxels = grid->getAccessor();
    std::mt19937 random(4);
    for (int n = 0; n < 3000; ++n) {
        const openvdb::Coord c(int(random() % 50) - 13, int(random() % 41) - 29, int(random() % 23) + 5);
        voxels.setValue(c, float(random() % 1000 + 1) / 500.0f);
    }
    grid->tree().addTile(1, openvdb::Coord(-8, -16, 16), 0.75f, true);
    grid->tree().addTile(1, openvdb::Coord(40, 8, 8), 1.0f, true);
    return grid;
}

// Every voxel of `loaded` against the file's grid: (i, j, k) there is index(i, j, k) here.
template <class Map>
void expect_same_voxels(const openvdb::FloatGrid& grid, const DensityGrid& loaded, const Map& index) {
    std::uint64_t active = 0;
    for (auto value = grid.cbeginValueOn(); value; ++value) {
        for (auto c = value.getBoundingBox().begin(); c; ++c) {
            const openvdb::Coord at = index(*c);
            ASSERT_EQ(loaded.value(at.x(), at.y(), at.z()), *value) << *c;
            active += *value > 0;
        }
    }
    EXPECT_EQ(loaded.active_voxels(), active);
}

// Returns the message that reading a file ends with, which names the file; "" where it is read.
inline std::string error_of(const std::filesystem::path& path, const VdbReadOptions& options = {}) {
    try {
        load_density(path, options);
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos)
            << error.what();
        return error.what();
    }
    return "";
}

}  // namespace nephos::test
