// SPDX-License-Identifier: Apache-2.0
// Rain and snow that a device draws, against those of the processor: in every light, near and far, over clouds and beside
// them, on dry and on wet ground.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/rain_scene.h"
#include "tests/render/renderer_test_access.h"
#include "tests/render/voxel_cloud.h"

namespace nephos {
namespace {

struct RainView {
    std::string name;
    RenderOptions options;
    Weather weather;
    double time_s = 3;
    bool cloud = false, wet = false, veil = false;
};

constexpr Vec3 kWithin{100, 900, 2}, kAtTheEdge{100, 380, 3}, kAfar{0, -3500, 60};

RainView rain_at(const std::string& name, const Vec3& eye, const Vec3& way) {
    RainView view{name, test::rain_view(eye, eye + way, 120, 88, 20'000), {}};
    view.options.shadow_map_size = 128;
    view.weather.seed = 3;
    view.weather.curtains = {test::rain_area()};
    view.weather.wind_x_m_per_s = 2;
    view.weather.carried_x_m = 200;
    return view;
}

// A cloud that covers a part of the area, with bases at different heights.
std::shared_ptr<const CloudBases> broken_cloud() {
    auto cloud = std::make_shared<CloudBases>();
    cloud->x_m = -700;
    cloud->y_m = 300;
    cloud->texel_m = 100;
    cloud->columns = 16;
    cloud->rows = 12;
    for (int n = 0; n < cloud->columns * cloud->rows; ++n) {
        const float water = n % 16 < 11 ? float((n * 7) % 10) / 10 : 0.0f;
        cloud->water.push_back(water);
        cloud->water_base_m.push_back(water * float(600 + 15 * (n % 13)));
    }
    return cloud;
}

std::vector<RainView> views() {
    const Vec3 north{0, 100, 10}, east{100, 20, 5}, down{10, 60, -50};
    std::vector<RainView> all{rain_at("within", kWithin, north), rain_at("downwards", kWithin, down),
                              rain_at("at the edge", kAtTheEdge, north),
                              rain_at("far particles", {100, 250, 3}, north),
                              rain_at("shafts", kAfar, {0, 1000, 40})};
    const auto add = [&](const std::string& name, const Vec3& eye, const Vec3& way,
                         const std::function<void(RainView&)>& change) {
        all.push_back(rain_at(name, eye, way));
        change(all.back());
    };
    const auto snows = [](RainView& v) {
        v.options.precipitation.kind = PrecipitationKind::snow;
        v.weather.curtains[0].rate_mm_per_h = 3;
    };
    add("snow", kWithin, east, snows);
    add("snow afar", kAfar, {0, 1000, 40}, snows);
    add("sun behind the eye", kAtTheEdge, north, [](RainView& v) {
        v.options.sun.azimuth_deg = 180;
        v.options.sun.elevation_deg = 15;
        v.options.atmosphere.model = AirModel::physical;
    });
    add("against the sun", kWithin, north, [](RainView& v) {
        v.options.sun.azimuth_deg = 0;
        v.options.sun.elevation_deg = 12;
    });
    add("night with lightning", kAtTheEdge, north, [](RainView& v) {
        v.options.sun.elevation_deg = -15;
        v.options.lightning = {{.position_m = {300, 1500, 900}, .time_s = 2.6, .intensity = 2}};
    });
    add("below a broken cloud", kWithin, east,
        [](RainView& v) { v.weather.curtains[0].cloud = broken_cloud(); });
    add("a broken cloud afar", kAfar, {0, 1000, 40}, [](RainView& v) {
        v.weather.curtains[0].cloud = broken_cloud();
        v.weather.curtains[0].lean_x = 0.3;
    });
    add("virga below a cloud that repeats", kAfar, {0, 1000, 40}, [](RainView& v) {
        auto cloud = std::make_shared<CloudBases>(*broken_cloud());
        cloud->columns = 11;  // other texels stand side by side
        cloud->water.resize(11 * 12);
        cloud->water_base_m.resize(11 * 12);
        cloud->repeats_x = cloud->repeats_y = true;
        v.weather.curtains[0].cloud = cloud;
        v.weather.curtains[0].lean_y = -0.2;
        v.options.precipitation.evaporation = 0.3;
    });
    add("within, below a cloud that repeats", kWithin, east, [](RainView& v) {
        auto cloud = std::make_shared<CloudBases>(*broken_cloud());
        cloud->x_m = 4000;
        cloud->y_m = -3000;
        cloud->repeats_x = cloud->repeats_y = true;
        v.weather.curtains[0].cloud = cloud;
        v.options.precipitation.evaporation = 0.001;
    });
    add("virga", kAfar, {0, 1000, 40}, [](RainView& v) { v.options.precipitation.evaporation = 0.4; });
    add("without texture and edge", kAfar, {0, 1000, 40}, [](RainView& v) {
        v.options.precipitation.shaft_texture = 0;
        v.options.precipitation.edge = 0;
    });
    add("areas that overlap", kAtTheEdge, north, [](RainView& v) {
        for (int n = 1; n < 6; ++n) {
            RainCurtain more = test::rain_area();
            more.id = std::uint64_t(n);
            more.x_m += 320 * n - 900;
            more.y_m += 90 * n;
            more.rate_mm_per_h = 5 * n;
            more.lean_x = 0.1 * n;
            v.weather.curtains.push_back(more);
        }
    });
    add("in a month", kWithin, north, [](RainView& v) {
        v.time_s = 30 * 86'400.0 + 0.3;
        v.weather.carried_x_m = 1.7e7;
        v.weather.carried_y_m = -3.3e6;
    });
    add("snow in a month", kWithin, north, [&](RainView& v) {
        snows(v);
        v.time_s = 30 * 86'400.0 + 0.3;
    });
    add("from a train", kWithin, north, [](RainView& v) {
        v.options.camera.path = {{0, kWithin, kWithin + Vec3{0, 100, 10}},
                                 {10, kWithin + Vec3{150, 250, 4}, kWithin + Vec3{150, 350, 10}}};
    });
    for (const bool snow : {false, true})
        add(snow ? "snow below a veil" : "below a veil", kWithin, north, [&](RainView& v) {
            if (snow) snows(v);
            v.options.sun.azimuth_deg = 0;
            v.options.sun.elevation_deg = 20;
            v.veil = true;
        });
    const std::size_t dry = all.size();
    for (std::size_t n : {0u, 2u, 4u}) {  // before and behind a cloud, in its shadow
        all.push_back(all[n]);
        all.back().name += ", with a cloud";
        all.back().cloud = true;
    }
    for (std::size_t n : {std::size_t{0}, std::size_t{5}, dry}) {
        all.push_back(all[n]);
        all.back().name += ", wet ground";
        all.back().wet = true;
    }
    for (const bool wet : {false, true}) {
        all.push_back(rain_at("splashes", kWithin, {0, 10, -2}));
        all.back().options.precipitation.splashes = 1;
        all.back().wet = wet;
    }
    return all;
}

const std::vector<Metaball>& balls() {
    static const std::vector<Metaball> all = test::ragged_cloud({{-480, 300, 300}, 40, 24, 24, 16});
    return all;
}

Splats splats_of(const RainView& view) {
    Splats splats;
    if (view.cloud) splats.metaballs = {balls(), 0.05, test::kVoxelNormalisation};
    splats.time_s = view.time_s;
    if (view.wet) {
        GroundCoverView cover;
        cover.outside.water_mm = 0.4;
        cover.outside_rain_mm_per_h = 10;
        splats.ground_cover = cover;
    }
    return splats;
}

// A thin sheet high above the rain, without structure.
std::span<const DrawnVeil> veils_of(const RainView& view) {
    static const std::vector<DrawnVeil> sheet = [] {
        VeilOptions options;
        options.form = VeilForm::stratus;
        options.coverage = 1;
        options.base_m = 3000;
        options.top_m = 3600;
        return std::vector<DrawnVeil>{
            {std::make_shared<VeilSlab>(options, Wind{}, 0, 0, std::nullopt), 0.004, {}}};
    }();
    return view.veil ? std::span(sheet) : std::span<const DrawnVeil>();
}

RenderOptions at_time(const RainView& view) {
    RenderOptions options = view.options;
    options.camera = camera_at(view.options.camera, view.time_s);
    return options;
}

Picture draw(Renderer& renderer, const RainView& view, bool rains = true) {
    std::optional<Rainfall> rain;
    if (rains) rain = Rainfall{view.options, view.weather, view.time_s};
    return renderer.draw_splats(splats_of(view), at_time(view), veils_of(view), std::move(rain));
}

// Numbers that differ by more than 1/255 of white, or of what is brighter.
std::size_t apart(const Picture& a, const Picture& b) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.beauty.size(); ++i)
        count += !(std::abs(a.beauty[i] - b.beauty[i]) <= std::max(1.0f, b.beauty[i]) / 255) ? 1 : 0;
    return count;
}

class RainBackends : public ::testing::Test {
  protected:
    void TearDown() override { test::expect_no_messages(vulkan_); }
    Renderer cpu_{test::validated(Splatting::cpu)}, vulkan_{test::validated(Splatting::vulkan)};
};

TEST_F(RainBackends, Agree) {
    std::size_t drawn = 0;
    for (const RainView& view : views()) {
        const Picture dry = draw(cpu_, view, false), expected = draw(cpu_, view),
                      picture = draw(vulkan_, view);
        const std::size_t count = apart(picture, expected);
        std::size_t rain = 0;  // numbers that it changes
        for (std::size_t i = 0; i < dry.beauty.size(); ++i)
            rain += std::abs(dry.beauty[i] - expected.beauty[i]) > 2e-3f;
        std::printf("%s: %zu of %zu numbers with rain, %zu apart, by up to %.5f\n", view.name.c_str(), rain,
                    dry.beauty.size(), count,
                    double(test::largest_difference(picture.beauty, expected.beauty)));
        EXPECT_GT(rain, dry.beauty.size() / 100) << view.name;
        EXPECT_LE(count, picture.beauty.size() / 1000) << view.name;
        EXPECT_EQ(RendererTestAccess::rains_on_device(vulkan_), ++drawn) << view.name;
        EXPECT_LE(test::largest_difference(picture.transmittance, expected.transmittance), 1e-3f)
            << view.name;
    }
}

// What a sheet leaves of the sun is all that rain against it has: the device's rain loses as much as the processor's.
TEST_F(RainBackends, VeilsShadeRain) {
    for (const std::string name : {"below a veil", "snow below a veil"}) {
        const std::vector<RainView> all = views();
        RainView view = *std::ranges::find(all, name, &RainView::name);
        const auto light = [&](Renderer& renderer) {
            const Picture dry = draw(renderer, view, false), rainy = draw(renderer, view);
            double sum = 0;
            for (std::size_t i = 0; i < dry.beauty.size(); ++i)
                sum += std::max(0.0, double(rainy.beauty[i]) - double(dry.beauty[i]));
            return sum;
        };
        const double shaded = light(vulkan_), by_processor = light(cpu_);
        view.veil = false;
        const double sunlit = light(vulkan_);
        EXPECT_LT(shaded, 0.8 * sunlit) << name;
        EXPECT_NEAR(shaded, by_processor, 0.01 * by_processor) << name;
    }
}

// Whatever was drawn before, and what else is in flight.
TEST_F(RainBackends, HaveTheBitsOfThoseDrawnOneByOne) {
    std::vector<RainView> all;
    const std::vector<RainView> some = views();
    for (std::size_t n = 0; n < some.size(); n += n < 18 ? 3 : 1) all.push_back(some[n]);
    std::vector<Picture> expected(all.size());
    Renderer other(test::validated(Splatting::vulkan));
    for (std::size_t n = all.size(); n-- > 0;) expected[n] = draw(other, all[n]);
    std::vector<PendingPicture> pending;
    for (std::size_t n = 0; n < all.size(); ++n) {
        pending.push_back(vulkan_.begin(splats_of(all[n]), at_time(all[n]), veils_of(all[n]),
                                        Rainfall{all[n].options, all[n].weather, all[n].time_s}));
        EXPECT_TRUE(pending.back().is_pending()) << all[n].name;
        if (n % 7 == 6)
            pending.back() = vulkan_.begin(splats_of(all[n]), at_time(all[n]), veils_of(all[n]),
                                           Rainfall{all[n].options, all[n].weather, all[n].time_s});
        if (n == 0) continue;
        const Picture picture = vulkan_.finish(std::move(pending[n - 1]));
        SCOPED_TRACE(all[n - 1].name);
        test::expect_same_bits(picture, expected[n - 1]);
    }
    test::expect_same_bits(vulkan_.finish(std::move(pending.back())), expected.back());
}

// Rain changes the beauty layer alone.
TEST_F(RainBackends, LeaveTheOtherLayers) {
    RainView view = views()[0];
    view.cloud = true;
    const Picture dry = draw(vulkan_, view, false), rainy = draw(vulkan_, view);
    test::expect_same_bits(rainy.transmittance, dry.transmittance, "transmittance");
    test::expect_same_bits(rainy.depth_m, dry.depth_m, "depth");
    test::expect_same_bits(rainy.shadow, dry.shadow, "shadow");
    test::expect_same_bits(rainy.light, dry.light, "light");
}

// Pictures with more rows than are drawn at once; more particles than are placed at once.
TEST_F(RainBackends, StripsDoNotShow) {
    Renderer limited(test::validated(Splatting::vulkan));
    RendererTestAccess::limit_rain_rows(limited, 37);
    for (const std::size_t n : {0u, 4u}) {
        RainView view = views()[n];
        view.options.precipitation.particles = 30'000;
        test::expect_same_bits(draw(limited, view), draw(vulkan_, view));
    }
    test::expect_no_messages(limited);
}

// From the view on, with wet ground and rain over it, nothing of a picture is on the host until it is complete.
TEST_F(RainBackends, PicturesStayOnTheDevice) {
    std::vector<RainView> all{views()[0], views()[4]};
    all[0].wet = all[1].cloud = true;
    all[1].options.level_of_detail.pixels = 0;  // merged metaballs are others in a larger picture
    for (RainView& view : all) {
        std::uint64_t bytes[2];
        for (const int scale : {1, 4}) {
            view.options.camera.width = 60 * scale;
            view.options.camera.height = 44 * scale;
            draw(vulkan_, view);
            const std::uint64_t before = RendererTestAccess::uploaded_bytes(vulkan_);
            draw(vulkan_, view);
            bytes[scale / 4] = RendererTestAccess::uploaded_bytes(vulkan_) - before;
        }
        EXPECT_EQ(bytes[1], bytes[0]) << view.name;
    }
}

// Rain over parts that are drawn again because their lists were too short.
TEST_F(RainBackends, AreThereWhereListsWereTooShort) {
    RainView view = views()[0];
    const std::vector<Metaball> around = test::ragged_cloud({{-380, 500, 5}, 40, 24, 24, 16});
    Splats splats = splats_of(view);
    splats.metaballs = {around, 1e-4, test::kVoxelNormalisation};
    view.options.camera.width = 240;
    view.options.camera.height = 176;
    const auto draw_in = [&](Renderer& renderer) {
        return renderer.draw_splats(splats, at_time(view), {}, Rainfall{view.options, view.weather, view.time_s});
    };
    const Picture expected = draw_in(cpu_), picture = draw_in(vulkan_);  // its lists have not grown yet
    EXPECT_GT(RendererTestAccess::overflows(vulkan_), 0u);
    EXPECT_EQ(RendererTestAccess::rains_on_device(vulkan_), 1u);
    EXPECT_LE(apart(picture, expected), picture.beauty.size() / 1000);
    test::expect_same_bits(draw_in(vulkan_), picture);
}

// One that cannot be drawn, between pictures in flight of which the first is recorded again.
TEST_F(RainBackends, BadPicturesLeaveTheRainOfOthers) {
    RainView view = views()[0], other = view, bad = view;
    other.time_s = view.time_s + 3;
    bad.options.camera.position_m.x = 2e15;
    const std::vector<Metaball> around = test::ragged_cloud({{-380, 500, 5}, 40, 24, 24, 16});
    Splats splats = splats_of(view);
    splats.metaballs = {around, 1e-4, test::kVoxelNormalisation};
    const auto begin = [&](Renderer& renderer, RainView& of) {
        of.options.camera.width = 240;
        of.options.camera.height = 176;
        return renderer.begin(splats, at_time(of), {}, Rainfall{of.options, of.weather, of.time_s});
    };
    Renderer alone(test::validated(Splatting::vulkan));
    const Picture expected = alone.finish(begin(alone, view)), expected_other = alone.finish(begin(alone, other));
    PendingPicture first = begin(vulkan_, view), second = begin(vulkan_, other);
    EXPECT_THROW(begin(vulkan_, bad), Error);
    PendingPicture third = begin(vulkan_, other);
    test::expect_same_bits(vulkan_.finish(std::move(first)), expected);
    test::expect_same_bits(vulkan_.finish(std::move(second)), expected_other);
    test::expect_same_bits(vulkan_.finish(std::move(third)), expected_other);
    EXPECT_GT(RendererTestAccess::overflows(vulkan_), 0u);
}

// More curtains than shaders know: the processor draws them.
TEST_F(RainBackends, ManyCurtainsAreLeftToTheProcessor) {
    RainView view = views()[4];
    for (int n = 0; n < 70; ++n) {
        RainCurtain more = test::rain_area();
        more.id = std::uint64_t(n);
        more.x_m += 60.0 * n - 2000;
        more.semi_a_m = more.semi_b_m = 40;
        view.weather.curtains.push_back(more);
    }
    const Picture expected = draw(cpu_, view), picture = draw(vulkan_, view);
    EXPECT_EQ(RendererTestAccess::rains_on_device(vulkan_), 0u);
    EXPECT_LE(apart(picture, expected), picture.beauty.size() / 1000);
}

}  // namespace
}  // namespace nephos
