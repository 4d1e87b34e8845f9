// SPDX-License-Identifier: Apache-2.0
// Wet, snowy and farmed ground, and water, that a device draws, against those of the processor: in every light, below
// clouds of every kind, in parts, in flight, and where lists are too short.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "density/density_grid.h"
#include "density/metaballs.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/renderer_test_access.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

enum class Clouds { none, metaballs, detail, endless };

// Amounts of a map of 9 x 7 texels around the eye, over values beyond.
struct Map {
    std::vector<float> water_mm, snow_mm, rain_mm_per_h;
};

struct GroundView {
    std::string name;
    RenderOptions options;
    GroundCoverView cover;
    Clouds clouds = Clouds::none;
    bool veil = false, flash = false, map = false;
    double time_s = 12.34;
};

GroundView plain_view(const std::string& name) {
    GroundView view{name, test::view({0, 0, 20}, {0, 100, 12}, 60, 96, 72, 64), {}};
    view.options.wet_ground.puddle_film_mm = 0.5;
    return view;
}

std::vector<GroundView> views() {
    std::vector<GroundView> all;
    const auto add = [&](const std::string& name, const std::function<void(GroundView&)>& change) {
        all.push_back(plain_view(name));
        change(all.back());
    };
    const auto wet = [](GroundView& v) {
        v.cover.outside.water_mm = 0.6;
        v.cover.outside_rain_mm_per_h = 12;
    };
    const auto sea = [](GroundView& v) {
        v.options.ground.pattern = GroundPattern::water;
        v.options.water.wind_m_per_s = 9;
    };
    add("wet", wet);
    add("ripples near", [&](GroundView& v) {
        wet(v);
        v.options.camera.position_m = {3, 2, 1.1};
        v.options.camera.target_m = {3, 6, 0};
    });
    add("snow", [](GroundView& v) { v.cover.outside.snow_mm = 1.4; });
    add("slush by night", [&](GroundView& v) {
        wet(v);
        v.cover.outside.snow_mm = 0.8;
        v.options.sun.elevation_deg = -15;
        v.flash = true;
    });
    add("country", [](GroundView& v) {
        v.options.ground.pattern = GroundPattern::country;
        v.options.camera.position_m.z = 300;
        v.options.camera.target_m = {0, 600, 0};
    });
    add("wet country", [&](GroundView& v) {
        wet(v);
        v.options.ground.pattern = GroundPattern::country;
        v.cover.outside.snow_mm = 0.3;
        v.options.camera.position_m.z = 120;
    });
    add("sea", sea);
    add("sea against the sun", [&](GroundView& v) {
        sea(v);
        v.options.water.whitecaps = 4;
        v.options.sun.azimuth_deg = 0;
        v.options.sun.elevation_deg = 15;
        v.options.atmosphere.model = AirModel::physical;
    });
    add("sea in the rain", [&](GroundView& v) {
        sea(v);
        v.options.water.wind_m_per_s = 2;
        v.cover.outside_rain_mm_per_h = 12;
        v.options.camera.position_m = {3, 2, 1.3};
        v.options.camera.target_m = {3, 6, 0};
    });
    add("a map", [&](GroundView& v) {
        wet(v);
        v.map = true;
        v.options.camera.position_m.z = 60;
        v.options.camera.target_m = {20, 100, 0};
    });
    const std::size_t simple = all.size();
    for (const std::size_t n : {0u, 2u, 6u}) {
        for (const AirModel model : {AirModel::gradient, AirModel::physical}) {
            all.push_back(all[n]);
            all.back().name += model == AirModel::physical ? ", cloud, physical sky" : ", cloud";
            all.back().clouds = Clouds::metaballs;
            all.back().options.atmosphere.model = model;
            all.back().options.shells.count = 24;
            all.back().options.light_shafts.strength = model == AirModel::physical ? 1 : 0;
        }
    }
    for (const std::size_t n : {0u, 2u, 5u, 6u}) {
        for (const Clouds clouds : {Clouds::detail, Clouds::endless}) {
            all.push_back(all[n]);
            all.back().name += clouds == Clouds::detail ? ", detail" : ", clouds to the horizon";
            all.back().clouds = clouds;
            all.back().options.atmosphere.model = n == 2u ? AirModel::gradient : AirModel::physical;
        }
    }
    for (const std::size_t n : {std::size_t{0}, std::size_t{6}, simple}) {
        all.push_back(all[n]);
        all.back().name += ", veil";
        all.back().veil = true;
    }
    return all;
}

