// SPDX-License-Identifier: Apache-2.0

// Mie's solution against published numbers, and fogbow and glory of cloud droplets: where they are, in which order their colours
// stand, and that they keep the light.

#include "render/options/droplet_phase.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "render/frame/scattering_table.h"
#include "render/options/mie_scattering.h"
#include "render/options/phase_function.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi, kDegree = kPi / 180;
using Complex = std::complex<double>;

struct Published {
    Complex index;
    double size, extinction, scattering, asymmetry;
};

// Wiscombe 1979, Mie scattering calculations, NCAR/TN-140: cases of his program MIEV0, of large and small spheres that absorb
// and do not; and the sample of Bohren and Huffman's appendix A (radius 0.525 at a wavelength of 0.6328).
TEST(MieScattering, HasThePublishedEfficiencies) {
    const Published all[] = {{{0.75, 0}, 10, 2.232265, 2.232265, 0.896473},
                             {{0.75, 0}, 1000, 1.997908, 1.997908, 0.844944},
                             {{1.33, 1e-5}, 1, 0.0939520, 0.0939233, 0.184517},
                             {{1.33, 1e-5}, 100, 2.101321, 2.096594, 0.868959},
                             {{1.33, 1e-5}, 10000, 2.004089, 1.723857, 0.907840},
                             {{1.5, 1}, 1, 2.336321, 0.6634538, 0.192136},
                             {{1.5, 1}, 100, 2.097502, 1.283697, 0.850252},
                             {{1.5, 1}, 10000, 2.004368, 1.236575, 0.846310},
                             {{10, 10}, 1, 2.532993, 2.049405, -0.110664},
                             {{10, 10}, 100, 2.071124, 1.836785, 0.556215},
                             {1.55, 2 * kPi * 0.525 / 0.6328, 3.10543, 3.10543, 0.63314}};
    for (const Published& each : all) {
        const MieEfficiencies found = mie_efficiencies(mie_coefficients(each.size, each.index));
        const double tolerance = each.index == 1.55 ? 1e-5 : 1e-6;
        EXPECT_NEAR(found.extinction, each.extinction, tolerance) << each.size;
        EXPECT_NEAR(found.scattering, each.scattering, tolerance) << each.size;
        EXPECT_NEAR(found.asymmetry, each.asymmetry, tolerance) << each.size;
    }
}

// S1 and S2 by their definition, with the angular functions by their recurrences: half of |S1|^2 + |S2|^2.
double direct_intensity(const MieCoefficients& sphere, double cosine) {
    Complex first = 0, second = 0;
    double before = 0, pi = 1;
    for (std::size_t i = 0; i < sphere.a.size(); ++i) {
        const auto n = double(i + 1);
        const double tau = n * cosine * pi - (n + 1) * before;
        const double weight = (2 * n + 1) / (n * (n + 1));
        first += weight * (sphere.a[i] * pi + sphere.b[i] * tau);
        second += weight * (sphere.a[i] * tau + sphere.b[i] * pi);
        const double next = ((2 * n + 1) * cosine * pi - (n + 1) * before) / n;
        before = pi;
        pi = next;
    }
    return 0.5 * (std::norm(first) + std::norm(second));
}

// The intensity over all directions is what the efficiency says, and its mean cosine the asymmetry.
TEST(MieScattering, AnglesHoldTheWholeLight) {
    std::vector<double> cosines;
    constexpr int kSteps = 20'000;
    for (int i = 0; i < kSteps; ++i) cosines.push_back(-1 + 2 * (i + 0.5) / kSteps);
    for (const double x : {0.3, 7.0, 40.0}) {
        const MieCoefficients sphere = mie_coefficients(x, 1.334);
        const MieEfficiencies whole = mie_efficiencies(sphere);
        const MieAngles angles(cosines, sphere.a.size() + 3);
        std::vector<double> intensities(cosines.size(), 1.0);
        angles.add_intensities(sphere, 2, intensities);
        double sum = 0, along = 0;
        for (std::size_t i = 0; i < cosines.size(); ++i) {
            const double each = 0.5 * (intensities[i] - 1);
            if (i % 997 == 0) {
                EXPECT_NEAR(each, direct_intensity(sphere, cosines[i]), 1e-9 * (1 + each)) << x;
            }
            sum += each;
            along += each * cosines[i];
        }
        const double steradians = 4 * kPi / kSteps;
        EXPECT_NEAR(sum * steradians / (kPi * x * x), whole.scattering, 2e-4 * whole.scattering) << x;
        EXPECT_NEAR(along / sum, whole.asymmetry, 2e-4) << x;
    }
}

