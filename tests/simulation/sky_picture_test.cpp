// SPDX-License-Identifier: Apache-2.0
// From a sky to its picture: what is listed and how it is lit, what is left out, and the debug view.

#include "simulation/sky_picture.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/error.h"
#include "simulation/debug_view.h"

namespace nephos {
namespace {

BaseModel tower() {
    BaseModel model;
    model.name = "tower";
    model.light_distance_m = 400;
    Seed seed;
    seed.size_m = {200, 200, 100};
    seed.position_m = {0, 0, 100};
    seed.billboards = {3, 5};
    seed.billboard_width_m = {200, 300};
    seed.billboard_height_m = {150, 250};
    seed.texture = BillboardTexture::dense;
    seed.roots = {
        {.pitch_deg = 60, .yaw_deg = 30, .seeds_start = 2, .seeds_end = 4, .reproductions = {2, 4}}};
    model.seeds = {seed};
    return model;
}

SkyOptions sky_of(int clouds) {
    SkyOptions options;
    options.world = {-5000, -5000, 5000, 5000};
    options.models = {tower()};
    options.skies = {{"only", 0, clouds, {{0, 6}}}};
    options.wind = {{{0, {{0, {10, 4}}}}}};
    options.formation_s = 60;
    options.dissolution_s = 60;
    return options;
}

RenderOptions from_the_edge() {
    RenderOptions options;
    options.camera.position_m = {0, -6000, 300};
    options.camera.target_m = {0, 0, 1200};
    options.camera.width = 160;
    options.camera.height = 120;
    options.shadow_map_size = 32;
    return options;
}

DrawnClouds listed(SkyBillboards& billboards, const SkySimulation& sky, const RenderOptions& options,
                   const std::optional<Flash>& flash = {}, bool cull = true) {
    DrawnClouds drawn;
    billboards.append(sky, sky.clouds(), options, flash, drawn, cull);
    return drawn;
}

// Each billboard stands where its box has it, moved with the cloud, and has the absorption that
// light_absorption.h computes for the box.
TEST(SkyBillboards, StandInTheirBoxesAndAbsorbWhatTheirBoxesDo) {
    SkySimulation sky(sky_of(12));
    for (int step = 0; step < 7; ++step) sky.step();
    SkyBillboards billboards;
    RenderOptions options = from_the_edge();
    const Flash flash{{100, 200, 600}, {1, 1, 1}, 3};
    const DrawnClouds drawn = listed(billboards, sky, options, flash, false);
    ASSERT_EQ(drawn.clouds.size(), sky.clouds().size());
    std::size_t at = 0;
    for (std::size_t c = 0; c < sky.clouds().size(); ++c) {
        const SkyCloud& cloud = sky.clouds()[c];
        const Cloud& shape = sky.shape(cloud);
        const Vec3 place = sky.position_m(cloud);
        EXPECT_DOUBLE_EQ(drawn.clouds[c].centre_m.x, shape.centre_m.x + place.x);
        EXPECT_LT(drawn.clouds[c].base_m, drawn.clouds[c].top_m);
        std::vector<double> sun(shape.boxes.size()), lightning(shape.boxes.size()), weights;
        for (const SeedBox& box : shape.boxes)
            weights.push_back(phase_weight(box.distance, cloud.phase, sky.options().formation_softness));
        absorb_light(shape, place, light_of(options.sun), sun, weights);
        absorb_light(shape, place, light_of(flash), lightning, weights);
        for (std::size_t b = 0; b < shape.boxes.size(); ++b) {
            const SeedBox& box = shape.boxes[b];
            const double weight = phase_weight(box.distance, cloud.phase, sky.options().formation_softness);
            if (weight <= 0) continue;
            for (int i = 0; i < box.billboards; ++i, ++at) {
                ASSERT_LT(at, drawn.billboards.size());
                const CloudBillboard& billboard = drawn.billboards[at];
                EXPECT_EQ(billboard.cloud, c);
                EXPECT_LE(std::abs(billboard.centre_m.x - place.x - box.centre_m.x),
                          0.5 * box.size_m.x + 1e-6);
                EXPECT_LE(std::abs(billboard.centre_m.z - place.z - box.centre_m.z),
                          0.5 * box.size_m.z + 1e-6);
                EXPECT_EQ(billboard.sun_absorbed, float(sun[b]));
                EXPECT_EQ(billboard.flash_absorbed, float(lightning[b]));
                EXPECT_EQ(billboard.opacity, float(weight));
                EXPECT_EQ(billboard.texture, BillboardTexture::dense);
            }
        }
    }
    EXPECT_EQ(at, drawn.billboards.size());
}

// What the frustum leaves out cannot be seen: the same picture without, bit for bit, from inside of the sky.
void expect_culling_to_change_nothing(const SkySimulation& sky) {
    Renderer renderer{DeviceOptions{.device = {}, .validation = true}};
    for (const Vec3 target : {Vec3{0, 0, 1200}, Vec3{500, -300, 900}, Vec3{-4000, 1000, 4000}}) {
        RenderOptions options = from_the_edge();
        options.camera.position_m = {300, -1200, 700};
        options.camera.target_m = target;
        SkyBillboards culled, all;
        const DrawnClouds some = listed(culled, sky, options), every = listed(all, sky, options, {}, false);
        EXPECT_LT(some.clouds.size(), every.clouds.size());
        EXPECT_GT(some.clouds.size(), 0u);
        EXPECT_EQ(some.billboards.size() + some.unseen.size(), every.billboards.size());
        EXPECT_TRUE(every.unseen.empty());
        Splats part{some.clouds, some.billboards, {}, {}}, whole{every.clouds, every.billboards, {}, {}};
        part.unseen = some.unseen;
        const Picture a = renderer.draw_splats(part, options);
        const Picture b = renderer.draw_splats(whole, options);
        EXPECT_EQ(a.beauty, b.beauty);
        EXPECT_EQ(a.transmittance, b.transmittance);
    }
    EXPECT_TRUE(renderer.validation_messages().empty());
}

TEST(SkyBillboards, CullingChangesNoBitOfAPicture) { expect_culling_to_change_nothing(SkySimulation(sky_of(150))); }

// Billboards that a field of the wind takes far from their clouds.
TEST(SkyBillboards, CullingChangesNoBitOfShearedClouds) {
    SkyOptions options = sky_of(150);
    options.shear_s = 300;
    options.wind.fields = {{.kind = WindFieldKind::shear_line, .radius_m = 1, .speed_m_per_s = 8, .direction_deg = 90,
                            .bottom_m = 1200, .top_m = 9000}};
    expect_culling_to_change_nothing(SkySimulation(options));
}

// In a film with a bound, a moving sun changes at most that many clouds a frame, and each cloud in its turn;
// a frame that is listed alone has the bits that it has after all those before it.
TEST(SkyBillboards, ABoundedNumberOfCloudsIsLitAnewInAFrame) {
    const SkySimulation sky(sky_of(10));
    RenderOptions options = from_the_edge();
    options.light.cfa_clouds_per_frame = 4;
    FrameOptions frames;
    frames.per_second = 1;
    frames.time_scale = 120;
    Sun sun = options.sun;
    sun.date = "2026-06-21";
    sun.time = "16:00";
    sun.latitude_deg = 50;
    sun.moves = true;
    const auto absorption = [&](SkyBillboards& billboards, int frame, std::size_t* computed = nullptr) {
        const FilmFrame film{frame, &frames, &sun};
        options.sun = sun_at(sun, frame_time_s(frames, frame));
        DrawnClouds drawn;
        const std::size_t anew = billboards.append(sky, sky.clouds(), options, {}, drawn, false, {}, film);
        if (computed != nullptr) *computed = anew;
        std::vector<float> result;
        for (const CloudBillboard& billboard : drawn.billboards) result.push_back(billboard.sun_absorbed);
        return result;
    };
    SkyBillboards billboards;
    std::size_t computed = 0, turns = 0;
    std::vector<float> before;
    for (int frame = 0; frame < 12; ++frame) {
        const std::vector<float> in_order = absorption(billboards, frame, &computed);
        if (frame == 0) {
            EXPECT_EQ(computed, 10u);
        } else {
            EXPECT_LE(computed, 4u);
            EXPECT_EQ(computed > 0, in_order != before) << frame;
            turns += computed;
        }
        SkyBillboards fresh;
        EXPECT_EQ(absorption(fresh, frame), in_order) << "frame " << frame << " alone";
        EXPECT_EQ(absorption(billboards, frame, &computed), in_order);
        EXPECT_EQ(computed, 0u) << "the same frame again";
        before = in_order;
    }
    EXPECT_GE(turns, 20u);
    // Without a bound all clouds have the present sun.
    options.light.cfa_clouds_per_frame = 0;
    SkyBillboards fresh;
    EXPECT_NE(absorption(fresh, 11, &computed), before);
    EXPECT_EQ(absorption(billboards, 11), absorption(fresh, 11));
}

// The same sky gives the same picture, whatever was drawn before; lightning at its time only.
TEST(SkyPainter, DrawsTheSameTwiceAndLightningInItsTime) {
    const SkySimulation sky(sky_of(60));
    const SkyLayer layer{&sky, sky.clouds()};
    RenderOptions options = from_the_edge();
    options.sun.elevation_deg = -10;
    options.lightning = {{{0, 0, 800}, 5, 0.5, {0.7, 0.8, 1}, 10}};
    Renderer renderer{DeviceOptions{.device = {}, .validation = true}};
    SkyPainter painter, other;
    const auto mean = [](const Picture& picture) {
        double sum = 0;
        for (const float value : picture.beauty) sum += double(value);
        return sum / double(picture.beauty.size());
    };
    const Picture dark = painter.draw(renderer, {}, {&layer, 1}, options, 4.9);
    const Picture bright = painter.draw(renderer, {}, {&layer, 1}, options, 5);
    EXPECT_GT(mean(bright), 2 * mean(dark));
    EXPECT_EQ(painter.draw(renderer, {}, {&layer, 1}, options, 5.6).beauty, dark.beauty);
    EXPECT_EQ(other.draw(renderer, {}, {&layer, 1}, options, 5).beauty, bright.beauty);
    EXPECT_TRUE(renderer.validation_messages().empty());
}

// T's sky in fog, in every way of drawing.
TEST(SkyPainter, BackendsAgree) {
    SkySimulation sky(sky_of(60));
    for (int step = 0; step < 7; ++step) sky.step();
    const SkyLayer layer{&sky, sky.clouds()};
    for (const double fog : {0.0, 2e-4}) {
        RenderOptions options = from_the_edge();
        options.fog.extinction_per_m = fog;
        options.fog.height_m = 800;
        std::vector<Picture> pictures;
        for (const Splatting way : {Splatting::blended, Splatting::cpu, Splatting::vulkan}) {
            Renderer renderer(DeviceOptions{.splatting = way});
            pictures.push_back(SkyPainter().draw(renderer, {}, {&layer, 1}, options, 0));
        }
        EXPECT_LT(*std::ranges::min_element(pictures[0].transmittance), 0.1f);
        for (const Picture& picture : pictures)
            for (std::size_t i = 0; i < picture.beauty.size(); ++i)
                ASSERT_NEAR(picture.beauty[i], pictures[0].beauty[i], 1.0f / 255.0f) << i;
    }
}

// A sun with a date moves with the time of the picture, and with it the physical sky and its light on
// billboards; one that does not move stays.
TEST(SkyPainter, MovesTheSunWithTime) {
    const SkySimulation sky(sky_of(60));
    const SkyLayer layer{&sky, sky.clouds()};
    RenderOptions options = from_the_edge();
    options.atmosphere.model = AirModel::physical;
    options.sun.date = "2026-06-21";
    options.sun.time = "10:00";
    options.sun.latitude_deg = 50;
    Renderer renderer{DeviceOptions{.device = {}, .validation = true}};
    SkyPainter painter;
    const auto at = [&](double time_s) {
        return painter.draw(renderer, {}, {&layer, 1}, options, time_s).beauty;
    };
    const std::vector<float> morning = at(0);
    EXPECT_EQ(at(7200), morning);
    options.sun.moves = true;
    EXPECT_EQ(at(0), morning);
    const std::vector<float> noon = at(7200);
    EXPECT_NE(noon, morning);
    options.sun = sun_at(options.sun, 7200);
    EXPECT_NEAR(options.sun.elevation_deg, 63.4, 0.3);
    EXPECT_EQ(at(0), noon);
    for (const std::string& message : renderer.validation_messages()) ADD_FAILURE() << message;
}

// Twelve edges a box, an axis for each direction, four strokes a root and more; the red parts of the rays are
// as long as what the absorption counts where boxes do not overlap.
TEST(DebugView, ShowsBoxesAxesRootsAndRays) {
    SkyOptions sky_options = sky_of(1);
    Seed far = sky_options.models[0].seeds[0];
    sky_options.models[0].seeds[0].roots.clear();
    far.roots.clear();
    far.position_m.z += 300;
    sky_options.models[0].seeds.push_back(far);
    sky_options.models[0].seeds[0].roots = {{.seeds_start = 0, .seeds_end = 0, .reproductions = {0, 0}}};
    const SkySimulation sky(sky_options);
    RenderOptions options = from_the_edge();
    options.sun.elevation_deg = 90;
    const auto lines = [&](DebugView view) {
        options.debug_view = view;
        return debug_lines(sky, sky.clouds(), options, light_of(options.sun));
    };
    EXPECT_TRUE(lines({}).empty());
    EXPECT_EQ(lines({.boxes = true}).size(), 24u);
    EXPECT_EQ(lines({.axes = true}).size(), 3u);
    EXPECT_EQ(lines({.roots = true}).size(), 5u);
    double red = 0;
    for (const WorldLine& line : lines({.rays = true}))
        if (line.colour[0] > 0.5 && line.colour[1] < 0.5) red += line.to_m.z - line.from_m.z;
    // Half of its own box each, and for the lower box the whole upper one.
    EXPECT_NEAR(red, 50 + 50 + 100, 1e-6);
    double absorbed = 0;
    for (const double share : absorbed_light(sky.shape(sky.clouds()[0]), {}, light_of(options.sun)))
        absorbed += 400 * share;
    EXPECT_NEAR(red, absorbed, 1e-6);
}

}  // namespace
}  // namespace nephos
