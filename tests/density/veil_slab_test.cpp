// SPDX-License-Identifier: Apache-2.0

// Veils as functions of place: those of the lattice where all octaves are resolved, with the same mean and cover where
// they are not.

#include "density/veil_slab.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"

namespace nephos {
namespace {

Wind steady_wind() { return {{{0, {{0, {12, -5}}}}}}; }

VeilOptions veil_of(VeilForm form) {
    VeilOptions o;
    o.form = form;
    o.octave_count = 3;
    o.wavelength_m = 1500;
    o.stretch = 2;
    o.displacement = 0.3;
    o.evolution_m_per_s = 2;
    o.direction_deg = 20;
    o.coverage = 0.6;
    o.softness = 0.7;
    o.sheet = 0.05;
    o.base_m = 5000;
    o.top_m = 6200;
    o.soft_base_m = 300;
    o.soft_top_m = 100;
    o.fallstreak_m = 1500;
    o.seed = 77;
    return o;
}

struct Places {
    std::vector<float> x, y, z, footprint;
    void add(double px, double py, double pz, double footprint_m) {
        x.push_back(float(px));
        y.push_back(float(py));
        z.push_back(float(pz));
        footprint.push_back(float(footprint_m));
    }
    std::vector<float> densities(const VeilSlab& slab, const Vec3& base) {
        while (x.size() % VeilSlab::kPointLanes != 0) add(0, 0, 0, 0);
        std::vector<float> out(x.size());
        slab.densities({base, x.data(), y.data(), z.data(), footprint.data(), x.size()}, out.data());
        return out;
    }
};

// A field of points in the middle of the veil, 130 m apart.
Places level_of_points(double footprint_m) {
    Places places;
    for (int j = 0; j < 256; ++j)
        for (int i = 0; i < 256; ++i) places.add(130.0 * i, 130.0 * j, 5500, footprint_m);
    return places;
}

double mean_of(const std::vector<float>& values) {
    double sum = 0;
    for (const float value : values) sum += double(value);
    return sum / double(values.size());
}

TEST(VeilSlab, IsTheVeilOfTheLatticeInEveryForm) {
    const Extent extent{24, 20, 12};
    const Placement placement{{-900, 400, 4950}, 110};
    for (const VeilForm form :
         {VeilForm::cumulus, VeilForm::stratus, VeilForm::cirrus, VeilForm::cirrostratus}) {
        VeilOptions options = veil_of(form);
        options.area = {-3450, 3100, 1500, 1100, 30, 0.8, true};  // the wind carries it into the lattice
        const double time_s = 321;
        const std::vector<float> expected =
            veil_density(options, steady_wind(), extent, placement, time_s).to_dense();
        Places places;
        for (int k = 0; k < extent.z; ++k)
            for (int j = 0; j < extent.y; ++j)
                for (int i = 0; i < extent.x; ++i)
                    places.add((i + 0.5) * 110 - 900, (j + 0.5) * 110, (k + 0.5) * 110 + 4950, 0);
        const std::vector<float> found =
            places.densities(VeilSlab(options, steady_wind(), time_s, 0, {}), {0, 400, 0});
        std::size_t with_cloud = 0;
        for (std::size_t n = 0; n < expected.size(); ++n) {
            EXPECT_NEAR(found[n], expected[n], 2e-3f) << int(form) << " " << n;
            with_cloud += expected[n] > 0;
        }
        EXPECT_GT(with_cloud, expected.size() / 10);
    }
}

TEST(VeilSlab, CoarseSamplesKeepTheMean) {
    for (const VeilForm form :
         {VeilForm::cumulus, VeilForm::stratus, VeilForm::cirrus, VeilForm::cirrostratus}) {
        const VeilSlab slab(veil_of(form), steady_wind(), 0, 3, {});
        const std::vector<float> fine = level_of_points(0).densities(slab, {}),
                                 middle = level_of_points(400).densities(slab, {}),
                                 coarse = level_of_points(1e5).densities(slab, {});
        EXPECT_NEAR(mean_of(middle), mean_of(fine), 0.03) << int(form);
        EXPECT_NEAR(mean_of(coarse), mean_of(fine), 0.05) << int(form);
        // What is not resolved at all is the same everywhere.
        EXPECT_NEAR(coarse.front(), coarse.back(), 1e-6f);
    }
}

TEST(VeilSlab, FinerOctavesKeepTheCover) {
    VeilOptions options = veil_of(VeilForm::stratus);
    options.sheet = 0;
    options.soft_base_m = options.soft_top_m = 0;
    const auto cover = [&](int finer) {
        double covered = 0;
        const std::vector<float> values =
            level_of_points(0).densities(VeilSlab(options, steady_wind(), 0, finer, {}), {});
        for (const float value : values) covered += value > 0;
        return covered / double(values.size());
    };
    EXPECT_NEAR(cover(0), options.coverage, 0.06);
    EXPECT_NEAR(cover(4), cover(0), 0.03);
    EXPECT_LT(VeilSlab(options, steady_wind(), 0, 4, {}).finest_m(),
              VeilSlab(options, steady_wind(), 0, 0, {}).finest_m() / 15);
}

// Finer octaves go on as the last two of a list do: threads of one length vary along the fibres no faster than the
// octaves of the list, and across them as fast as those by powers do.
TEST(VeilSlab, FinerOctavesOfFibresAreThreads) {
    VeilOptions options = veil_of(VeilForm::stratus);
    options.fallstreak_m = 0;
    options.direction_deg = 0;
    options.softness = options.coverage = 1;
    const auto roughness = [&](const Vec3& last_m, const Vec2& step) {
        options.octaves = {{.wavelength_m = {4000, 2000, 4000}, .weight = 1}, {.wavelength_m = last_m, .weight = 0.8}};
        const VeilSlab slab(options, steady_wind(), 0, 3, {});
        Places here = level_of_points(0), there;
        for (std::size_t n = 0; n < here.x.size(); ++n)
            there.add(double(here.x[n]) + step.x, double(here.y[n]) + step.y, double(here.z[n]), 0);
        const std::vector<float> a = here.densities(slab, {}), b = there.densities(slab, {});
        double sum = 0;
        for (std::size_t n = 0; n < a.size(); ++n) sum += double(std::abs(b[n] - a[n]));
        return sum / double(a.size());
    };
    const Vec3 threads{4000, 1000, 4000}, grains{2000, 1000, 2000};
    const Vec2 along{60, 0}, across{0, 60};
    EXPECT_LT(roughness(threads, along), 0.4 * roughness(grains, along));
    EXPECT_NEAR(roughness(threads, across) / roughness(grains, across), 1, 0.25);
}

TEST(VeilSlab, EndsAtItsSides) {
    VeilOptions options = veil_of(VeilForm::stratus);
    options.sheet = 1;
    options.coverage = 1;
    const VeilSlab slab(options, steady_wind(), 0, 0, VeilSides{{0, 0}, {1000, 2000}, 200});
    Places places;
    places.add(500, 1000, 5600, 0);  // inside
    places.add(100, 1000, 5600, 0);  // half of the margin
    places.add(-1, 1000, 5600, 0);   // outside
    places.add(500, 2001, 5600, 0);
    places.add(500, 1000, 4999, 0);  // below
    const std::vector<float> found = places.densities(slab, {});
    EXPECT_FLOAT_EQ(found[0], 1);
    EXPECT_NEAR(found[1], 0.5f, 1e-4f);
    EXPECT_EQ(found[2], 0);
    EXPECT_EQ(found[3], 0);
    EXPECT_EQ(found[4], 0);
}

// As many octaves as there can be.
TEST(VeilSlab, HasRoomForAllOctaves) {
    for (const VeilForm form : {VeilForm::cumulus, VeilForm::cirrus}) {
        VeilOptions options = veil_of(form);
        options.octave_count = 12;
        const VeilSlab slab(options, steady_wind(), 0, VeilSlab::kMostFinerOctaves, {});
        EXPECT_NEAR(slab.finest_m(), options.wavelength_m / std::pow(options.lacunarity, 23),
                    1e-6 * slab.finest_m());
        const std::vector<float> found = level_of_points(0).densities(slab, {});
        for (const float value : found) ASSERT_TRUE(value >= 0 && value <= 1) << value;
        EXPECT_EQ(found, level_of_points(0).densities(
                             VeilSlab(options, steady_wind(), 0, VeilSlab::kMostFinerOctaves, {}), {}));
    }
}

// In a tile: finer octaves as far as they fit, and the same everywhere a period on, however far that is.
TEST(VeilSlab, RepeatsWithTheTile) {
    VeilOptions options = veil_of(VeilForm::cirrus);
    options.period_m = {30'000, 20'000};
    options.displacement = 0.1;
    const VeilSlab slab(options, steady_wind(), 50, VeilSlab::kMostFinerOctaves, {});
    EXPECT_GT(slab.finest_m(), 10) << "octaves with more cells are left out";
    Places here, there, far;
    for (int n = 0; n < 1024; ++n) {
        const double x = 29.0 * n, y = 7000 + 11.0 * n;
        here.add(x, y, 5600, 5);
        there.add(x + 30'000, y - 20'000, 5600, 5);
        far.add(x - 300'000, y + 380'000, 5600, 5);
    }
    const std::vector<float> expected = here.densities(slab, {});
    EXPECT_GT(mean_of(expected), 0.01);
    const std::vector<float> next = there.densities(slab, {}), last = far.densities(slab, {});
    for (std::size_t n = 0; n < expected.size(); ++n) {
        EXPECT_NEAR(next[n], expected[n], 0.01f) << n;
        EXPECT_NEAR(last[n], expected[n], 0.1f) << n;  // offsets are rounded to 0.03 m there
    }
}

TEST(VeilSlab, RefusesWhatIsOutOfRange) {
    const auto text = [](int finer, double time_s) -> std::string {
        try {
            VeilSlab(veil_of(VeilForm::stratus), steady_wind(), time_s, finer, {});
        } catch (const Error& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_EQ(text(-1, 0), "`finer_octaves` of a veil is -1, expected 0 to 12");
    EXPECT_EQ(text(13, 0), "`finer_octaves` of a veil is 13, expected 0 to 12");
    EXPECT_EQ(text(0, std::numeric_limits<double>::infinity()), "the time of a veil is beyond 1e9 s");
}

}  // namespace
}  // namespace nephos
