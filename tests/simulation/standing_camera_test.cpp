// SPDX-License-Identifier: Apache-2.0
// A camera whose heights are counted from the ground: where pictures are drawn from, what their files say of it, and what
// `nephos render` makes of it beside points of its own.

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "render/image/image_file.h"
#include "render/terrain/terrain.h"
#include "simulation/frame_painter.h"
#include "simulation/frame_writer.h"
#include "simulation/volume_picture.h"
#include "tests/simulation/small_run.h"

namespace nephos {
namespace {

constexpr DeviceOptions kProcessor{.splatting = Splatting::cpu};

class StandingCameras : public test::SmallRun {
  protected:
    // Hills on a plane at 100 m.
    static Scene hilly_scene() {
        Scene scene = small_scene(2);
        RenderOptions& r = scene.render;
        r.camera.width = 32;
        r.camera.height = 24;
        r.camera.above_ground = true;
        r.ground.height_m = 100;
        r.terrain.relief = Relief::ridges;
        r.terrain.cells = 32;
        r.terrain.width_m = r.terrain.length_m = 6000;
        r.terrain.feature_m = 2000;
        r.terrain.height_scale_m = 900;
        r.terrain.offset_m = 100;
        return scene;
    }
    static double ground_below(const Scene& scene, const Vec3& point) {
        const auto map = make_terrain(scene.render.terrain, scene.render.ground);
        return ground_height_at(map.get(), scene.render.ground, point.x, point.y);
    }
    static std::string world_to_camera(const std::filesystem::path& file) {
        const ExrInfo info = read_exr_info(file);
        for (const auto& [name, value] : info.parts.at(0).attributes)
            if (name == "worldToCamera") return value;
        return "absent";
    }
};

TEST_F(StandingCameras, StandOnTheGroundInEachFrame) {
    Scene scene = hilly_scene();
    scene.render.camera.path = {{0, {-3500, 0, 4}, {0, 0, 60}}, {100, {3500, 300, 4}, {3600, 0, 60}}};
    FramePainter painter(scene, kProcessor);
    double highest = 0;
    for (double t = 0; t <= 100; t += 4) {
        const Camera camera = painter.camera(t);
        EXPECT_FALSE(camera.above_ground);
        const double ground = ground_below(scene, camera.position_m);
        EXPECT_NEAR(camera.position_m.z - ground, 4, 1e-9) << t;
        highest = std::max(highest, ground);
        FrameResult frame;
        frame.time_s = t;
        EXPECT_NO_THROW(painter.draw(frame)) << t;
    }
    EXPECT_GT(highest, 300);  // hills between two keys on the plane
}

TEST_F(StandingCameras, AreThoseOfTheFilesOfTheirPictures) {
    Scene scene = hilly_scene();
    scene.frames.exr = true;
    scene.render.camera.position_m = {0, -1000, 30};
    scene.render.camera.target_m = {0, 0, 90};
    FramePainter painter(scene, kProcessor);
    FrameResult frame;
    frame.number = 1;
    const Picture picture = painter.draw(frame);
    std::filesystem::create_directories(base_ / "frames");
    const RunFolder folder{base_, scene.name};
    FrameWriter(scene, folder).write_picture(frame, picture, painter);
    RenderOptions known = scene.render;
    write_exr(base_ / "unresolved.exr", picture, known, {});
    for (Vec3* point : {&known.camera.position_m, &known.camera.target_m})
        point->z += ground_below(scene, *point);
    write_exr(base_ / "known.exr", picture, known, {});
    EXPECT_EQ(world_to_camera(folder.picture(1, ".exr")), world_to_camera(base_ / "known.exr"));
    EXPECT_NE(world_to_camera(base_ / "unresolved.exr"), world_to_camera(base_ / "known.exr"));
}

TEST_F(StandingCameras, StandBesidePointsThatAreOfTheWorld) {
    Scene scene = hilly_scene();
    scene.render.camera.position_m = {0, -1000, 30};
    scene.render.camera.target_m = {0, 0, 90};
    const double eye_m = 30 + ground_below(scene, scene.render.camera.position_m),
                 target_m = 90 + ground_below(scene, scene.render.camera.target_m);
    LoadedDensity loaded;
    loaded.density = DensityGrid::from_dense(std::vector<float>(8, 0.5f), {2, 2, 2}, {{0, 0, 1500}, 100});
    const auto drawn = [&](const VolumePictureOptions& options) {
        return draw_volume("cloud.vdb", loaded, scene, options, kProcessor).options.camera;
    };
    const Camera own = drawn({});
    EXPECT_NEAR(own.position_m.z, eye_m, 1e-9);
    EXPECT_NEAR(own.target_m.z, target_m, 1e-9);
    VolumePictureOptions target, eye;
    target.target_m = Vec3{0, 0, 1600};
    EXPECT_NEAR(drawn(target).position_m.z, eye_m, 1e-9);
    EXPECT_EQ(drawn(target).target_m, *target.target_m);
    eye.camera_m = Vec3{0, -9000, 1600};
    EXPECT_EQ(drawn(eye).position_m, *eye.camera_m);
    EXPECT_NEAR(drawn(eye).target_m.z, target_m, 1e-9);
    EXPECT_FALSE(drawn(eye).above_ground);
}

}  // namespace
}  // namespace nephos