const std::vector<Metaball>& balls() {
    static const std::vector<Metaball> all = test::ragged_cloud({{-480, 300, 400}, 40, 24, 24, 16});
    return all;
}

// A heap of voxels with detail; `endless`: whose images go on to the horizon.
Splats detailed(bool endless) {
    struct Heap {
        std::vector<Metaball> balls;
        std::vector<DetailedVoxels> parts;
    };
    const auto make = [](bool repeats) {
        const Extent extent{24, 20, 14};
        std::vector<float> values(extent.cells(), 0.0f);
        for (int z = 0; z < extent.z; ++z)
            for (int y = 0; y < extent.y; ++y)
                for (int x = 0; x < extent.x; ++x) {
                    const double dx = (x + 0.5) / extent.x - 0.5, dy = (y + 0.5) / extent.y - 0.5,
                                 dz = (z + 0.5) / extent.z - 0.3;
                    const double inside = 1 - 5 * (dx * dx + dy * dy + dz * dz);
                    if (inside > 0)
                        values[linear_index(extent, x, y, z)] = float(0.6 * inside * test::voxel_noise(x, y, z, 1));
                }
        Heap heap;
        DetailedVoxels& part = heap.parts.emplace_back();
        part.density = DensityGrid::from_dense(values, extent, {{-480, 200, 600}, 40.0});
        part.setting = {.extinction_per_m = 0.1};
        if (repeats) part.setting.boundaries.x = part.setting.boundaries.y = Boundary::periodic;
        heap.balls = metaballs(part.density, part.setting.metaball_radius_cells);
        part.count = heap.balls.size();
        return heap;
    };
    static const Heap one = make(false), many = make(true);
    const Heap& heap = endless ? many : one;
    Splats splats;
    splats.metaballs = {heap.balls, 0.1, metaball_normalisation(2), heap.parts};
    return splats;
}

const Map& map_of_texels() {
    static const Map map = [] {
        Map made;
        for (int n = 0; n < 63; ++n) {
            made.water_mm.push_back(0.1f * float((n * 5) % 13));
            made.snow_mm.push_back(n % 4 == 0 ? 0.7f : 0.0f);
            made.rain_mm_per_h.push_back(float(n % 7) * 3);
        }
        return made;
    }();
    return map;
}

Splats splats_of(const GroundView& view) {
    Splats splats;
    if (view.clouds == Clouds::detail || view.clouds == Clouds::endless) splats = detailed(view.clouds == Clouds::endless);
    if (view.clouds == Clouds::metaballs) splats.metaballs = {balls(), 0.05, test::kVoxelNormalisation};
    splats.time_s = view.time_s;
    if (view.flash) splats.flash = Flash{{300, 1200, 700}, {0.8, 0.8, 1}, 0.15};
    GroundCoverView cover = view.cover;
    if (view.map) {
        const Map& map = map_of_texels();
        cover.columns = 9;
        cover.rows = 7;
        cover.x_m = -130;
        cover.y_m = -40;
        cover.texel_x_m = 30;
        cover.texel_y_m = 40;
        cover.water_mm = map.water_mm;
        cover.snow_mm = map.snow_mm;
        cover.rain_mm_per_h = map.rain_mm_per_h;
    }
    splats.ground_cover = cover;
    return splats;
}

