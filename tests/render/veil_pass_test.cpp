// SPDX-License-Identifier: Apache-2.0

// Veils per pixel: where rays are in a slab over the round Earth, the light of a level sheet, and pictures of sheets whose
// transmittance is known.

#include "render/veil/veil_pass.h"

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "core/random.h"
#include "render/rain/precipitation_light.h"
#include "render/renderer.h"
#include "render/veil/sheet_light.h"
#include "render/veil/slab_path.h"
#include "render/veil/veil_samples.h"

namespace nephos {
namespace {

// Against the height of the ray at many points.
TEST(SlabPath, IsWhereTheHeightLiesBetweenBaseAndTop) {
    const std::uint64_t seed = 12;
    for (std::uint32_t n = 0; n < 2000; ++n) {
        const PhiloxWords w = philox(seed, item_counter(Domain::particles, 7, n, 0, 0));
        const double rise = std::pow(unit_interval(w[0]), 3) * ((w[1] & 1) != 0 ? 1 : -1);
        const double bend = (w[1] & 2) != 0 ? 0 : 0.5 / 6.36e6;
        const double base = 12'000 * (unit_interval(w[2]) - 0.6),
                     top = base + 50 + 2000 * unit_interval(w[3]);
        const double limit = 300'000;
        const auto parts = parts_in_slab(rise, bend, base, top, limit);
        double before = -1;
        for (const RayPart& part : parts) {
            if (!part.any()) continue;
            EXPECT_GE(part.begin, before);
            EXPECT_LE(part.end, limit);
            before = part.end;
        }
        for (int i = 0; i < 300; ++i) {
            const double t = limit * std::pow((i + 0.5) / 300, 2);
            const double height = rise * t + bend * (1 - rise * rise) * t * t;
            if (std::abs(height - base) < 0.01 || std::abs(height - top) < 0.01) continue;
            bool inside = false;
            for (const RayPart& part : parts)
                inside = inside || (part.any() && t >= part.begin && t <= part.end);
            EXPECT_EQ(inside, height > base && height < top)
                << rise << " " << bend << " " << base << " " << top << " " << t;
        }
    }
}

// What comes in goes out of the top or into the ground; without a sheet the ground has all of it.
TEST(SheetLight, LosesNothing) {
    for (const double depth : {0.0, 0.1, 1.0, 5.0, 40.0}) {
        for (const double sun : {0.05, 0.4, 1.0}) {
            for (const double albedo : {0.0, 0.2, 0.8}) {
                const SheetLight light(depth, sun, albedo);
                // The upward flux at the top, by the boundary there: pi (2 J - B).
                EXPECT_NEAR(2 * light.by_sun(0) + (1 - albedo) * light.below_by_sun(), sun, 1e-12);
                EXPECT_NEAR(2 * light.by_sky(0) - 1 + (1 - albedo) * light.below_by_sky(), 1, 1e-12);
                if (depth == 0) {
                    EXPECT_NEAR(light.below_by_sun(), sun, 1e-12);
                    EXPECT_NEAR(light.below_by_sky(), 1, 1e-12);
                }
            }
        }
    }
}

// 2 / (2 + T) of diffuse light passes a thick sheet in Schuster's two streams, 1 / (1 + 3/4 T) in Eddington's.
TEST(SheetLight, OfThickSheetsIsDimBelowAndBrightAbove) {
    const SheetLight thin(0.2, 0.7, 0.1), thick(10, 0.7, 0.1);
    EXPECT_LT(thick.below_by_sun(), 0.25 * thin.below_by_sun());
    EXPECT_GT(thick.by_sun(0), 2 * thin.by_sun(0));
    EXPECT_GT(thick.by_sun(1), thick.by_sun(9));
}

// An even sheet between two heights.
DrawnVeil even_sheet(double base_m, double top_m, double extinction_per_m, VeilLighting lighting) {
    VeilOptions options;
    options.form = VeilForm::stratus;
    options.sheet = 1;
    options.coverage = 1;
    options.base_m = base_m;
    options.top_m = top_m;
    options.soft_base_m = options.soft_top_m = 0;
    VeilView view;
    view.light = lighting;
    return {std::make_shared<VeilSlab>(options, Wind{}, 0, 0, std::nullopt), extinction_per_m, view};
}

Picture picture_of(const std::vector<DrawnVeil>& veils, const RenderOptions& options) {
    return Renderer({.splatting = Splatting::cpu}).draw_splats({}, options, veils);
}

RenderOptions looking(const Vec3& from, const Vec3& to) {
    RenderOptions options;
    options.camera.position_m = from;
    options.camera.target_m = to;
    options.camera.width = 33;
    options.camera.height = 25;
    options.camera.vertical_fov_deg = 40;
    options.shadow_map_size = 64;
    options.atmosphere.model = AirModel::physical;
    return options;
}

constexpr std::size_t kMiddle = 12 * 33 + 16;

TEST(VeilPass, ObeysBeerAndLambert) {
    const double extinction = 0.0007, thickness = 900;
    const RenderOptions up = looking({0, 0, 2}, {0, 1000, 1002}),
                        down = looking({0, 0, 9000}, {0, 1000, 8000});
    for (const RenderOptions& options : {up, down}) {
        const Picture picture =
            picture_of({even_sheet(4000, 4000 + thickness, extinction, VeilLighting::physical)}, options);
        EXPECT_NEAR(picture.transmittance[kMiddle], std::exp(-extinction * thickness * std::sqrt(2.0)), 2e-3);
        const double height = std::abs(4450 - options.camera.position_m.z);
        EXPECT_NEAR(picture.depth_m[kMiddle], height * std::sqrt(2.0), 0.05 * height);
    }
}

TEST(VeilPass, LeavesThePictureAloneWhereThereIsNone) {
    const RenderOptions up = looking({0, 0, 2}, {0, 1000, 1002});
    Splats nothing;
    const Picture clear = Renderer({.splatting = Splatting::cpu}).draw_splats(nothing, up);
    DrawnVeil veil = even_sheet(4000, 4500, 0.001, VeilLighting::physical);
    VeilOptions far;
    far.base_m = 4000;
    far.top_m = 4500;
    far.area = {500'000, 0, 1000, 1000, 0, 1, false};
    veil.slab = std::make_shared<VeilSlab>(far, Wind{}, 0, 2, std::nullopt);
    const Picture picture = picture_of({veil}, up);
    // The heights of clouds choose the air's ambient light, which nothing shows here.
    EXPECT_EQ(picture.beauty, clear.beauty);
    EXPECT_EQ(picture.transmittance, clear.transmittance);
}

// Broken clouds with a free path of 80 m, seen at a slant: a picture with few samples is that of 16 times as many. Contours
// would differ from pixel to pixel, so neighbours are compared as well.
TEST(VeilPass, FewSamplesShowWhatManyDo) {
    VeilOptions clouds;
    clouds.form = VeilForm::cumulus;
    clouds.coverage = 0.3;
    clouds.base_m = 1200;
    clouds.top_m = 2400;
    clouds.soft_base_m = 180;
    clouds.soft_top_m = 900;
    RenderOptions options = looking({0, 0, 2}, {0, 1000, 160});
    options.camera.width = 96;
    options.camera.height = 40;
    options.camera.vertical_fov_deg = 10;
    for (const VeilLighting lighting : {VeilLighting::physical, VeilLighting::two_samples}) {
        DrawnVeil veil{std::make_shared<VeilSlab>(clouds, Wind{}, 0, 3, std::nullopt), 0.012, VeilView{}};
        veil.view.light = lighting;
        veil.view.samples = 16;
        const Picture few = picture_of({veil}, options);
        veil.view.samples = 256;
        const Picture many = picture_of({veil}, options);
        double sum = 0, light = 0, rough = 0, smooth = 0;
        for (std::size_t n = 0; n + 2 * 96 < many.transmittance.size(); ++n) {
            const auto green = [&](const Picture& of, std::size_t at) { return double(of.beauty[3 * at + 1]); };
            const auto bend = [&](const Picture& of) {  // from row to row
                return std::abs(green(of, n) - 2 * green(of, n + 96) + green(of, n + 192));
            };
            sum += std::abs(green(few, n) - green(many, n));
            light += green(many, n);
            rough += bend(few);
            smooth += bend(many);
        }
        EXPECT_LT(sum, 0.03 * light) << int(lighting);
        EXPECT_LT(rough, 1.15 * smooth) << int(lighting);
    }
}

// A thick sheet is grey from below and darkens the ground; from above it is bright. Both kinds of light agree on that.
TEST(VeilPass, ThickSheetsAreBrightAboveAndDarkBelow) {
    for (const VeilLighting lighting : {VeilLighting::physical, VeilLighting::two_samples}) {
        const std::vector<DrawnVeil> veils{even_sheet(800, 1600, 0.03, lighting)};
        const RenderOptions up = looking({0, 0, 2}, {0, 1000, 1002}),
                            down = looking({0, 0, 5000}, {0, 1000, 4000}),
                            ground = looking({0, 0, 100}, {0, 100, 0});
        const Picture below = picture_of(veils, up), above = picture_of(veils, down);
        EXPECT_LT(below.transmittance[kMiddle], 1e-3f);
        EXPECT_GT(above.beauty[3 * kMiddle + 1], 1.5f * below.beauty[3 * kMiddle + 1]) << int(lighting);
        const Picture dark = picture_of(veils, ground), lit = picture_of({}, ground);
        EXPECT_LT(dark.beauty[3 * kMiddle + 1], 0.6f * lit.beauty[3 * kMiddle + 1]) << int(lighting);
        EXPECT_GT(dark.beauty[3 * kMiddle + 1], 0.05f * lit.beauty[3 * kMiddle + 1]) << int(lighting);
    }
}

// S's light of one ray, worked out sample by sample as S writes it, with the vectors themselves: straight up through a
// level veil of density 1 between 1 and 2 km, in four samples, whose factor by height is 1/2 at the base and 3/2 at the
// top. Towards the sun, 30 degrees high, the second sample is 120 m higher, so that the densities differ by 0.12 and
// df = (0.5 (-0.12) + 0.31)^2 = 1/16; h . v = 1/2, so that C_d = 3 (1 - 1/2)^2 = 3/4 of the sun's light.
TEST(VeilPass, TwoSampleLightIsThatOfAScalarTwin) {
    DrawnVeil veil = even_sheet(1000, 2000, 0.0004, VeilLighting::two_samples);
    veil.view.samples = 4;
    veil.view.height_slope = veil.view.height_offset = 1;
    veil.view.two_samples = {.sun_step_m = 240,
                             .shade_gain = 0.5,
                             .shade_offset = 0.31,
                             .shade_power = 2,
                             .glow_gain = 3,
                             .glow_power = 2,
                             .bounce_power = 2};
    Sheet sheet;
    sheet.veil = &veil;
    const shader::FrameUniforms frame{};  // of a picture without the sun
    sheet.frame = &frame;
    sheet.base_m = 1000;
    sheet.top_m = 2000;
    sheet.to_sun = {std::sqrt(0.75), 0, 0.5};
    sheet.sun_cosine = 0.5;
    sheet.sun = {8, 6, 4};
    sheet.sky = {1, 2, 3};
    sheet.ground = {0.5, 0.25, 0.125};
    std::vector<SeenVeil> seen(1);
    SampleGroup group(sheet, {}, seen);
    group.add(0, {0, 0, 1}, {1000, 2000});
    group.flush();

    const Vec3 to_viewer{0, 0, -1}, half = glm::normalize(sheet.to_sun + to_viewer);
    const double glow = 3 * std::pow(1 - glm::dot(half, to_viewer), 2), df = std::pow(0.5 * -0.12 + 0.31, 2);
    EXPECT_NEAR(glow, 0.75, 1e-12);
    EXPECT_NEAR(df, 1.0 / 16, 1e-12);
    Rgb expected{};
    double left = 1;
    for (const double gr : {0.125, 0.375, 0.625, 0.875}) {
        const double covers = left * (gr + 0.5) * 0.0004 * 250;  // a mu dp
        for (std::size_t c = 0; c < 3; ++c) {
            const double around = std::lerp(sheet.sky[c], sheet.sun[c], gr), direct = glow * sheet.sun[c];
            expected[c] += covers * (std::lerp(around, direct, df) + sheet.ground[c] * (1 - gr) * (1 - gr));
        }
        left -= covers;
    }
    EXPECT_NEAR(seen[0].transmittance, left, 1e-6);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(seen[0].light[c], expected[c], 1e-5) << c;
    EXPECT_NEAR(seen[0].light[0], 1.747888, 1e-5);  // worked out by hand
}

// Where the density is scaled by height, light and shadow are those of the scaled one.
TEST(VeilPass, ScaledDensityIsDensity) {
    for (const VeilLighting lighting : {VeilLighting::physical, VeilLighting::two_samples}) {
        const std::vector<DrawnVeil> plain{even_sheet(800, 1600, 0.004, lighting)};
        std::vector<DrawnVeil> scaled{even_sheet(800, 1600, 0.0004, lighting)};
        scaled[0].view.height_offset = 10;
        for (const RenderOptions& options :
             {looking({0, 0, 2}, {0, 1000, 1002}), looking({0, 0, 5000}, {0, 1000, 4000}),
              looking({0, 0, 100}, {0, 100, 0})}) {
            const Picture expected = picture_of(plain, options), found = picture_of(scaled, options);
            EXPECT_NEAR(found.transmittance[kMiddle], expected.transmittance[kMiddle], 1e-4f);
            if (lighting == VeilLighting::two_samples) continue;  // S's light reads the densities themselves
            for (std::size_t c = 0; c < 3; ++c)
                EXPECT_NEAR(found.beauty[3 * kMiddle + c], expected.beauty[3 * kMiddle + c],
                            1e-4f * expected.beauty[3 * kMiddle + c]);
        }
    }
}

// Towards the shadow of the eye, where roundings make the cosine less than -1.
TEST(VeilPass, IsFiniteOppositeTheSun) {
    for (int n = 0; n < 24; ++n) {
        RenderOptions options = looking({0, 0, 5000}, {0, 1000, 4000});
        options.sun.azimuth_deg = 15.3 * n;
        options.sun.elevation_deg = 20 + 2.7 * n;
        const double azimuth = options.sun.azimuth_deg * std::numbers::pi / 180,
                     elevation = options.sun.elevation_deg * std::numbers::pi / 180;
        options.camera.target_m = options.camera.position_m -
                                  1000.0 * Vec3(std::sin(azimuth) * std::cos(elevation),
                                              std::cos(azimuth) * std::cos(elevation), std::sin(elevation));
        const Picture picture = picture_of({even_sheet(800, 1600, 0.03, VeilLighting::two_samples)}, options);
        for (const float value : picture.beauty) ASSERT_TRUE(std::isfinite(value)) << n;
    }
}

// A veil high above is lit when the sun has set on the ground: the ground has only the sky to lose.
TEST(VeilPass, DarkensTheGroundOfTwilightByItsSky) {
    RenderOptions ground = looking({0, 0, 100}, {0, 100, 0});
    ground.sun.elevation_deg = -2;
    const double depth = 0.3;
    const Picture lit = picture_of({}, ground),
                  below =
                      picture_of({even_sheet(9000, 10'000, depth / 1000, VeilLighting::physical)}, ground);
    ASSERT_GT(lit.beauty[3 * kMiddle + 1], 0);
    const double kept = SheetLight((1 - VeilView().g) * depth * 0.8, 0.02, 0.1).below_by_sky();
    EXPECT_NEAR(below.beauty[3 * kMiddle + 1] / lit.beauty[3 * kMiddle + 1], kept, 0.03);
}

// In 40 km the round Earth hides a veil at 8 km less than a plane would: it meets the ground at 320 km.
TEST(VeilPass, GoesToTheHorizon) {
    const RenderOptions options = looking({0, 0, 2}, {0, 1000, 30});
    const Picture picture = picture_of({even_sheet(8000, 8600, 0.0003, VeilLighting::physical)}, options);
    EXPECT_LT(picture.transmittance[kMiddle], 0.2f);
    EXPECT_GT(picture.depth_m[kMiddle], 100'000);
    EXPECT_LT(picture.depth_m[kMiddle], 330'000);
}

TEST(VeilPass, TheFartherSheetIsBehindTheNearer) {
    const RenderOptions options = looking({0, 0, 2}, {0, 1000, 1002});
    const std::vector<DrawnVeil> low_first{even_sheet(800, 1600, 0.05, VeilLighting::physical),
                                           even_sheet(8000, 9000, 0.05, VeilLighting::two_samples)};
    const std::vector<DrawnVeil> high_first{low_first[1], low_first[0]};
    const Picture a = picture_of(low_first, options), b = picture_of(high_first, options);
    EXPECT_EQ(a.beauty, b.beauty);
    EXPECT_LT(a.depth_m[kMiddle], 3000);
}

// Below an even sheet a metaball, a billboard and rain have exp(-(1 - g) depth) of the sunlight, half within it, all above.
TEST(VeilShade, IsTheSlabsTransmittanceTowardsTheSun) {
    const double extinction = 0.0007, thickness = 900;
    for (const VeilLighting lighting : {VeilLighting::physical, VeilLighting::two_samples}) {
        DrawnVeil veil = even_sheet(4000, 4000 + thickness, extinction, lighting);
        veil.view.g = 0.6;
        const double forwards = lighting == VeilLighting::physical ? 0.4 : 1;
        for (const double elevation : {90.0, 30.0}) {
            RenderOptions options = looking({0, -6000, 1000}, {0, 0, 1000});
            options.sun.elevation_deg = elevation;
            const std::vector<Metaball> balls{{0, 0, 1000, 50, 1}, {2000, 0, 4450, 50, 1}, {4000, 0, 6000, 50, 1}};
            Splats splats;
            splats.metaballs = {balls, 0.001, 1.0};
            options.precipitation.enabled = true;
            Renderer renderer({.splatting = Splatting::cpu});
            const Picture open = renderer.draw_splats(splats, options),
                          below = renderer.draw_splats(splats, options, {&veil, 1});
            const double depth = forwards * extinction * thickness / std::sin(elevation * 3.14159265358979 / 180);
            EXPECT_NEAR(below.light[0] / open.light[0], std::exp(-depth), 2e-3);
            EXPECT_NEAR(below.light[1] / open.light[1], std::exp(-0.5 * depth), 2e-3);
            EXPECT_NEAR(below.light[2] / open.light[2], 1, 1e-5);
            EXPECT_NEAR(sunlight_at(below, {500, 300, 20}), std::exp(-depth), 2e-3);
            EXPECT_EQ(below.shadow, open.shadow) << "the ground would be darkened twice";
        }
    }
}

}  // namespace
}  // namespace nephos
