// SPDX-License-Identifier: Apache-2.0
// What the camera does to a picture: automatic exposure, glare, tone curves.

#include "render/image/exposure.h"

#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <numeric>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/image/glare.h"
#include "render/image/image_file.h"
#include "render/image/tone_map.h"
#include "tests/reference/with_threads.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

Picture grey(int width, int height, float value) {
    Picture picture;
    picture.width = width;
    picture.height = height;
    picture.beauty.assign(3 * picture.pixels(), value);
    return picture;
}

// A picture twice as bright gets four fifths of a stop less; what is not measured does not count.
TEST(Exposure, FollowsTheMeanLuminance) {
    EXPECT_NEAR(metered_ev(grey(40, 30, 0.42f)), 0, 0.02);
    for (const float value : {1e-3f, 0.02f, 0.5f, 4.0f})
        EXPECT_NEAR(metered_ev(grey(40, 30, value)), 0.8 * std::log2(0.42 / double(value)), 0.02) << value;
    EXPECT_EQ(metered_ev(grey(40, 30, 0)), 0);
    Picture with_sun = grey(40, 30, 0.1f);
    for (std::size_t i = 0; i < 60; ++i) with_sun.beauty[i] = 5e4f;  // 20 of 1200 pixels
    EXPECT_NEAR(metered_ev(with_sun), metered_ev(grey(40, 30, 0.1f)), 1e-9);
    Camera camera;
    camera.exposure_ev = 0.5;
    EXPECT_EQ(exposure_ev(with_sun, camera), 0.5);
    camera.exposure = Exposure::automatic;
    EXPECT_EQ(exposure_ev(with_sun, camera), 0.5 + metered_ev(with_sun));
}

TEST(Exposure, AdaptsWithItsTimeConstant) {
    EXPECT_EQ(adapted_ev(3, 1, 0.04, 0), 1);
    EXPECT_NEAR(adapted_ev(3, 1, 2, 2), 1 + 2 / std::exp(1.0), 1e-12);
    double stepwise = 3;
    for (int i = 0; i < 25; ++i) stepwise = adapted_ev(stepwise, 1, 0.04, 2);
    EXPECT_NEAR(stepwise, adapted_ev(3, 1, 1, 2), 1e-12);
}

// The PNG says which exposure it has, and gives it back with all its digits.
TEST(Exposure, IsInThePngFile) {
    const TemporaryFolder folder;
    RenderOptions options;
    options.camera.exposure = Exposure::automatic;
    options.camera.exposure_ev = 0.3;
    const Picture picture = grey(30, 20, 0.07f);
    const auto file = folder.path() / "a.png";
    write_png(file, picture, options, {});
    EXPECT_EQ(read_png_exposure(file), 0.3 + metered_ev(picture));
    EXPECT_EQ(read_png(file).rgb, to_srgb8(picture, 0.3 + metered_ev(picture)));
    EXPECT_THROW(read_png_exposure(folder.path() / "none.png"), Error);
}