// A thin sheet high above, without structure.
std::span<const DrawnVeil> veils_of(const GroundView& view) {
    static const std::vector<DrawnVeil> sheet = [] {
        VeilOptions options;
        options.form = VeilForm::stratus;
        options.coverage = 1;
        options.base_m = 3000;
        options.top_m = 3600;
        return std::vector<DrawnVeil>{
            {std::make_shared<VeilSlab>(options, Wind{}, 0, 0, std::nullopt), 0.0004, {}}};
    }();
    return view.veil ? std::span(sheet) : std::span<const DrawnVeil>();
}

Picture draw(Renderer& renderer, const GroundView& view) {
    return renderer.draw_splats(splats_of(view), view.options, veils_of(view));
}

// The same without what is on the ground.
GroundView dry(GroundView view) {
    view.cover = {};
    view.map = false;
    view.options.ground.pattern = GroundPattern::plain;
    return view;
}

// Numbers that differ by more than a fraction of white, or of what is brighter.
std::size_t apart(const Picture& a, const Picture& b, float fraction = 1.0f / 255) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.beauty.size(); ++i)
        count += !(std::abs(a.beauty[i] - b.beauty[i]) <= fraction * std::max(1.0f, b.beauty[i])) ? 1 : 0;
    return count;
}

class GroundBackends : public ::testing::Test {
  protected:
    void TearDown() override { test::expect_no_messages(vulkan_); }
    Renderer cpu_{test::validated(Splatting::cpu)}, vulkan_{test::validated(Splatting::vulkan)};
};

TEST_F(GroundBackends, Agree) {
    std::size_t drawn = 0;
    for (const GroundView& view : views()) {
        const Picture plain = draw(cpu_, dry(view)), expected = draw(cpu_, view), picture = draw(vulkan_, view);
        const std::size_t count = apart(picture, expected), changed = apart(plain, expected, 0.01f);
        std::printf("%s: %zu of %zu numbers with ground, %zu apart, by up to %.5f\n", view.name.c_str(), changed,
                    plain.beauty.size(), count, double(test::largest_difference(picture.beauty, expected.beauty)));
        EXPECT_GT(changed, plain.beauty.size() / 20) << view.name;
        EXPECT_LE(count, picture.beauty.size() / 1000) << view.name;
        EXPECT_EQ(RendererTestAccess::grounds_on_device(vulkan_), ++drawn) << view.name;
        EXPECT_LE(apart(picture, expected, 0.02f), view.clouds == Clouds::none ? 0u : 3u) << view.name;
    }
}

// Whatever was drawn before, what else is in flight, and in how many parts.
TEST_F(GroundBackends, HaveTheBitsOfThoseDrawnOneByOne) {
    const std::vector<GroundView> all = views();
    std::vector<Picture> expected(all.size());
    Renderer other(test::validated(Splatting::vulkan));
    for (std::size_t n = all.size(); n-- > 0;) expected[n] = draw(other, all[n]);
    std::vector<PendingPicture> pending;
    for (std::size_t n = 0; n < all.size(); ++n) {
        pending.push_back(vulkan_.begin(splats_of(all[n]), all[n].options, veils_of(all[n])));
        EXPECT_EQ(pending.back().is_pending(), !all[n].veil) << all[n].name;
        if (n == 0) continue;
        SCOPED_TRACE(all[n - 1].name);
        test::expect_same_bits(vulkan_.finish(std::move(pending[n - 1])), expected[n - 1]);
    }
    test::expect_same_bits(vulkan_.finish(std::move(pending.back())), expected.back());
    Renderer in_parts(test::validated(Splatting::vulkan, 40));
    for (std::size_t n = 0; n < 10; ++n) {
        SCOPED_TRACE(all[n].name);
        EXPECT_LE(test::largest_difference(draw(in_parts, all[n]).beauty, expected[n].beauty), 1e-4f);
    }
    test::expect_no_messages(in_parts);
}

