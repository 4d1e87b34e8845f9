// SPDX-License-Identifier: Apache-2.0
// Lines over a picture: where they fall, how wide they are, what is left of those behind the eye.

#include "render/image/overlay.h"

#include <cmath>

#include <gtest/gtest.h>

#include "render/options/camera.h"

namespace nephos {
namespace {

Camera camera() {
    Camera camera;
    camera.position_m = {0, 0, 0};
    camera.target_m = {0, 100, 0};
    camera.width = 80;
    camera.height = 60;
    return camera;
}

Picture black(const Camera& camera) {
    Picture picture;
    picture.width = camera.width;
    picture.height = camera.height;
    picture.beauty.assign(3 * picture.pixels(), 0.0f);
    return picture;
}

double red(const Picture& picture, int x, int y) {
    return double(picture.beauty[3 * (std::size_t(y) * std::size_t(picture.width) + std::size_t(x))]);
}

double sum_of_red(const Picture& picture) {
    double sum = 0;
    for (std::size_t i = 0; i < picture.pixels(); ++i) sum += double(picture.beauty[3 * i]);
    return sum;
}

// In any direction a line covers its length times its width, around where its points are projected to.
TEST(LineOverlay, CoversItsLengthTimesItsWidth) {
    const Camera at = camera();
    const CameraFrame frame = camera_frame(at);
    for (int degrees = 0; degrees < 180; degrees += 15) {
        const double c = std::cos(degrees * 0.0174532925), s = std::sin(degrees * 0.0174532925);
        const Vec3 from{-20 * c, 100, -20 * s}, to{20 * c, 100, 20 * s};
        const PixelPosition a = project(frame, at, from), b = project(frame, at, to);
        const double length = std::hypot(a.x - b.x, a.y - b.y);
        for (const double width : {1.0, 2.5}) {
            Picture picture = black(at);
            const WorldLine line{from, to, {1, 0.5, 0}, width};
            draw_lines(picture, at, {&line, 1});
            EXPECT_NEAR(sum_of_red(picture) / (length * width), 1.0, 0.2)
                << degrees << " degrees, width " << width;
            EXPECT_GT(
                red(picture, 39, 29) + red(picture, 40, 30) + red(picture, 39, 30) + red(picture, 40, 29),
                0.9)
                << degrees;
        }
    }
}

TEST(LineOverlay, DrawsWhatIsBeforeTheEyeOnly) {
    const Camera at = camera();
    Picture picture = black(at);
    const WorldLine behind{{-10, -50, 0}, {10, -5, 3}}, beside{{500, 100, 0}, {500, 200, 40}};
    draw_lines(picture, at, std::vector<WorldLine>{behind, beside});
    EXPECT_EQ(sum_of_red(picture), 0);
    const WorldLine through{{0, -1000, -100},
                            {0, 1000, -100}};  // from below the eye to the middle of the picture
    draw_lines(picture, at, {&through, 1});
    EXPECT_GT(red(picture, 39, 45) + red(picture, 40, 45), 0.9);
    EXPECT_GT(red(picture, 39, 59) + red(picture, 40, 59), 0.9);
    EXPECT_EQ(red(picture, 39, 20) + red(picture, 40, 20), 0);
}

TEST(LineOverlay, ShowsItsColourWhateverTheExposure) {
    Camera at = camera();
    at.exposure_ev = 3;
    Picture picture = black(at);
    const WorldLine line{{-20, 100, 0}, {20, 100, 0}, {0.8, 0.4, 0.2}, 4};
    draw_lines(picture, at, {&line, 1});
    EXPECT_NEAR(red(picture, 40, 30) * 8, 0.8, 1e-6);
}

}  // namespace
}  // namespace nephos
