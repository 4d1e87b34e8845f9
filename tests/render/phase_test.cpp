// SPDX-License-Identifier: Apache-2.0
// Phase functions against their integrals, limits and numbers worked out by hand; the table that pictures
// are drawn with against the formulas that it is made of.

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "render/frame/scattering_table.h"
#include "render/options/phase_function.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;

// Functions of many parameters, and what to call them.
struct Named {
    std::string name;
    PhaseFunction function;
};

std::vector<Named> many_functions() {
    std::vector<Named> all{{"isotropic", {Phase::isotropic}}, {"rayleigh", {Phase::rayleigh}}};
    for (const double g : {-0.99, -0.6, -0.1, 0.0, 0.3, 0.5, 0.85, 0.95, 0.99}) {
        all.push_back({"henyey_greenstein " + std::to_string(g), {Phase::henyey_greenstein, g}});
        all.push_back({"cornette_shanks " + std::to_string(g), {Phase::cornette_shanks, g}});
    }
    for (const double d : {5.0, 7.5, 10.0, 20.0, 35.0, 50.0})
        all.push_back({"hg_draine " + std::to_string(d), {Phase::hg_draine, 0, d}});
    return all;
}

// Integral over the sphere of value(cos theta). With 1 -+ cos = 2 t^6 the steps are small where lobes are.
template <class Value>
double over_sphere(const Value& value) {
    constexpr int kSteps = 20000;
    double sum = 0;
    for (const double side : {1.0, -1.0}) {
        const double end = std::pow(0.5, 1.0 / 6);
        for (int i = 0; i < kSteps; ++i) {
            const double t = (i + 0.5) * end / kSteps;
            sum += 12 * std::pow(t, 5) * value(side * (1 - 2 * std::pow(t, 6))) * end / kSteps;
        }
    }
    return 2 * kPi * sum;
}

// All that is scattered goes somewhere, however blunt the function is made.
TEST(Phase, IntegratesToOne) {
    for (const auto& [name, function] : many_functions())
        for (const double directed : {1.0, 0.5, 0.125, 0.0})
            EXPECT_NEAR(over_sphere([&](double c) { return phase(function, c, directed); }), 1, 1e-6)
                << name << ", directed " << directed;
}

// Also fixes the sign: forward is g > 0.
TEST(Phase, MeanCosineIsTheClosedForm) {
    for (const auto& [name, function] : many_functions())
        EXPECT_NEAR(over_sphere([&](double c) { return c * phase(function, c); }), mean_cosine(function),
                    1e-6)
            << name;
    EXPECT_EQ(mean_cosine({Phase::henyey_greenstein, 0.7}), 0.7);
    EXPECT_GT(henyey_greenstein(1, 0.5), henyey_greenstein(-1, 0.5));
}

// g = 1/2: 3/4 over 4 pi times (5/4 - cos)^1.5, which is 1/8 straight on, 27/8 back.
TEST(Phase, ValuesWorkedOutByHand) {
    EXPECT_NEAR(henyey_greenstein(1, 0.5), 6 / (4 * kPi), 1e-12);
    EXPECT_NEAR(henyey_greenstein(-1, 0.5), 2.0 / 9 / (4 * kPi), 1e-12);
    EXPECT_NEAR(henyey_greenstein(0.25, 0.5), 0.75 / (4 * kPi), 1e-12);
    EXPECT_NEAR(rayleigh(0), 0.75 / (4 * kPi), 1e-12);
    EXPECT_NEAR(rayleigh(-1), 1.5 / (4 * kPi), 1e-12);
    // 3 (1 - 1/4) / (2 (2 + 1/4)) = 1/2, times 2 / (1/8) straight on and 17/16 at 1/4.
    EXPECT_NEAR(draine(1, 0.5, 1), 8 / (4 * kPi), 1e-12);
    EXPECT_NEAR(draine(0.25, 0.5, 1), 17.0 / 32 / (4 * kPi), 1e-12);
    // alpha = 2: (1 + 2 cos^2) / (1 + 2 (3/2) / 3) = 1/2 sideways, where the lobe is 3/4 / 1.25^1.5.
    EXPECT_NEAR(draine(0, 0.5, 2), 0.5 * 0.75 / std::pow(1.25, 1.5) / (4 * kPi), 1e-12);
}

TEST(Phase, OneIsTheLimitOfAnother) {
    for (double c = -1; c <= 1; c += 0.125) {
        EXPECT_NEAR(henyey_greenstein(c, 0), 1 / (4 * kPi), 1e-15);
        EXPECT_NEAR(draine(c, 0, 1), rayleigh(c), 1e-15);
        EXPECT_NEAR(draine(c, 0.8, 0), henyey_greenstein(c, 0.8), 1e-15);
        EXPECT_NEAR(draine(c, 0.8, 1),
                    3 * 0.36 / (8 * kPi * 2.64) * (1 + c * c) / std::pow(1.64 - 1.6 * c, 1.5), 1e-13);
        EXPECT_NEAR(henyey_greenstein(c, 0.6), henyey_greenstein(-c, -0.6), 1e-14);
    }
}

// The fit for a diameter of 10 micrometres, worked out with a calculator from its formulas: exponents
// -0.0990567 / 8.32846, -2.20679 / 13.91029 - 0.428934, 3.62489 - 8.29288 / 15.52825 and
// -0.599085 / 9.358417 - 0.665888.
TEST(Phase, FitOfDroplets) {
    const HgDraine fit = hg_draine_fit(10);
    EXPECT_NEAR(fit.g, 0.988177, 1e-5);
    EXPECT_NEAR(fit.draine_g, 0.555667, 1e-5);
    EXPECT_NEAR(fit.alpha, 21.9955, 1e-3);
    EXPECT_NEAR(fit.draine_fraction, 0.481955, 1e-5);
    // Mie's asymmetry of cloud droplets is about 0.85 to 0.88.
    for (double d = 5; d <= 50; d += 5) {
        const double g = mean_cosine({Phase::hg_draine, 0, d});
        EXPECT_GT(g, 0.8) << d;
        EXPECT_LT(g, 0.9) << d;
    }
}

