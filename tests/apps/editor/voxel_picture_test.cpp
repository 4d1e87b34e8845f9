// SPDX-License-Identifier: Apache-2.0
// Cubes of cells by rays through the lattice, against a march in small steps.

#include "apps/editor/voxel_picture.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "automaton/lattice.h"
#include "render/options/camera.h"

namespace nephos {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

struct TestCells {
    explicit TestCells(unsigned seed) {
        std::mt19937 random(seed);
        for (BitPlane* plane : {&hum, &act, &cld}) {
            for (int k = 0; k < extent.z; ++k)
                for (int j = 0; j < extent.y; ++j)
                    for (int i = 0; i < extent.x; ++i)
                        if (random() % 30 == 0) plane->row(j, k)[i / 64] |= std::uint64_t{1} << (i % 64);
        }
    }
    CellLattice lattice() const { return {hum.view(), act.view(), cld.view(), placement}; }
    bool is_there(const Vec3& at_m, const VoxelStyle& style) const {
        const Vec3 at = (1 / placement.cell_size_m) * (at_m - placement.origin_m);
        const int i = int(std::floor(at.x)), j = int(std::floor(at.y)), k = int(std::floor(at.z));
        if (i < 0 || j < 0 || k < 0 || i >= extent.x || j >= extent.y || k >= extent.z) return false;
        if (k < style.slab_low * extent.z || k >= style.slab_high * extent.z) return false;
        return (style.cld && cld.get(i, j, k)) || (style.act && act.get(i, j, k)) || (style.hum && hum.get(i, j, k));
    }
    Extent extent{13, 11, 8};
    Placement placement{{-300, 200, 900}, 50};
    BitPlane hum{extent}, act{extent}, cld{extent};
};

// Distance to the first such cell in steps of a five-hundredth of a cell.
double marched(const TestCells& cells, const VoxelStyle& style, const Vec3& from, const Vec3& way) {
    for (double t = 0; t < 4000; t += 0.1) {
        if (cells.is_there(from + t * way, style)) return t;
    }
    return kFar;
}

TEST(VoxelPicture, ShowsTheFirstCellOfEachRay) {
    const unsigned seed = 6;
    const TestCells cells(seed);
    const CellLattice lattice = cells.lattice();
    Camera camera;
    camera.width = 20;
    camera.height = 15;
    camera.vertical_fov_deg = 40;
    int hits = 0, differences = 0;
    const Vec3 places[] = {{0, -900, 1100}, {20, 450, 1090} /* within */, {900, 1500, 1700}, {25, 475, 100}};
    for (const Vec3& place : places) {
        for (const VoxelStyle& style :
             {VoxelStyle{}, VoxelStyle{.hum = false, .act = false}, VoxelStyle{.slab_low = 0.25, .slab_high = 0.5}}) {
            camera.position_m = place;
            camera.target_m = {30, 480, 1105};
            Picture picture;
            picture.width = camera.width;
            picture.height = camera.height;
            picture.beauty.assign(3 * picture.pixels(), 0.5f);
            picture.transmittance.assign(picture.pixels(), 1.0f);
            picture.depth_m.assign(picture.pixels(), std::numeric_limits<float>::infinity());
            draw_voxels(picture, camera, {&lattice, 1}, style);
            const CameraFrame axes = camera_frame(camera);
            for (int y = 0; y < camera.height; ++y) {
                for (int x = 0; x < camera.width; ++x) {
                    const double naive = marched(cells, style, place, pixel_ray(axes, camera, x + 0.5, y + 0.5));
                    const auto drawn = double(picture.depth_m[std::size_t(y * camera.width + x)]);
                    hits += naive < kFar ? 1 : 0;
                    // A ray may cut a corner between two steps of the march.
                    if (!(std::abs(naive - drawn) < 0.2) && naive != drawn) ++differences;
                    const float seen = picture.transmittance[std::size_t(y * camera.width + x)];
                    EXPECT_EQ(seen, drawn < kFar ? 0.0f : 1.0f);
                }
            }
        }
    }
    EXPECT_GT(hits, 500);
    EXPECT_LE(differences, hits / 100) << "seed " << seed;
}

// What was drawn before hides cells behind it.
TEST(VoxelPicture, NearerThingsHideCells) {
    const TestCells cells(7);
    const CellLattice lattice = cells.lattice();
    Camera camera;
    camera.width = camera.height = 9;
    camera.position_m = {30, -900, 1105};
    camera.target_m = {30, 480, 1105};
    Picture picture;
    picture.width = picture.height = 9;
    picture.beauty.assign(3 * picture.pixels(), 0.5f);
    picture.transmittance.assign(picture.pixels(), 1.0f);
    picture.depth_m.assign(picture.pixels(), 100.0f);
    draw_voxels(picture, camera, {&lattice, 1}, {});
    for (const float value : picture.beauty) EXPECT_EQ(value, 0.5f);
}

}  // namespace
}  // namespace nephos
