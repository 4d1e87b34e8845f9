// SPDX-License-Identifier: Apache-2.0
// Clouds of one genus that turn into another (T, 5), and billboards that lean with the wind's shear.

#include <algorithm>
#include <cmath>

#include "seeds/coupling.h"
#include "seeds/rain_area.h"
#include "seeds/sky_simulation.h"
#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

// Stratus that becomes stratocumulus, and that cumulus, in one sky.
SkyOptions changing_sky() {
    SkyOptions o = test::small_sky();
    o.models = {test::single_box_model(400, "St"), test::single_box_model(200, "Sc"), test::single_box_model(300, "Cu")};
    o.models[0].genus = Genus::St;
    o.models[1].genus = Genus::Sc;
    o.models[2].genus = Genus::Cu;
    o.skies = {{"all", 0, 60, {{0, 4}}}};
    o.metamorphoses = {{0, 1, {0.2, 0.4}}, {1, 2, {0.5, 0.9}}};
    return o;
}

std::size_t model_of(const SkySimulation& sky, const CloudForm& form) { return sky.shapes()[form.shape].model; }

TEST(Metamorphosis, FollowsTheStateThereAndBack) {
    const SkySimulation sky(changing_sky());
    for (const SkyCloud& cloud : sky.clouds()) {
        EXPECT_EQ(sky.forms(cloud, 0.2).count, 1);
        EXPECT_EQ(sky.forms(cloud, 0.2).of[0], (CloudForm{cloud.shape, 1}));
        EXPECT_EQ(model_of(sky, sky.forms(cloud, 0.45).of[0]), 1u);
        EXPECT_EQ(model_of(sky, sky.forms(cloud, 1).of[0]), 2u) << "the chain is followed";
        EXPECT_EQ(sky.shapes()[sky.forms(cloud, 1).of[0].shape].number, sky.shapes()[cloud.shape].number);
        double before = 0;
        for (double state = 0; state <= 1; state += 0.002) {
            const CloudForms forms = sky.forms(cloud, state);
            double progress = double(model_of(sky, forms.of[0])), phases = forms.of[0].phase;
            if (forms.count == 2) {
                EXPECT_EQ(model_of(sky, forms.of[1]), model_of(sky, forms.of[0]) + 1);
                progress += forms.of[1].phase;
                phases += forms.of[1].phase;
            }
            EXPECT_NEAR(phases, 1, 1e-12);
            EXPECT_GE(progress, before);
            EXPECT_LT(progress - before, 0.05) << "nothing leaps";
            before = progress;
        }
    }
}

// Not all at once: in the middle of the range some have changed, some not, some change.
TEST(Metamorphosis, EachCloudHasItsOwnMoment) {
    SkyOptions options = changing_sky();
    options.skies[0].clouds = 400;
    const SkySimulation sky(options);
    int not_yet = 0, now = 0, done = 0;
    for (const SkyCloud& cloud : sky.clouds()) {
        const CloudForms forms = sky.forms(cloud, 0.3);
        if (forms.count == 2)
            ++now;
        else
            (model_of(sky, forms.of[0]) == 0 ? not_yet : done)++;
    }
    EXPECT_GT(now, 300);  // each changes over half of the range: in its middle nearly all do
    int early = 0;
    for (const SkyCloud& cloud : sky.clouds()) early += sky.forms(cloud, 0.25).count == 2;
    EXPECT_NEAR(early, 200, 4 * std::sqrt(100.0)) << "after a quarter of it half of them have begun";
}

// The automaton gets the boxes of both with the probabilities of their models, the first from its edges inwards, the
// second from its centre outwards.
TEST(Metamorphosis, DrivesTheAutomatonWithBothForms) {
    SkyOptions options = changing_sky();
    options.schedule = {{0, 0.3}};
    options.formation_softness = 4;
    options.models[0].own_centre = true;
    options.models[0].centre = {0.2, 0, 0.5};
    options.models[1].own_centre = true;
    options.models[1].centre = {0.4, 0.01, 0.1};
    const SkySimulation sky(options);
    const std::vector<ActiveEllipsoid> ellipsoids = ellipsoids_of(sky, {});
    std::size_t of_first = 0, of_second = 0;
    double weights = 0;
    for (const ActiveEllipsoid& e : ellipsoids) {
        of_first += e.ellipsoid.centre == options.models[0].centre;
        of_second += e.ellipsoid.centre == options.models[1].centre;
        weights += e.weight;
    }
    EXPECT_EQ(of_first + of_second, ellipsoids.size());
    EXPECT_GT(of_first, 30u);
    EXPECT_GT(of_second, 30u);
    EXPECT_GT(weights, 60) << "half of each is more than one whole";
}