// Parts that are drawn again have their ground, and their mirrored view, too.
TEST_F(GroundBackends, AreThereWhereListsWereTooShort) {
    GroundView view = plain_view("wet");
    view.cover.outside.water_mm = 0.6;
    view.options.camera.width = 240;
    view.options.camera.height = 180;
    const std::vector<Metaball> around = test::ragged_cloud({{-480, -400, 5}, 40, 24, 24, 16});
    Splats splats = splats_of(view);
    splats.metaballs = {around, 2e-4, test::kVoxelNormalisation};
    const Picture expected = cpu_.draw_splats(splats, view.options);
    const Picture picture = vulkan_.draw_splats(splats, view.options);  // its lists have not grown yet
    EXPECT_GT(RendererTestAccess::overflows(vulkan_), 1u);
    EXPECT_EQ(RendererTestAccess::grounds_on_device(vulkan_), 1u);
    EXPECT_LE(apart(picture, expected), picture.beauty.size() / 1000);
    const std::size_t before = RendererTestAccess::overflows(vulkan_);
    const Picture again = vulkan_.draw_splats(splats, view.options);
    EXPECT_EQ(RendererTestAccess::overflows(vulkan_), before);
    test::expect_same_bits(picture, again);
}

// Neither the picture nor the mirrored view goes from the host to the device.
TEST_F(GroundBackends, PicturesStayOnTheDevice) {
    for (GroundView view : {views()[0], views()[6]}) {
        std::uint64_t bytes[2];
        for (const int scale : {1, 4}) {
            view.options.camera.width = 96 * scale;
            view.options.camera.height = 72 * scale;
            draw(vulkan_, view);
            const std::uint64_t before = RendererTestAccess::uploaded_bytes(vulkan_);
            draw(vulkan_, view);
            bytes[scale / 4] = RendererTestAccess::uploaded_bytes(vulkan_) - before;
        }
        EXPECT_EQ(bytes[1], bytes[0]) << view.name;
    }
}

// Rain over wet ground below clouds with detail, of whose metaballs some are merged.
TEST_F(GroundBackends, RainFallsInTheSamePass) {
    GroundView view = views()[0];
    view.clouds = Clouds::detail;
    view.options.precipitation.enabled = true;
    view.options.precipitation.particles = 4000;
    Splats splats = splats_of(view);
    Rainfall rain{view.options, {}, view.time_s};
    rain.weather.seed = 3;
    RainCurtain& area = rain.weather.curtains.emplace_back();
    area.y_m = 700;
    area.semi_a_m = area.semi_b_m = 600;
    area.base_m = 700;
    area.rate_mm_per_h = 20;
    for (const double pixels : {0.0, 40.0}) {
        view.options.level_of_detail.pixels = rain.options.level_of_detail.pixels = pixels;
        const Picture expected = cpu_.draw_splats(splats, view.options, {}, rain),
                      picture = vulkan_.draw_splats(splats, view.options, {}, rain);
        EXPECT_GT(apart(cpu_.draw_splats(splats, view.options), expected, 0.01f), expected.beauty.size() / 50);
        EXPECT_LE(apart(picture, expected), picture.beauty.size() / 1000);
        test::expect_same_bits(vulkan_.draw_splats(splats, view.options, {}, rain), picture);
    }
    EXPECT_EQ(RendererTestAccess::rains_on_device(vulkan_), 4u);
}

// Mirrored views that are larger than what shaders see of a buffer: the processor draws the ground.
TEST_F(GroundBackends, LargeMirrorsAreLeftToTheProcessor) {
    GroundView view = plain_view("wet");
    view.cover.outside.water_mm = 0.6;
    view.options.camera.width = 384;
    view.options.camera.height = 288;
    view.options.wet_ground.reflection_scale = 1;
    Renderer limited(test::validated(Splatting::vulkan, 200));
    const Picture expected = draw(cpu_, view);
    RendererTestAccess::limit_storage(limited, 1 << 20);
    const Picture picture = draw(limited, view);
    EXPECT_EQ(RendererTestAccess::grounds_on_device(limited), 0u);
    EXPECT_LE(apart(picture, expected), picture.beauty.size() / 1000)
        << test::largest_difference(picture.beauty, expected.beauty);
}

}  // namespace
}  // namespace nephos