TEST(ScatteringTable, TwoDepthsFitIntoOneNumber) {
    for (const float once : {0.0f, 1e-3f, 0.37f, 12.0f, 64.0f})
        for (const float often : {0.0f, 0.02f, 5.0f, 4095.0f, 1e6f}) {
            const float both = two_depths({once, often}), most = std::min(often, shader::kMaxSunDepth);
            EXPECT_TRUE(std::isnormal(both) && both < 0);
            EXPECT_NEAR(depths_of(both).once, once, 5e-4f * once + 1e-7f);
            EXPECT_NEAR(depths_of(both).often, most, 5e-4f * most + 1e-7f);
        }
    EXPECT_EQ(depths_of(0.25f).once, 0.25f);
    EXPECT_EQ(depths_of(0.25f).often, 0.25f);
}

// The nodes of the table are those of its coordinates, and no angle or depth leaves it.
TEST(ScatteringTable, CoordinatesStayInside) {
    EXPECT_EQ(shader::scatter_column(1), 0.0f);
    EXPECT_EQ(shader::scatter_column(1.0001f), 0.0f);
    EXPECT_EQ(shader::scatter_column(0), float(shader::kScatterAngles - 1) / 2);
    EXPECT_EQ(shader::scatter_column(-1), float(shader::kScatterAngles - 1));
    EXPECT_EQ(shader::scatter_row(0), 0.0f);
    EXPECT_NEAR(shader::scatter_row(shader::kMaxSunDepth), float(shader::kScatterDepths - 1), 1e-3);
    EXPECT_EQ(shader::scatter_row(1e30f), float(shader::kScatterDepths - 1));
}

// What is drawn is the phase function, at every angle.
TEST(ScatteringTable, ScattersOnceByThePhaseFunction) {
    for (const auto& [name, function] : many_functions()) {
        CloudLight light;
        light.phase = function;
        const std::vector<float> table = scattering_table(light);
        // The aureole of large droplets is a tenth of a degree wide.
        const bool peaked = function.kind == Phase::hg_draine || std::abs(function.g) > 0.96;
        double worst = 0;
        for (double angle = 0; angle <= kPi; angle += 0.0004) {
            const double exact = kPi * phase(function, std::cos(angle));
            worst =
                std::max(worst, std::abs(double(scattered_once(table, float(std::cos(angle)))) / exact - 1));
        }
        EXPECT_LT(worst, peaked ? 0.02 : 0.003) << name;
    }
}

double octaves_by_hand(const CloudLight& light, double cosine, double depth) {
    double sum = 0;
    for (int o = 1; o < light.octaves.count; ++o)
        sum += std::pow(light.octaves.scattering * light.albedo, o) *
               std::exp(-std::pow(light.octaves.extinction, o) * depth) *
               phase(light.phase, cosine, std::pow(light.octaves.asymmetry, o));
    return light.multiple_scattering * kPi * sum;
}

TEST(ScatteringTable, ScattersOftenByOctaves) {
    for (const auto& [name, function] : many_functions()) {
        CloudLight light;
        light.phase = function;
        light.multiple = MultipleScattering::octaves;
        light.octaves = {8, 0.7, 0.6, 0.5};
        light.multiple_scattering = 1.5;
        light.albedo = 0.9;
        const std::vector<float> table = scattering_table(light);
        for (double angle = 0; angle <= kPi; angle += 0.03) {
            const double cosine = std::cos(angle), most = octaves_by_hand(light, cosine, 0);
            for (double depth = 0; depth < 3000; depth = 1.3 * depth + 0.05)
                ASSERT_NEAR(double(scattered_often(table, float(cosine), float(depth))),
                            octaves_by_hand(light, cosine, depth), 0.003 * most)
                    << name << ", angle " << angle << ", depth " << depth;
        }
    }
}

TEST(ScatteringTable, OneOctaveIsSingleScattering) {
    CloudLight light;
    light.multiple = MultipleScattering::octaves;
    light.octaves.count = 1;
    for (const double depth : {0.0, 1.0, 100.0})
        EXPECT_EQ(scattered_often(scattering_table(light), 0.3f, float(depth)), 0.0f);
}

// Diffusion, and T's absorption, which has all light fall off to nothing.
TEST(ScatteringTable, ScattersOftenByDiffusion) {
    CloudLight light;
    light.multiple = MultipleScattering::diffusion;
    light.phase = {.kind = Phase::henyey_greenstein, .g = 0.5};
    for (const float depth : {0.0f, 0.2f, 1.0f, 7.0f, 300.0f}) {
        light.lighting = Lighting::light_pass;
        EXPECT_NEAR(scattered_often(scattering_table(light), -0.2f, depth), 1 / (1 + 0.75f * depth), 0.002f);
        light.lighting = Lighting::cfa;
        EXPECT_NEAR(scattered_often(scattering_table(light), -0.2f, depth), std::exp(-depth), 0.002f);
    }
}

TEST(ScatteringTable, SunDepthsAreFinite) {
    std::vector<float> light{1.0f, 0.5f, 0.0f};
    to_sun_depths(light);
    EXPECT_EQ(light[0], 0.0f);
    EXPECT_NEAR(light[1], std::log(2.0f), 1e-6f);
    EXPECT_EQ(light[2], shader::kMaxSunDepth);
    EXPECT_EQ(std::exp(-light[2]), 0.0f);
}

}  // namespace
}  // namespace nephos