// A cloud's droplets have asymmetries about 0.86 in green light (Hu and Stamnes 1993 have 0.862 at 10 micrometres).
TEST(MieScattering, CloudDropletsScatterForwards) {
    double forwards = 0, all = 0;
    for (double radius_um = 1; radius_um < 25; radius_um += 0.02) {
        const double x = 2 * kPi * radius_um * 1000 / 550;
        const MieEfficiencies one = mie_efficiencies(mie_coefficients(x, index_of_water(550)));
        const double light =
            std::pow(radius_um / 10, 7) * std::exp(-(radius_um - 10) / 1) * x * x * one.scattering;
        all += light;
        forwards += light * one.asymmetry;
    }
    EXPECT_NEAR(forwards / all, 0.862, 0.004);
    EXPECT_NEAR(index_of_water(589.3), 1.333, 0.0005);
}

// By the angle from the point opposite to the sun.
double cosine_at(double degrees) { return -std::cos(degrees * kDegree); }

// The table against the mean by its definition: every wavelength with its own index and a fine grid of radii. The sun's disc is
// much smaller than what such small droplets show.
TEST(DropletPhase, IsTheMeanOverRadiiAndWavelengths) {
    const DropletSizes sizes{.effective_diameter_um = 6, .effective_variance = 0.1};
    const DropletPhase table(sizes);
    const std::array<double, 7> degrees{0, 2, 5, 12, 30, 40, 60};
    std::array<double, 7> green{}, white{};
    double green_light = 0, white_light = 0;
    for (double nm = 405; nm < 700; nm += 10) {
        std::array<double, 7> sum{};
        double scattered = 0;
        for (double radius_um = 0.1; radius_um < 9; radius_um += 0.01) {
            const double count = std::pow(radius_um / 3, 7) * std::exp(-(radius_um - 3) / 0.3);
            const double x = 2 * kPi * radius_um * 1000 / nm;
            const MieCoefficients sphere = mie_coefficients(x, index_of_water(nm));
            scattered += count * kPi * x * x * mie_efficiencies(sphere).scattering;
            for (std::size_t i = 0; i < degrees.size(); ++i)
                sum[i] += count * direct_intensity(sphere, cosine_at(degrees[i]));
        }
        // The luminous efficiency of CIE 1931 as one Gaussian; luminance is the weighted sum of sRGB's channels.
        const double seen = std::exp(-0.5 * std::pow((nm - 559) / 42, 2));
        green_light += seen;
        for (std::size_t i = 0; i < degrees.size(); ++i) green[i] += seen * sum[i] / scattered;
        white_light += 1;
        for (std::size_t i = 0; i < degrees.size(); ++i) white[i] += sum[i] / scattered;
    }
    for (std::size_t i = 0; i < degrees.size(); ++i) {
        const std::array<double, 3> rgb = table.at(cosine_at(degrees[i]));
        const double luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        EXPECT_NEAR(luminance, green[i] / green_light, 0.04 * luminance) << degrees[i];
        EXPECT_NEAR((rgb[0] + rgb[1] + rgb[2]) / 3, white[i] / white_light, 0.12 * luminance) << degrees[i];
    }
}

double brightest(const DropletPhase& of, std::size_t colour, double low, double high) {
    double best = low;
    for (double at = low; at < high; at += 0.02)
        if (of.at(cosine_at(at))[colour] > of.at(cosine_at(best))[colour]) best = at;
    return best;
}

// Rings, each red outside and blue inside, wider for smaller droplets; the fogbow is white with a red rim outside.
TEST(DropletPhase, HasGloryAndFogbowWhereTheyAre) {
    const DropletPhase ten({.effective_diameter_um = 20, .effective_variance = 0.02});
    const double red = brightest(ten, 0, 1, 3), blue = brightest(ten, 2, 0.8, 2);
    EXPECT_NEAR(red, 1.75, 0.25);
    EXPECT_GT(red, blue + 0.3);
    const double second_red = brightest(ten, 0, 3, 4.6), second_blue = brightest(ten, 2, 2.2, 3.5);
    EXPECT_GT(second_red, second_blue + 0.5);
    EXPECT_NEAR(second_red, 3.75, 0.4);
    EXPECT_GT(ten.at(cosine_at(0))[1], 3 * ten.at(cosine_at(12))[1]);

    const DropletPhase small({.effective_diameter_um = 10, .effective_variance = 0.02});
    EXPECT_NEAR(brightest(small, 0, 2, 6) / red, 2, 0.25);  // in proportion to the wavelength over the radius

    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(brightest(ten, c, 30, 45), 38.3, 1.0);
    const std::array<double, 3> middle = ten.at(cosine_at(38.5)), rim = ten.at(cosine_at(43)),
                                dark = ten.at(cosine_at(49));
    EXPECT_NEAR(middle[0] / middle[2], 0.9, 0.15);
    EXPECT_GT(rim[0], 1.4 * rim[2]);
    EXPECT_GT(middle[1], 5 * dark[1]);
    // Larger droplets: a narrower bow, nearer to the rainbow's 42 degrees.
    const DropletPhase large({.effective_diameter_um = 50, .effective_variance = 0.05});
    EXPECT_GT(brightest(large, 1, 30, 45), 39.5);
}

