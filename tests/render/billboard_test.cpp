// SPDX-License-Identifier: Apache-2.0
// T's billboards: one against the formula, their order among each other and among metaballs, and what must
// not change a picture.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/frame/billboard_textures.h"
#include "render/frame/frame_data.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/random_billboards.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

class BillboardTest : public test::AllBackends {};

RenderOptions view(Vec3 from, Vec3 to, int width = 65, int height = 65, double fov = 40) {
    return test::view(from, to, fov, width, height, 64);
}

Vec3 minus(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec3 unit(const Vec3& a) {
    const double length = std::sqrt(dot(a, a));
    return {a.x / length, a.y / length, a.z / length};
}

// T's shading of one corner, from the text of the source.
Rgb diffuse(const Vec3& corner, const CloudBillboard& billboard, const BillboardCloud& cloud,
            const RenderOptions& options) {
    const Vec3 outwards = unit(minus(corner, cloud.centre_m));
    const double facing = dot(reference::to_sun(options.sun), outwards);
    const double height = std::clamp((corner.z - cloud.base_m) / (cloud.top_m - cloud.base_m), 0.0, 1.0);
    Rgb result{};
    for (std::size_t c = 0; c < 3; ++c) {
        const double ambient = options.light.ambient_base[c] +
                               height * (options.light.ambient_top[c] - options.light.ambient_base[c]);
        result[c] =
            std::clamp(facing * options.sun.colour[c] - double(billboard.sun_absorbed), 0.0, 1.0) + ambient;
    }
    return result;
}

// The finest level of a layer, mirrored and with exchanged axes as the variant says, at 0..1 from the left
// and from the top of the billboard: what a linear filter gives.
std::array<double, 2> texture(const BillboardLevel& level, int layer, double right, double down) {
    const double x = right * level.side - 0.5, y = down * level.side - 0.5;
    const auto texel = [&](int i, int j, std::size_t c) {
        if (i < 0 || j < 0 || i >= level.side || j >= level.side) return 0.0;
        return level.texels[2 * (std::size_t(layer) * std::size_t(level.side) * std::size_t(level.side) +
                                 std::size_t(j * level.side + i)) +
                            c] /
               255.0;
    };
    const int i = int(std::floor(x)), j = int(std::floor(y));
    const double u = x - i, v = y - j;
    std::array<double, 2> result{};
    for (std::size_t c = 0; c < 2; ++c)
        result[c] = (1 - v) * ((1 - u) * texel(i, j, c) + u * texel(i + 1, j, c)) +
                    v * ((1 - u) * texel(i, j + 1, c) + u * texel(i + 1, j + 1, c));
    return result;
}

// A billboard that fills the picture, each kind, seen level from the south: every pixel against the formula.
// The light is that of the corners, mixed over each of the two triangles.
TEST_P(BillboardTest, OneBillboardIsTexturedAndLitAsTheFormulaSays) {
    const std::vector<BillboardLevel>& levels = billboard_textures();
    for (const BillboardTexture kind :
         {BillboardTexture::soft, BillboardTexture::wispy, BillboardTexture::dense}) {
        RenderOptions options = view({0, -1000, 500}, {0, 0, 500}, 129, 129);
        options.sun = {35, 200, {1, 0.9, 0.8}};
        options.ground.height_m = -1e5;
        options.air.extinction_per_m = {2e-4, 3e-4, 4e-4};
        const BillboardCloud cloud{{20, 30, 430}, 300, 700};
        CloudBillboard billboard;
        billboard.centre_m = {0, 0, 500};
        billboard.width_m = 600;
        billboard.height_m = 500;
        billboard.sun_absorbed = 0.25f;
        billboard.opacity = 0.75f;
        billboard.texture = kind;
        billboard.variant = 2;
        Splats splats;
        splats.clouds = {&cloud, 1};
        const Picture empty = renderer_.draw_splats(splats, options);
        splats.billboards = {&billboard, 1};
        const Picture picture = renderer_.draw_splats(splats, options);

        Rgb corners[2][2];  // [top][right]
        for (int top = 0; top < 2; ++top)
            for (int right = 0; right < 2; ++right)
                corners[top][right] =
                    diffuse({right ? 300.0 : -300.0, 0, top ? 750.0 : 250.0}, billboard, cloud, options);
        const double pixel_m = 2 * 1000 * std::tan(20 * std::numbers::pi / 180) / 129;
        reference::DifferenceSum opacities, colours;
        for (int row = 0; row < 129; ++row) {
            for (int column = 0; column < 129; ++column) {
                const double right = (column - 64) * pixel_m / 600 + 0.5,
                             down = (row - 64) * pixel_m / 500 + 0.5;
                const std::size_t at = std::size_t(row) * 129 + std::size_t(column);
                const std::array<double, 2> texel =
                    right < 0 || right > 1 || down < 0 || down > 1
                        ? std::array<double, 2>{}
                        : texture(levels[0], int(kind) * kBillboardVariants + 2, right, down);
                opacities.add(double(picture.transmittance[at]), 1 - 0.75 * texel[0]);
                for (std::size_t c = 0; c < 3; ++c) {
                    // The triangles share the diagonal from the lower left to the upper right.
                    const double up = 1 - down;
                    const double light =
                        up < right ? corners[0][0][c] + right * (corners[0][1][c] - corners[0][0][c]) +
                                         up * (corners[1][1][c] - corners[0][1][c])
                                   : corners[0][0][c] + up * (corners[1][0][c] - corners[0][0][c]) +
                                         right * (corners[1][1][c] - corners[1][0][c]);
                    const double beta = std::exp(-options.air.extinction_per_m[c] * 1000);
                    const double expected =
                        double(empty.beauty[3 * at + c]) * (1 - 0.75 * texel[0]) +
                        0.75 * (beta * light * texel[1] + (1 - beta) * options.air.horizon[c] * texel[0]);
                    colours.add(double(picture.beauty[3 * at + c]), expected);
                }
            }
        }
        EXPECT_LT(opacities.result().max, 0.03) << int(kind);  // software filters with weights of 8 bits
        EXPECT_LT(opacities.result().mean, 0.001) << int(kind);
        EXPECT_LT(colours.result().max, 0.03) << int(kind);
        EXPECT_LT(colours.result().mean, 0.001) << int(kind);
    }
}

// Fully absorbed, only ambient light is left; lightning from the other side lights what the sun does not.
TEST_P(BillboardTest, LightningHasItsOwnAbsorptionAndFallsOffWithTheSquareOfTheDistance) {
    RenderOptions options = view({0, -1000, 500}, {0, 0, 500});
    options.air.extinction_per_m = {0, 0, 0};
    options.light.ambient_top = options.light.ambient_base = {0, 0, 0};
    options.sun.elevation_deg = -18;
    const BillboardCloud cloud{{0, 0, 500}, 300, 700};
    CloudBillboard billboard;
    billboard.centre_m = {0, -50, 500};
    billboard.width_m = billboard.height_m = 4;
    billboard.texture = BillboardTexture::dense;
    Splats splats;
    splats.clouds = {&cloud, 1};
    splats.billboards = {&billboard, 1};
    options.camera.vertical_fov_deg = 1;
    const auto brightness = [&](double distance, float absorbed) {
        billboard.flash_absorbed = absorbed;
        splats.flash = Flash{{0, -50 - distance, 500}, {1, 0.5, 0.25}, 0.5};
        const Picture picture = renderer_.draw_splats(splats, options);
        const std::size_t middle = 3 * (32 * 65 + 32);
        return std::array<double, 3>{double(picture.beauty[middle]), double(picture.beauty[middle + 1]),
                                     double(picture.beauty[middle + 2])};
    };
    const auto near = brightness(500, 0), far = brightness(1000, 0);
    EXPECT_GT(near[0], 0.3);
    EXPECT_NEAR(near[0] / far[0], 4.0, 0.02);
    EXPECT_NEAR(near[1] / near[0], 0.5, 0.01);
    EXPECT_NEAR(brightness(500, 0.5f)[0] / near[0], 0.5, 0.01);
    EXPECT_LT(brightness(500, 1)[0], 1e-3);
}

bool same_bits(const Picture& a, const Picture& b) {
    const auto same = [](const std::vector<float>& x, const std::vector<float>& y) {
        return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(float)) == 0;
    };
    return same(a.beauty, b.beauty) && same(a.transmittance, b.transmittance) && same(a.depth_m, b.depth_m);
}

