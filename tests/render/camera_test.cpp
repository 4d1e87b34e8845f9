// SPDX-License-Identifier: Apache-2.0
// Geometry: which way is east, where the horizon lies, where a point falls; options out of range.

#include "render/options/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/vec.h"
#include "render/cloud/cloud_preparation.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

Camera looking(Vec3 from, Vec3 to) {
    Camera camera;
    camera.position_m = from;
    camera.target_m = to;
    return camera;
}

void expect_near(const Vec3& a, const Vec3& b, double tolerance) {
    EXPECT_NEAR(a.x, b.x, tolerance);
    EXPECT_NEAR(a.y, b.y, tolerance);
    EXPECT_NEAR(a.z, b.z, tolerance);
}

TEST(Camera, LookingNorthEastIsRight) {
    const CameraFrame frame = camera_frame(looking({0, 0, 100}, {0, 1000, 100}));
    expect_near(frame.forward, {0, 1, 0}, 1e-12);
    expect_near(frame.right, {1, 0, 0}, 1e-12);
    expect_near(frame.up, {0, 0, 1}, 1e-12);
}

TEST(Camera, LookingStraightUpAndDownNorthIsUp) {
    const CameraFrame down = camera_frame(looking({5, 6, 100}, {5, 6, 0}));
    expect_near(down.up, {0, 1, 0}, 1e-12);
    expect_near(down.right, {1, 0, 0}, 1e-12);
    const CameraFrame up = camera_frame(looking({5, 6, 0}, {5, 6, 100}));
    expect_near(up.up, {0, 1, 0}, 1e-12);
    expect_near(up.right, {-1, 0, 0}, 1e-12);  // as when one lies on the back, head to the north
}

// Brute force: a sphere that holds one of many points of the view is visible; one that a plane has wholly
// outside is not; and most of those that are visible are needed.
TEST(Frustum, HoldsWhatIsInView) {
    Camera camera = looking({10, -20, 5}, {110, 180, 35});
    camera.vertical_fov_deg = 50;
    const CameraFrame view = camera_frame(camera);
    const Frustum frustum(view);
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> u(-1, 1), unit(0, 1);
    std::vector<Vec3> samples;  // offsets from the eye
    for (int i = 0; i < 20000; ++i) {
        const Vec3 ray =
            view.forward + u(random) * view.half_width * view.right + u(random) * view.half_height * view.up;
        samples.push_back(700 * std::cbrt(unit(random)) * ray);
        EXPECT_TRUE(frustum.may_see(samples.back(), 1e-9));
    }
    std::size_t visible = 0, kept = 0;
    for (int i = 0; i < 1500; ++i) {
        const Vec3 offset = 500.0 * Vec3{u(random), u(random), u(random)};
        const double radius = 5 + 60 * unit(random);
        const bool may_see = frustum.may_see(offset, radius);
        const bool touches =
            std::ranges::any_of(samples, [&](const Vec3& p) { return glm::length(p - offset) < radius; });
        EXPECT_TRUE(may_see || !touches) << i;
        visible += touches;
        kept += may_see;
    }
    EXPECT_GT(visible, 50u);
    EXPECT_LT(kept, 1.5 * double(visible));
    const Vec3 ahead = 100.0 * view.forward, aside = 120 * view.half_width * view.right;
    EXPECT_FALSE(frustum.may_see(-ahead, 50));
    EXPECT_FALSE(frustum.may_see(ahead + aside, 5));
    EXPECT_FALSE(frustum.may_see(ahead - aside, 5));
}

// A point that is half the picture's height above the axis falls on the upper edge; one to the east on the
// right.
TEST(Camera, ProjectsKnownPoints) {
    Camera camera = looking({0, 0, 0}, {0, 1000, 0});
    camera.vertical_fov_deg = 90;
    camera.width = 400;
    camera.height = 200;
    const CameraFrame frame = camera_frame(camera);
    const PixelPosition centre = project(frame, camera, {0, 500, 0});
    EXPECT_NEAR(centre.x, 200, 1e-9);
    EXPECT_NEAR(centre.y, 100, 1e-9);
    const PixelPosition top = project(frame, camera, {0, 500, 500});
    EXPECT_NEAR(top.y, 0, 1e-9);
    const PixelPosition east = project(frame, camera, {250, 500, 0});
    EXPECT_NEAR(east.x, 250, 1e-9);
    EXPECT_TRUE(east.in_front);
    EXPECT_FALSE(project(frame, camera, {0, -500, 0}).in_front);
}

TEST(Camera, RayAndProjectionAreInverse) {
    Camera camera = looking({-300, 200, 50}, {1000, 900, 700});
    camera.width = 123;
    camera.height = 77;
    const CameraFrame frame = camera_frame(camera);
    for (const double x : {0.5, 40.0, 122.5}) {
        for (const double y : {0.5, 33.0, 76.5}) {
            const Vec3 ray = pixel_ray(frame, camera, x, y);
            const PixelPosition back = project(frame, camera, camera.position_m + 1234.0 * ray);
            EXPECT_NEAR(back.x, x, 1e-9);
            EXPECT_NEAR(back.y, y, 1e-9);
        }
    }
    const Vec3 naive = reference::pixel_ray(camera, 17, 5).direction;
    expect_near(pixel_ray(frame, camera, 17.5, 5.5), naive, 1e-12);
}