TEST(Metamorphosis, RainBelongsToWhatACloudIsNow) {
    SkyOptions options = changing_sky();
    AttachedRain rain;
    rain.genus = Genus::Cu;
    rain.state = {0, 1};
    rain.intensity_mm_per_h = 5;
    options.schedule = {{0, 0.1}};
    EXPECT_TRUE(attached_areas({&rain, 1}, SkySimulation(options)).empty());
    options.schedule = {{0, 1}};
    EXPECT_EQ(attached_areas({&rain, 1}, SkySimulation(options)).size(), 60u);
}

// What is there by the options and the clouds alone needs nothing in a checkpoint.
TEST(Metamorphosis, ASavedSkyGoesOn) {
    SkyOptions options = changing_sky();
    options.schedule = {{0, 0}, {1000, 1}};
    options.wind = test::constant_wind(20, 5);
    SkySimulation straight(options), resumed(options);
    for (int step = 0; step < 40; ++step) straight.step();
    resumed.restore(straight.save());
    ASSERT_EQ(resumed.clouds().size(), straight.clouds().size());
    for (std::size_t n = 0; n < resumed.clouds().size(); ++n) {
        const CloudForms a = straight.forms(straight.clouds()[n]), b = resumed.forms(resumed.clouds()[n]);
        EXPECT_EQ(a.count, b.count);
        EXPECT_EQ(a.of[0], b.of[0]);
        EXPECT_EQ(a.of[1], b.of[1]);
    }
}

TEST(Metamorphosis, RefusesChainsWithoutEnd) {
    SkyOptions options = changing_sky();
    options.metamorphoses.push_back({2, 0, {0.9, 1}});
    test::expect_error(ErrorCode::usage, "leads back", [&] { SkySimulation sky(options); });
    options = changing_sky();
    options.metamorphoses.push_back({0, 2, {0.9, 1}});
    test::expect_error(ErrorCode::usage, "given twice", [&] { SkySimulation sky(options); });
    options = changing_sky();
    options.metamorphoses[0].state = {0.5, 0.5};
    test::expect_error(ErrorCode::usage, "no width", [&] { SkySimulation sky(options); });
    options = changing_sky();
    options.metamorphoses[0].to = 9;
    test::expect_error(ErrorCode::usage, "does not exist", [&] { SkySimulation sky(options); });
}

TEST(Shear, LeansByTheDifferenceOfTheWinds) {
    SkyOptions options = changing_sky();
    options.base_height_m = {1000, 1000};
    options.wind = {{{0, {{0, {0, 0}}, {2000, {20, -4}}}}}};
    options.shear_s = 100;
    const SkySimulation sky(options);
    const SkyCloud& cloud = sky.clouds().front();
    const CloudForm form = sky.forms(cloud).of[0];
    const double centre = cloud.base_m + sky.shape(cloud).centre_m.z;
    EXPECT_EQ(sky.lean_m(cloud, form, centre, 0), Vec3{});
    const Vec3 lean = sky.lean_m(cloud, form, centre + 200, 0);
    EXPECT_NEAR(lean.x, 200, 1e-9);
    EXPECT_NEAR(lean.y, -40, 1e-9);
    EXPECT_EQ(lean.z, 0);
    // A vortex that begins above the centre turns what is there, and a field of all heights leans nothing.
    options.wind.fields = {{.kind = WindFieldKind::vortex, .radius_m = 1e5, .speed_m_per_s = 50,
                            .bottom_m = centre + 100, .top_m = centre + 1000},
                           {.kind = WindFieldKind::shear_line, .radius_m = 10, .speed_m_per_s = 7, .bottom_m = 0,
                            .top_m = 10'000}};
    const Vec3 middle = sky.position_m(cloud) + sky.shape(cloud).centre_m,
               more = SkySimulation(options).lean_m(cloud, form, centre + 200, 0) - lean;
    EXPECT_NEAR(more.x, 100 * -middle.y * 50 / 1e5, 1e-9);
    EXPECT_NEAR(more.y, 100 * middle.x * 50 / 1e5, 1e-9);
    EXPECT_GT(length(more), 1);
    options.shear_s = 0;
    EXPECT_EQ(SkySimulation(options).lean_m(cloud, form, centre + 200, 0), Vec3{});
}

}  // namespace
}  // namespace nephos