TEST_P(BillboardTest, PicturesDependNeitherOnTheOrderGivenNorOnTiles) {
    const RenderOptions options = view({0, -3000, 900}, {0, 0, 1000}, 90, 70);
    std::vector<CloudBillboard> billboards = test::random_billboards(3, 400, 2);
    const Picture first = renderer_.draw_splats(test::scene_of(test::kBillboardClouds, billboards), options);
    EXPECT_TRUE(
        same_bits(first, renderer_.draw_splats(test::scene_of(test::kBillboardClouds, billboards), options)));
    std::shuffle(billboards.begin(), billboards.end(), std::mt19937(4));
    EXPECT_TRUE(
        same_bits(first, renderer_.draw_splats(test::scene_of(test::kBillboardClouds, billboards), options)));
    Renderer tiled(test::validated(GetParam(), 32));
    const Picture in_tiles = tiled.draw_splats(test::scene_of(test::kBillboardClouds, billboards), options);
    reference::DifferenceSum sum;
    for (std::size_t i = 0; i < first.beauty.size(); ++i)
        sum.add(double(first.beauty[i]), double(in_tiles.beauty[i]));
    EXPECT_LT(sum.result().max, 0.04);
    EXPECT_LT(sum.result().mean, 1e-3);
    test::expect_no_messages(tiled);
}