// A run that goes on takes it over: one digit that is damaged would make all of its pictures darker or brighter.
TEST(Exposure, OfADamagedFileIsAnError) {
    const TemporaryFolder folder;
    RenderOptions options;
    options.camera.exposure_ev = -0.294;
    const auto file = folder.path() / "a.png";
    write_png(file, grey(30, 20, 0.07f), options, {});
    std::ifstream stream(file, std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
    const std::size_t pixels = whole.find("IDAT");
    ASSERT_NE(pixels, whole.npos);
    ASSERT_EQ(read_png_exposure(file), -0.294);
    for (std::size_t n = 0; n + 4 < pixels; ++n) {
        std::string damaged = whole;
        damaged[n] = char(damaged[n] ^ 4);
        std::ofstream(file, std::ios::binary) << damaged;
        EXPECT_THROW(read_png_exposure(file), Error) << n;
    }
}

TEST(Exposure, IsAFiniteNumber) {
    const TemporaryFolder folder;
    RenderOptions options;
    for (const double exposure : {std::numeric_limits<double>::infinity(), std::nan("")}) {
        options.camera.exposure_ev = exposure;
        write_png(folder.path() / "a.png", grey(30, 20, 0.07f), options, {});
        EXPECT_THROW(read_png_exposure(folder.path() / "a.png"), Error);
    }
}

// Ratios of channels are kept below the shoulder and in the scaled colour; brighter is never darker; white is
// white.
TEST(ToneCurve, NeutralKeepsHue) {
    const std::array<float, 3> plain = neutral_tone({0.5f, 0.2f, 0.6f});
    EXPECT_EQ(plain, (std::array<float, 3>{0.5f, 0.2f, 0.6f}));
    float before = 0;
    for (float gain = 0.1f; gain < 1e6f; gain *= 1.1f) {
        const std::array<float, 3> colour = neutral_tone({gain, 0.5f * gain, 0.2f * gain});
        for (const float channel : colour) EXPECT_TRUE(channel >= 0 && channel <= 1) << gain;
        EXPECT_GE(colour[0] + colour[1] + colour[2], before);
        before = colour[0] + colour[1] + colour[2];
        // Hue: where the middle channel lies between the others.
        if (gain < 1e3f) {
            EXPECT_NEAR((colour[1] - colour[2]) / (colour[0] - colour[2]), 0.3 / 0.8, 2e-3) << gain;
        }
    }
    EXPECT_GT(before, 2.99f);
    EXPECT_EQ(neutral_tone({-1, NAN, 0}), (std::array<float, 3>{0, 0, 0}));
    const std::array<float, 3> endless = neutral_tone({INFINITY, INFINITY, INFINITY});
    for (const float channel : endless) EXPECT_NEAR(channel, 1, 1e-6);
}

// The point spread of one bright pixel is Spencer's from 1 to 8 degrees, at any size of the picture, and light
// is neither lost nor made.
TEST(Glare, IsThatOfSpencer) {
    for (const int size : {240, 480, 481}) {
        Camera camera;
        camera.vertical_fov_deg = 40;
        camera.glare = 0.1;
        Picture picture = grey(size, size, 0.0f);
        const int middle = size / 2;
        const float bright = 1e6f;
        for (std::size_t c = 0; c < 3; ++c)
            picture.beauty[3 * std::size_t(middle * size + middle) + c] = bright;
        const std::vector<float> beauty = with_glare(picture, camera);
        const double sum = std::accumulate(beauty.begin(), beauty.end(), 0.0) / 3;
        EXPECT_LT(sum, 1.0001 * double(bright));
        EXPECT_GT(sum, 0.98 * double(bright));  // some falls beside the picture
        const double per_pixel = 2 * std::tan(20 * M_PI / 180) / size;  // radians
        for (const double degrees : {1.0, 2.0, 4.0, 8.0}) {
            const double expected = 0.1 * double(bright) * per_pixel * per_pixel *
                                    (0.478 * 20.91 / std::pow(degrees, 3) + 0.138 * 72.37 / (degrees * degrees));
            double mean = 0;  // around the circle
            for (int k = 0; k < 64; ++k) {
                const double angle = 2 * M_PI * k / 64, radius = degrees * M_PI / 180 / per_pixel;
                const auto x = std::size_t(std::lround(middle + radius * std::cos(angle))),
                           y = std::size_t(std::lround(middle + radius * std::sin(angle)));
                mean += double(beauty[3 * (y * std::size_t(size) + x)]) / 64;
            }
            EXPECT_NEAR(mean / expected, 1, 0.2) << degrees << " degrees, " << size << " pixels";
        }
    }
}

TEST(Glare, LeavesAnEvenPictureEvenAndDoesNotDependOnThreads) {
    Camera camera;
    camera.glare = 1;
    const Picture picture = grey(97, 61, 0.4f);
    for (const float value : with_glare(picture, camera)) ASSERT_NEAR(value, 0.4f, 1e-5f);
    Picture noisy = picture;
    std::mt19937 engine(1);
    for (float& value : noisy.beauty) value = float(engine()) / 4294967296.0f;
    const auto glared = [&] { return with_glare(noisy, camera); };
    EXPECT_EQ(test::with_threads(1, glared), test::with_threads(4, glared));
    camera.glare = 0;
    EXPECT_EQ(with_glare(noisy, camera), noisy.beauty);
}

}  // namespace
}  // namespace nephos
