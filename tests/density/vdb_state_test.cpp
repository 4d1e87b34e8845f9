// SPDX-License-Identifier: Apache-2.0
// States in OpenVDB files: those of nephos and of others, and what of them is refused.

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "density/vdb/vdb_file.h"
#include "tests/density/naive_smoothing.h"
#include "tests/density/vdb_test_files.h"

namespace nephos {
namespace {

using openvdb::Coord;
using test::TemporaryFolder;
using test::write_with_openvdb;

TEST(VdbState, OfOthersAndWhatIsMissing) {
    const TemporaryFolder folder;
    const Extent extent{12, 10, 9};
    const auto bool_grid = [](const char* name, const Coord& c) {
        auto grid = openvdb::BoolGrid::create(false);
        grid->setName(name);
        grid->tree().setValue(c, true);
        return grid;
    };
    auto hum = bool_grid("hum", {11, 9, 8}), act = bool_grid("act", {0, 0, 0});
    hum->tree().addTile(1, Coord(0), true, true);
    act->tree().setValue(Coord(1, 1, 1), false);  // active, but false
    auto cld = openvdb::MaskGrid::create();
    cld->setName("cld");
    cld->tree().setValueOn(Coord(3, 4, 5));
    write_with_openvdb(folder / "state.vdb", {hum, act, cld});
    const Lattice state = read_state(folder / "state.vdb", extent, {});
    EXPECT_EQ(state.hum.count(), 513u);
    EXPECT_TRUE(state.hum.get(11, 9, 8) && state.hum.get(7, 7, 7) && !state.hum.get(8, 7, 7));
    EXPECT_EQ(state.act.count(), 1u);
    EXPECT_TRUE(state.act.get(0, 0, 0));
    EXPECT_EQ(state.cld.count(), 1u);
    EXPECT_TRUE(state.cld.get(3, 4, 5));
    const auto message = [&](Extent e) {
        try {
            read_state(folder / "state.vdb", e, {});
        } catch (const Error& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_NE(message({11, 10, 9}).find("outside"), std::string::npos);
    write_with_openvdb(folder / "state.vdb", {hum, cld});
    EXPECT_NE(message(extent).find("`act`"), std::string::npos);
    act->tree().setValue(Coord(-1, 0, 0), true);
    write_with_openvdb(folder / "state.vdb", {hum, act, cld});
    EXPECT_NE(message(extent).find("outside"), std::string::npos);
    const auto fog = openvdb::FloatGrid::create(0.0f);
    fog->setName("act");
    fog->tree().setValue(Coord(1, 2, 3), 0.5f);
    write_with_openvdb(folder / "state.vdb", {hum, fog, cld});
    EXPECT_NE(message(extent).find("not bool"), std::string::npos);
}

// What is wrong with the place of a state; empty when nothing is.
std::string place_error(const std::filesystem::path& path, Extent extent, const Placement& placement) {
    try {
        read_state(path, extent, placement);
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos);
        return error.what();
    }
    return "";
}

// A state that stands elsewhere than the lattice is refused with both places; rounding is not, nor is a file
// of others that says nothing of a place.
TEST(VdbState, StandsWhereTheLatticeDoes) {
    const TemporaryFolder folder;
    const std::filesystem::path own = folder / "own.vdb", other = folder / "other.vdb";
    const Extent extent{33, 20, 11};
    const BitPlane plane = test::random_plane(extent, 0.1, 8);
    VdbContent content;
    content.hum = content.act = content.cld = plane.view();
    content.cells = {{-100, 200, 50}, 25};
    write_vdb(own, content, {});
    EXPECT_EQ(read_state(own, extent, content.cells).cld, plane);
    EXPECT_EQ(place_error(own, extent, {{-100.001, 200.001, 50}, 25.000001}), "");
    const std::string size = place_error(own, extent, {{-100, 200, 50}, 50});
    EXPECT_NE(size.find("grid `hum` has cells of 25 m, but the scene's lattice has cells of 50 m"),
              std::string::npos)
        << size;
    const std::string origin = place_error(own, extent, {{-100, 225, 50}, 25});
    EXPECT_NE(origin.find("starts at (-100, 200, 50) m, but the scene's lattice at (-100, 225, 50) m"),
              std::string::npos)
        << origin;

    const auto with = [&](const openvdb::math::Transform::Ptr& transform) {
        std::vector<openvdb::GridBase::Ptr> grids;
        for (const char* name : {"hum", "act", "cld"}) {
            const auto grid = openvdb::BoolGrid::create(false);
            grid->setName(name);
            grid->tree().setValue(Coord(3, 4, 5), true);
            if (transform) grid->setTransform(transform);
            grids.push_back(grid);
        }
        write_with_openvdb(other, {grids[0], grids[1], grids[2]});
    };
    using openvdb::math::Transform;
    const Placement placement{{10, 20, 30}, 5};
    with(nullptr);
    EXPECT_EQ(place_error(other, extent, placement), "") << "the identity stands nowhere";
    const auto placed = Transform::createLinearTransform(5.0);
    placed->postTranslate(openvdb::Vec3d(12.5, 22.5, 32.5));
    with(placed);
    EXPECT_EQ(place_error(other, extent, placement), "");
    const auto turned = Transform::createLinearTransform(5.0);
    turned->preRotate(0.1, openvdb::math::Z_AXIS);
    turned->postTranslate(openvdb::Vec3d(10, 20, 30) - turned->indexToWorld(openvdb::Vec3d(-0.5)));
    with(turned);
    const std::string axes = place_error(other, extent, placement);
    EXPECT_NE(axes.find("turned"), std::string::npos) << axes;
}

}  // namespace
}  // namespace nephos