TEST(DropletPhase, WiderDistributionsHaveFewerRings) {
    const auto contrast = [](double variance) {
        const DropletPhase droplets({.effective_diameter_um = 20, .effective_variance = variance});
        return droplets.at(cosine_at(3.75))[0] / droplets.at(cosine_at(3))[0];
    };
    EXPECT_GT(contrast(0.01), 1.4);
    EXPECT_LT(contrast(0.2), 1);
}

std::vector<double> falling_cosines() {
    std::vector<double> cosines;
    for (int i = 0; i <= 4000; ++i) cosines.push_back(std::cos(i * kPi / 4000));
    return cosines;
}

// Whatever the phase function, its integral stays, in each colour; in front nothing changes.
TEST(BowFactors, KeepTheLight) {
    const std::vector<double> cosines = falling_cosines();
    for (const Phase kind : {Phase::isotropic, Phase::rayleigh, Phase::henyey_greenstein, Phase::hg_draine}) {
        for (const double strength : {0.4, 1.0}) {
            const PhaseFunction function{kind, 0.8, 14};
            const auto factors = bow_factors(function, {14, 0.05}, strength, cosines);
            std::array<double, 3> sum{};
            double whole = 0;
            for (std::size_t i = 1; i < cosines.size(); ++i) {
                for (const std::size_t end : {i - 1, i}) {
                    const double light = kPi * (cosines[i - 1] - cosines[i]) * phase(function, cosines[end]);
                    whole += light;
                    for (std::size_t c = 0; c < 3; ++c) sum[c] += light * factors[end][c];
                }
            }
            for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], whole, 1e-6 * whole);
            for (std::size_t i = 0; i < cosines.size(); ++i)
                for (const double factor : factors[i]) {
                    EXPECT_GE(factor, 0);
                    if (cosines[i] > -0.08) {
                        EXPECT_EQ(factor, 1);
                    }
                }
        }
    }
}

// With the fit of the same droplets the light behind is Mie's but for one number.
TEST(BowFactors, MakeTheFitMies) {
    const DropletSizes sizes{14, 0.05};
    const PhaseFunction fit{Phase::hg_draine, 0, sizes.effective_diameter_um};
    const std::vector<double> cosines = falling_cosines();
    const auto factors = bow_factors(fit, sizes, 1, cosines);
    const DropletPhase droplets(sizes);
    double first = 0;
    for (std::size_t i = 2900; i < cosines.size(); i += 50) {
        const double ratio = factors[i][1] * phase(fit, cosines[i]) / droplets.at(cosines[i])[1];
        if (first == 0) first = ratio;
        EXPECT_NEAR(ratio, first, 1e-9);
    }
    EXPECT_NEAR(first, 1, 0.35);
}

TEST(ScatteringTable, HasRowsByColoursWithBowsAlone) {
    CloudLight light;
    light.phase = {Phase::hg_draine, 0, 20};
    const std::vector<float> plain = scattering_table(light);
    ASSERT_EQ(plain.size(), kRowsBeforeColours * shader::kScatterAngles);
    light.bows = 1;
    const std::vector<float> coloured = scattering_table(light);
    ASSERT_EQ(coloured.size(), (kRowsBeforeColours + 3) * shader::kScatterAngles);
    EXPECT_TRUE(std::equal(plain.begin(), plain.end(), coloured.begin()));
    const float* const red = &coloured[kRowsBeforeColours * shader::kScatterAngles];
    const float* const blue = red + 2 * shader::kScatterAngles;
    EXPECT_EQ(red[0], plain[0]);
    const auto column = std::size_t(shader::scatter_column(float(cosine_at(43))));
    EXPECT_GT(red[column], 1.3f * blue[column]);
}

}  // namespace
}  // namespace nephos