// A red cloud of metaballs between two billboards, in either order: the nearer hides the farther.
TEST_P(BillboardTest, BillboardsAndMetaballsHideEachOtherByDistance) {
    RenderOptions options = view({0, -3000, 1000}, {0, 0, 1000});
    options.air.extinction_per_m = {0, 0, 0};
    const std::vector<BillboardCloud> clouds{{{0, 0, 1000}, 500, 1500}};
    std::vector<CloudBillboard> billboards(1);
    billboards[0].width_m = billboards[0].height_m = 800;
    billboards[0].texture = BillboardTexture::dense;
    const std::vector<Metaball> balls{{0, 0, 1000, 300, 1}};
    Splats splats = test::scene_of(clouds, billboards);
    splats.metaballs = {balls, 1.0, 1.0};
    const auto depth = [&](double y) {
        billboards[0].centre_m = {0, y, 1000};
        return double(renderer_.draw_splats(splats, options).depth_m[32 * 65 + 32]);
    };
    EXPECT_NEAR(depth(-500), 2500, 60);  // the billboard before the ball, nearly opaque
    EXPECT_NEAR(depth(500), 3000, 1);    // and behind it
}

// Shafts are the shadow of billboards, too: air has less light where they shade it, and nowhere more.
TEST_P(BillboardTest, LightShaftsOnlyDarken) {
    RenderOptions options = view({0, -3000, 900}, {0, 0, 1000}, 90, 70);
    options.light_shafts.strength = 0;
    const std::vector<CloudBillboard> billboards = test::random_billboards(6, 100, 2);
    const Picture without =
        renderer_.draw_splats(test::scene_of(test::kBillboardClouds, billboards), options);
    options.light_shafts.strength = 1;
    const Picture with = renderer_.draw_splats(test::scene_of(test::kBillboardClouds, billboards), options);
    double darker = 0;
    for (std::size_t i = 0; i < with.beauty.size(); ++i) {
        EXPECT_LE(with.beauty[i], without.beauty[i] + 1e-3f);
        darker += double(without.beauty[i] - with.beauty[i]);
    }
    EXPECT_GT(darker, 1);
    EXPECT_EQ(with.transmittance.size(), without.transmittance.size());
}

// Whoever does not ask for depth gets the same picture without it.
TEST_P(BillboardTest, DepthIsLeftOutOnRequest) {
    const RenderOptions options = view({0, -3000, 900}, {0, 0, 1000}, 90, 70);
    const std::vector<CloudBillboard> billboards = test::random_billboards(6, 100, 2);
    Splats splats = test::scene_of(test::kBillboardClouds, billboards);
    const Picture with = renderer_.draw_splats(splats, options);
    splats.depth = false;
    const Picture without = renderer_.draw_splats(splats, options);
    test::expect_same_pixels(renderer_, with.beauty, without.beauty);
    test::expect_same_pixels(renderer_, with.transmittance, without.transmittance);
    EXPECT_LT(*std::ranges::min_element(with.depth_m), 4000);
    EXPECT_EQ(*std::ranges::min_element(without.depth_m), std::numeric_limits<float>::infinity());
}

// Billboards far outside of the picture, behind the eye or without opacity change no bit. By night: they cast shadows.
TEST_P(BillboardTest, WhatCannotBeSeenChangesNothing) {
    RenderOptions options = view({0, -3000, 900}, {0, 0, 1000}, 90, 70);
    options.sun.elevation_deg = -5;
    std::vector<CloudBillboard> billboards = test::random_billboards(5, 100, 2);
    const Picture with = renderer_.draw_splats(test::scene_of(test::kBillboardClouds, billboards), options);
    CloudBillboard away = billboards[0];
    for (const Vec3 place : {Vec3{0, -4000, 900}, Vec3{5000, 0, 1000}, Vec3{0, 0, 9000}, Vec3{0, 0, -300}}) {
        away.centre_m = place;
        billboards.push_back(away);
    }
    billboards.push_back(billboards[1]);
    billboards.back().opacity = 0;
    EXPECT_TRUE(
        same_bits(with, renderer_.draw_splats(test::scene_of(test::kBillboardClouds, billboards), options)));
}