// The target lies on the negative z axis of the camera.
TEST(Camera, WorldToCameraLooksAlongMinusZ) {
    const Camera camera = looking({100, -50, 30}, {400, 350, 30});
    const glm::vec4 result = world_to_camera(camera_frame(camera)) * glm::vec4(400, 350, 30, 1);
    EXPECT_NEAR(result[0], 0, 1e-3);
    EXPECT_NEAR(result[1], 0, 1e-3);
    EXPECT_NEAR(result[2], -500, 1e-3);
    EXPECT_NEAR(result[3], 1, 1e-6);
}

TEST(Camera, TargetAtThePositionIsAnError) {
    EXPECT_THROW(camera_frame(looking({1, 2, 3}, {1, 2, 3})), Error);
}

TEST(Sun, AzimuthIsClockwiseFromNorth) {
    Sun sun;
    sun.elevation_deg = 0;
    sun.azimuth_deg = 90;
    expect_near(direction_to_sun(sun), {1, 0, 0}, 1e-12);
    sun.azimuth_deg = 180;
    expect_near(direction_to_sun(sun), {0, -1, 0}, 1e-12);
    sun.elevation_deg = 90;
    expect_near(direction_to_sun(sun), {0, 0, 1}, 1e-12);
}

// Every option out of its range, and NaN, is an error that names the option.
TEST(RenderOptions, BadValuesAreNamed) {
    const auto message = [](auto change) {
        RenderOptions options;
        change(options);
        try {
            check(options);
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::usage);
            return std::string(error.what());
        }
        return std::string("no error");
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const auto names = [](const std::string& text, const char* what) {
        return text.find(what) != std::string::npos;
    };
    EXPECT_TRUE(names(message([](RenderOptions& o) { o.camera.width = 0; }), "camera.width"));
    EXPECT_TRUE(names(message([](RenderOptions& o) { o.camera.height = 16385; }), "camera.height"));
    EXPECT_TRUE(
        names(message([&](RenderOptions& o) { o.camera.vertical_fov_deg = nan; }), "vertical_fov_deg"));
    EXPECT_TRUE(names(message([&](RenderOptions& o) { o.camera.position_m.x = nan; }), "position_m"));
    EXPECT_TRUE(
        names(message([](RenderOptions& o) { o.camera.target_m = o.camera.position_m; }), "target_m"));
    EXPECT_TRUE(names(message([](RenderOptions& o) { o.sun.elevation_deg = -19; }), "elevation_deg"));
    EXPECT_TRUE(names(message([](RenderOptions& o) { o.light.phase.g = 1; }), "light.g"));
    EXPECT_TRUE(names(message([](RenderOptions& o) { o.light.albedo = 1.5; }), "light.albedo"));
    EXPECT_TRUE(names(message([](RenderOptions& o) { o.air.horizon[1] = -1; }), "air.horizon"));
    EXPECT_TRUE(names(message([](RenderOptions& o) { o.ground.albedo[2] = 2; }), "ground.albedo"));
    EXPECT_TRUE(names(message([](RenderOptions& o) { o.shadow_map_size = 8; }), "shadow_map_size"));
    EXPECT_EQ(message([](RenderOptions&) {}), "no error");
}

// A camera on a path goes through its keys with a continuous velocity, and stands still outside of them.
TEST(CameraPath, GoesSmoothlyThroughItsKeys) {
    Camera camera;
    camera.path = {
        {10, {0, 0, 0}, {0, 100, 0}}, {12, {10, 0, 0}, {10, 100, 0}}, {20, {10, 80, 5}, {50, 100, 0}}};
    for (const CameraKey& key : camera.path) {
        const Camera at = camera_at(camera, key.time_s);
        EXPECT_NEAR(length(at.position_m - key.position_m), 0, 1e-9);
        EXPECT_NEAR(length(at.target_m - key.target_m), 0, 1e-9);
        EXPECT_TRUE(at.path.empty());
    }
    EXPECT_EQ(camera_at(camera, 0).position_m, camera.path.front().position_m);
    EXPECT_EQ(camera_at(camera, 1e6).position_m, camera.path.back().position_m);
    Vec3 before{};
    for (double t = 9; t < 21; t += 0.01) {
        EXPECT_GE(camera_at(camera, t).position_m.z, 0);  // no swing below two keys on the ground
        const Vec3 speed = 100.0 * (camera_at(camera, t + 0.01).position_m - camera_at(camera, t).position_m);
        EXPECT_LT(length(speed - before), 0.5) << t;
        before = speed;
    }
    camera.path[1].time_s = 10;
    RenderOptions options;
    options.camera = camera;
    EXPECT_THROW(check(options), Error);
}

}  // namespace
}  // namespace nephos