// Much smaller than a pixel, a billboard takes as much light out of the picture as its area is.
TEST_P(BillboardTest, BillboardsSmallerThanAPixelKeepTheirOpacity) {
    RenderOptions options = view({0, -20000, 1000}, {0, 0, 1000}, 33, 33, 5);
    const std::vector<BillboardCloud> clouds{{{0, 0, 1000}, 500, 1500}};
    const double pixel_m = 2 * 20000 * std::tan(2.5 * std::numbers::pi / 180) / 33;
    const auto hidden_pixels = [&](double size_pixels, double shift) {
        std::vector<CloudBillboard> billboards(1);
        billboards[0].centre_m = {shift * pixel_m, 0, 1000 + 0.3 * shift * pixel_m};
        billboards[0].width_m = billboards[0].height_m = float(size_pixels * pixel_m);
        billboards[0].texture = BillboardTexture::soft;
        double sum = 0;
        for (const float t : renderer_.draw_splats(test::scene_of(clouds, billboards), options).transmittance)
            sum += 1 - double(t);
        return sum;
    };
    const double expected = hidden_pixels(16, 0) / 256;
    for (const double shift : {0.0, 0.3, 0.5, 0.8}) {
        EXPECT_NEAR(hidden_pixels(0.25, shift) / 0.0625 / expected, 1.0, 0.45) << shift;
        EXPECT_NEAR(hidden_pixels(4, shift) / 16 / expected, 1.0, 0.1) << shift;
    }
}

TEST_P(BillboardTest, BadBillboardsAreRefusedByNumber) {
    const RenderOptions options = view({0, -3000, 900}, {0, 0, 1000});
    std::vector<CloudBillboard> billboards(3);
    const auto message = [&](auto&& damage) {
        std::vector<CloudBillboard> bad = billboards;
        damage(bad[1]);
        try {
            renderer_.draw_splats(test::scene_of(test::kBillboardClouds, bad), options);
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::usage);
            return std::string(error.what());
        }
        return std::string("nothing was thrown");
    };
    const float nan = std::numeric_limits<float>::quiet_NaN();
    EXPECT_EQ(message([&](CloudBillboard& b) { b.centre_m.y = double(nan); }),
              "billboard 1: expected a finite centre");
    EXPECT_EQ(message([&](CloudBillboard& b) { b.width_m = 0; }),
              "billboard 1: expected sizes above 0 and at most 60000 m");
    EXPECT_EQ(message([&](CloudBillboard& b) { b.sun_absorbed = nan; }),
              "billboard 1: expected absorbed light from 0 to 1");
    EXPECT_EQ(message([&](CloudBillboard& b) { b.opacity = 1.5f; }),
              "billboard 1: expected an opacity from 0 to 1");
    EXPECT_EQ(message([&](CloudBillboard& b) { b.cloud = 2; }), "billboard 1: expected the index of a cloud");
}

INSTANTIATE_TEST_SUITE_P(Ways, BillboardTest,
                         ::testing::Values(Splatting::cpu, Splatting::vulkan, Splatting::blended),
                         test::way_name);

// Every level is dark in its outermost texels, hides as much as the finest, and is no brighter than opaque.
TEST(BillboardTextures, AreDarkAtTheirRimsAndHideTheSameAtAllLevels) {
    const std::vector<BillboardLevel>& levels = billboard_textures();
    ASSERT_EQ(int(levels.size()), kBillboardLevels);
    const auto opacity = [](const BillboardLevel& level, int layer) {
        const std::size_t texels = std::size_t(level.side * level.side);
        double sum = 0;
        for (std::size_t at = 0; at < texels; ++at)
            sum += level.texels[2 * (std::size_t(layer) * texels + at)] / 255.0;
        return sum / double(texels);
    };
    for (const BillboardLevel& level : levels) {
        for (int layer = 0; layer < kBillboardKinds * kBillboardVariants; ++layer) {
            EXPECT_NEAR(opacity(level, layer) / opacity(levels[0], layer), 1.0, 0.1)
                << level.side << ", " << layer;
        }
        for (std::size_t at = 0; at < level.texels.size(); at += 2) {
            const int i = int(at / 2) % level.side, j = int(at / 2) / level.side % level.side;
            const bool rim = i == 0 || j == 0 || i == level.side - 1 || j == level.side - 1;
            if (rim) {
                EXPECT_EQ(level.texels[at], 0) << level.side;
            }
            EXPECT_LE(level.texels[at + 1], level.texels[at]) << level.side;
        }
    }
}

}  // namespace
}  // namespace nephos
