// SPDX-License-Identifier: Apache-2.0
// Rain and snow: laws of size and speed, containers, particles as a function of time, and pictures across an
// area's perimeter.

#include "render/rain/precipitation.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "core/error.h"
#include "core/vec.h"
#include "render/rain/drop_sizes.h"
#include "render/rain/particle_streaks.h"
#include "render/rain/rain_shafts.h"
#include "tests/render/picture_checks.h"
#include "tests/render/rain_scene.h"

namespace nephos {
namespace {

constexpr PrecipitationKind kRain = PrecipitationKind::rain, kSnow = PrecipitationKind::snow;

RainCurtain area() { return test::rain_area(); }

RenderOptions options_at(const Vec3& eye, const Vec3& target) {
    return test::rain_view(eye, target, 160, 120, 20'000);
}

Weather weather_of(const RainCurtain& curtain) {
    Weather weather;
    weather.seed = 3;
    weather.curtains = {curtain};
    weather.wind_x_m_per_s = 2;
    weather.carried_x_m = 200;
    return weather;
}

// Marshall and Palmer's law, normalised: by quadrature with another rule than the library's.
TEST(DropSizes, CarryTheirRate) {
    for (const PrecipitationKind kind : {kRain, kSnow}) {
        for (const double rate : {0.1, 1.0, 5.0, 20.0, 100.0}) {
            const SizeLaw law = size_law(kind, rate);
            double sum = 0;
            constexpr int kCells = 20'000;
            const double step = (kLargest_mm - kSmallest_mm) / kCells;
            for (int i = 0; i < kCells; ++i) {
                const double d = kSmallest_mm + (i + 0.5) * step;
                sum += law.n0 * std::exp(-law.slope * d) * std::numbers::pi / 6 * d * d * d *
                       fall_speed_m_per_s(kind, d) * step;
            }
            EXPECT_NEAR(3.6e-3 * sum / rate, 1, 1e-3) << rate;
        }
    }
    EXPECT_NEAR(size_law(kRain, 5).slope, 4.1 * std::pow(5, -0.21), 1e-12);
    // The normalisation stays near Marshall and Palmer's own 8000 per m^3 and mm.
    EXPECT_NEAR(size_law(kRain, 5).n0, 8000, 2500);
    EXPECT_EQ(size_law(kRain, 0).n0, 0);
}

// The drops that are drawn, by their weights, bring the rate to the ground within 1 %.
TEST(DropSizes, DrawnParticlesCarryTheRate) {
    for (const PrecipitationKind kind : {kRain, kSnow}) {
        const Particles particles = make_particles(kind, 11, 100'000);
        for (const double rate : {1.0, 5.0, 25.0}) {
            const SizeLaw law = size_law(kind, rate);
            double flux = 0, number = 0, above_1 = 0;
            for (std::size_t i = 0; i < particles.size(); ++i) {
                const double d = double(particles.diameter_mm[i]);
                const double real = real_per_drawn(law, d) / double(particles.size());
                flux += real * 3.6e-3 * std::numbers::pi / 6 * d * d * d * double(particles.speed[i]);
                number += real;
                if (d > 1) above_1 += real;
            }
            EXPECT_NEAR(flux / rate, 1, 0.01) << rate;
            // Exponential: the number of all, and the share above 1 mm.
            const double low = std::exp(-law.slope * kSmallest_mm), high = std::exp(-law.slope * kLargest_mm);
            EXPECT_NEAR(number / (law.n0 * (low - high) / law.slope), 1, 0.01) << rate;
            EXPECT_NEAR(above_1 / number, (std::exp(-law.slope) - high) / (low - high), 0.01) << rate;
        }
    }
}

// P's two ranges, and the forms: spherical up to 0.5 mm.
TEST(DropSizes, FallWithinTheRangesOfTheSource) {
    for (double radius = 0.1; radius <= 0.45; radius += 0.01) {
        EXPECT_GE(fall_speed_m_per_s(kRain, 2 * radius), 0.72);
        EXPECT_LE(fall_speed_m_per_s(kRain, 2 * radius), 3.67);
    }
    for (double radius = 0.5; radius <= 4.0; radius += 0.05) {
        EXPECT_GE(fall_speed_m_per_s(kRain, 2 * radius), 4.0 - 0.01);
        EXPECT_LE(fall_speed_m_per_s(kRain, 2 * radius), 9.23);
    }
    double before = 0;
    for (double d = 0.2; d <= 8; d += 0.1) {
        EXPECT_GE(fall_speed_m_per_s(kRain, d), before);
        before = fall_speed_m_per_s(kRain, d);
        EXPECT_GE(fall_speed_m_per_s(kSnow, d), 0.5);
        EXPECT_LE(fall_speed_m_per_s(kSnow, d), 2.0);
        EXPECT_LE(axis_ratio(d), 1);
        EXPECT_GE(width_mm(kRain, d), d);
    }
    EXPECT_EQ(axis_ratio(0.5), 1);
    EXPECT_LT(axis_ratio(4), 0.8);
}

// As measured over optical links: 1.076 R^0.67 dB/km (Carbonneau and Wisely 1998), within a factor of two.
TEST(DropSizes, TakeAsMuchLightAsMeasured) {
    for (const double rate : {1.0, 5.0, 25.0}) {
        const double measured = 1.076 * std::pow(rate, 0.67) / 4.343e3;
        EXPECT_GT(rain_extinction_per_m(kRain, rate), 0.5 * measured) << rate;
        EXPECT_LT(rain_extinction_per_m(kRain, rate), 2 * measured) << rate;
    }
}

TEST(RainContainer, FindsTheNearestPointOfThePerimeter) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> place(-1500, 1500), axis(20, 900), angle(0, 6.28);
    for (int n = 0; n < 200; ++n) {
        const double turn = angle(random);
        const Ellipse e{place(random), place(random),  axis(random),
                        axis(random),  std::cos(turn), std::sin(turn)};
        const double x = place(random), y = place(random);
        const Vec2 found = nearest_on_perimeter(e, x, y);
        EXPECT_NEAR(ellipse_value(e, found.x, found.y), 1, 1e-9);
        double least = 1e30;
        for (int i = 0; i < 20'000; ++i) {
            const double t = i * 2 * std::numbers::pi / 20'000;
            const double u = e.semi_a_m * std::cos(t), v = e.semi_b_m * std::sin(t);
            least = std::min(least, std::hypot(e.x_m + u * e.axis_x - v * e.axis_y - x,
                                               e.y_m + u * e.axis_y + v * e.axis_x - y));
        }
        EXPECT_NEAR(std::hypot(found.x - x, found.y - y), least, 1e-4 * (e.semi_a_m + e.semi_b_m)) << n;
        EXPECT_LE(std::hypot(found.x - x, found.y - y), least + 1e-9);
    }
    // On the axes and in the centre.
    const Ellipse plain{0, 0, 300, 100, 1, 0};
    EXPECT_NEAR(std::abs(nearest_on_perimeter(plain, 0, 0).y), 100, 1e-9);
    EXPECT_NEAR(nearest_on_perimeter(plain, 500, 0).x, 300, 1e-9);
    EXPECT_NEAR(nearest_on_perimeter({0, 0, 100, 100, 1, 0}, 0, 0).y, 100, 1e-9);
}

// The frustum's sides on the ground, and where they leave what is seen of the ellipse.
TEST(RainContainer, IsAsWideAsTheFrustumSeesTheEllipse) {
    const Ellipse circle{0, 1000, 400, 400, 1, 0};
    RenderOptions options = options_at({0, 0, 10}, {0, 1000, 10});
    options.camera.vertical_fov_deg = 20;  // half the width: tan = 0.235
    const CameraFrame narrow = camera_frame(options.camera);
    const SideLines lines = side_lines(narrow);
    EXPECT_NEAR(lines.right.x / lines.right.y, narrow.half_width, 1e-3);
    EXPECT_NEAR(lines.left.x / lines.left.y, -narrow.half_width, 1e-3);
    const Crossing crossed = crossing(circle, {0, 0}, lines.right);
    for (const double t : {crossed.first, crossed.last})
        EXPECT_NEAR(ellipse_value(circle, t * lines.right.x, t * lines.right.y), 1, 1e-9);
    const Vec2 nearest = nearest_on_perimeter(circle, 0, 0);
    EXPECT_NEAR(nearest.y, 600, 1e-9);
    // Down to 100 m behind the perimeter the sides are tan * 700 away.
    const VisibleWidth width = visible_width(circle, narrow, nearest, 100);
    EXPECT_NEAR(width.left_m, 700 * narrow.half_width, 1);
    EXPECT_NEAR(width.right_m, width.left_m, 1e-6);
    // It shrinks on the way to the perimeter.
    double before = 1e9;
    for (double y = -500; y < 600; y += 50) {
        RenderOptions nearer = options_at({0, y, 10}, {0, 1000, 10});
        nearer.camera.vertical_fov_deg = 20;
        const VisibleWidth now = visible_width(circle, camera_frame(nearer.camera), nearest, 100);
        EXPECT_LE(now.right_m, before);
        before = now.right_m;
    }
    // Wide open, the whole ellipse is seen.
    options.camera.vertical_fov_deg = 100;
    EXPECT_NEAR(visible_width(circle, camera_frame(options.camera), nearest, 100).left_m, 400, 1e-6);
    EXPECT_FALSE(between_sides(narrow, lines, {2000, 100}, 100));
    EXPECT_TRUE(between_sides(narrow, lines, {0, 600}, 1));
}

// Turns by quarters; a view that turns by less than 90 degrees changes it at most once.
TEST(RainContainer, TurnsByQuarters) {
    RainCurtain curtain = area();
    Vec2 before{};
    int changes = -1;
    for (int degrees = 0; degrees < 90; ++degrees) {
        const double a = (10 + degrees) * std::numbers::pi / 180;
        const Vec3 eye{curtain.x_m, curtain.y_m, 5};
        const RenderOptions options = options_at(eye, eye + Vec3{std::cos(a), std::sin(a), 0});
        const RainContainer at = rain_container(curtain, camera_frame(options.camera), 1, 100);
        EXPECT_TRUE(at.near);
        EXPECT_LE(std::hypot(at.centre.x - eye.x, at.centre.y - eye.y), std::sqrt(0.5));
        if (at.axis.x != before.x || at.axis.y != before.y) ++changes;
        before = at.axis;
    }
    EXPECT_EQ(changes, 1);
}

// P's level of detail: number per volume falls as 1 - d, and all of the made particles are in their reach's
// box, wherever the eye is and at any time.
TEST(Particles, ThinOutWithTheDistance) {
    constexpr std::size_t kCount = 400'000;
    const Particles particles = make_particles(kRain, 1, kCount);
    std::vector<float> x(kCount), y(kCount), z(kCount);
    for (const double time_s : {0.0, 12'345.678}) {
        ParticleBoxes boxes{1234.5, -777.7, 55.5, 3000.25, 12.5, time_s, 20, 0, 25};
        place_particles(particles, boxes, 0, kCount, x.data(), y.data(), z.data());
        constexpr int kRings = 10;
        std::vector<double> rings(kRings);
        for (std::size_t i = 0; i < kCount; ++i) {
            const double reach = 20 * double(particles.reach[i]);
            EXPECT_LE(std::abs(double(x[i])), reach + 1e-4);
            EXPECT_LE(std::abs(double(z[i])), 12.5 + 1e-4);
            const double d = std::hypot(double(x[i]), double(y[i])) / 20;
            if (d < double(particles.reach[i])) ++rings[std::size_t(d * kRings)];
        }
        const double n0 = 0.75 * kCount / (20.0 * 20 * 25);
        for (int r = 0; r + 1 < kRings; ++r) {
            const double low = 20.0 * r / kRings, high = 20.0 * (r + 1) / kRings;
            const double volume = std::numbers::pi * (high * high - low * low) * 25;
            // Mean of 1 - d over the ring.
            const double a = low / 20, b = high / 20;
            const double mean = 1 - 2.0 / 3 * (b * b * b - a * a * a) / (b * b - a * a);
            EXPECT_NEAR(rings[std::size_t(r)] / volume / (n0 * mean), 1, 0.08) << r;
        }
    }
    EXPECT_EQ(lod_size(0.5), 0.25);
}

// Falls at its speed, is carried with the air, and does not move when the container does; a range alone gives
// the same bits as all at once.
TEST(Particles, AreAFunctionOfIndexAndTime) {
    constexpr std::size_t kCount = 5000;
    const Particles particles = make_particles(kRain, 1, kCount);
    std::vector<float> a(3 * kCount), b(3 * kCount);
    ParticleBoxes boxes{10, 20, 30, 0, 0, 1e5, 16, 1, 20};
    place_particles(particles, boxes, 0, kCount, &a[0], &a[kCount], &a[2 * kCount]);
    for (std::size_t begin = 0; begin < kCount; begin += 333) {
        const std::size_t end = std::min(kCount, begin + (begin % 2 == 0 ? 333 : 5));
        place_particles(particles, boxes, begin, end, &b[begin], &b[kCount + begin], &b[2 * kCount + begin]);
        for (std::size_t i = begin; i < end; ++i)
            for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(a[c * kCount + i], b[c * kCount + i]);
    }
    ParticleBoxes later = boxes;
    later.time_s += 0.01;
    later.carried_x_m += 0.05;
    later.centre_x_m += 0.25;
    place_particles(particles, later, 0, kCount, &b[0], &b[kCount], &b[2 * kCount]);
    int compared = 0;
    for (std::size_t i = 0; i < kCount; ++i) {
        if (std::abs(b[i] - a[i]) > 0.5f || std::abs(b[2 * kCount + i] - a[2 * kCount + i]) > 0.5f) continue;
        ++compared;
        EXPECT_NEAR(double(b[i] - a[i]), 0.05 - 0.25, 1e-4);
        EXPECT_NEAR(double(b[2 * kCount + i] - a[2 * kCount + i]), -0.01 * double(particles.speed[i]), 1e-4);
    }
    EXPECT_GT(compared, int(0.8 * kCount));
}

double energy(const RenderOptions& options, const Weather& weather, double time_s) {
    const CameraFrame camera = camera_frame(options.camera);
    const Picture picture = test::grey(options.camera);
    const PrecipitationLight light = precipitation_light(picture, options, time_s);
    const StreakView view{options, camera, camera, camera, light, weather.wind_x_m_per_s, 0, time_s};
    static const Particles particles = make_particles(kRain, 3, 50'930);
    double sum = 0;
    for (const ParticlePass& pass : particle_passes(options, camera, weather, time_s))
        for (const Streak& s : streaks_of(particles, pass, view, picture))
            sum += double(s.opacity) * double(s.width) * std::hypot(double(s.x1 - s.x0), double(s.y1 - s.y0));
    return sum;
}

// The eye goes through the perimeter: what is drawn does not jump, neither on the way in nor out.
TEST(Precipitation, IsContinuousAcrossThePerimeter) {
    RainCurtain curtain = area();
    const Weather weather = weather_of(curtain);
    const Ellipse ellipse = ellipse_at(curtain, 2);
    const Vec2 gate = nearest_on_perimeter(ellipse, 100, 0);
    double before = -1, least = 1e30, most = 0;
    for (double way = -4; way <= 4; way += 0.1) {
        RenderOptions options = options_at({gate.x, gate.y + way, 2}, {gate.x, gate.y + way + 100, 12});
        options.precipitation.edge = 0.05;
        const double now = energy(options, weather, 5);
        if (before >= 0) {
            EXPECT_NEAR(now / before, 1, 0.12) << way;
        }
        before = now;
        least = std::min(least, now);
        most = std::max(most, now);
    }
    EXPECT_GT(least, 0);
    EXPECT_GT(most, least);
    const RainFractions at = rain_fractions(PrecipitationOptions{}, 0);
    EXPECT_EQ(at.near, 1);
    EXPECT_EQ(at.far, 0);
    double near = 1, number = 1;
    for (double outside = 0; outside < 700; outside += 1) {
        const RainFractions shares = rain_fractions(PrecipitationOptions{}, outside);
        EXPECT_NEAR(shares.near + shares.far, 1, 1e-12);
        EXPECT_LE(shares.near, near);
        EXPECT_LE(shares.far_number, number);
        EXPECT_GT(shares.near, near - 0.05);
        near = shares.near;
        number = shares.far_number;
    }
    EXPECT_EQ(near, 0);
    EXPECT_EQ(number, 0);
}

// Pictures: the same bits for any number of threads and any order of pictures; nothing when switched off.
TEST(Precipitation, IsDeterministic) {
    const RainCurtain curtain = area();
    const Weather weather = weather_of(curtain);
    for (const PrecipitationKind kind : {kRain, kSnow}) {
        RenderOptions options = options_at({100, 800, 2}, {100, 900, 12});
        options.precipitation.kind = kind;
        std::vector<float> first;
        PrecipitationPainter kept;
        Picture other = test::grey(options.camera);
        kept.draw(other, options, weather, 100);
        for (const std::size_t threads : {1, 2, 7}) {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
            Picture picture = test::grey(options.camera), again = test::grey(options.camera);
            PrecipitationPainter fresh;
            fresh.draw(picture, options, weather, 7);
            kept.draw(again, options, weather, 7);
            EXPECT_GT(fresh.streaks(), 100u);
            if (first.empty()) first = picture.beauty;
            EXPECT_EQ(picture.beauty, first);
            EXPECT_EQ(again.beauty, first);
        }
        EXPECT_NE(first, test::grey(options.camera).beauty);
        EXPECT_NE(first, other.beauty);
        options.precipitation.enabled = false;
        Picture off = test::grey(options.camera);
        kept.draw(off, options, weather, 7);
        EXPECT_EQ(off.beauty, test::grey(options.camera).beauty);
    }
}

// P's width: of an area of 4 km far rain fills what the frustum shows, not a circle about the nearest point.
TEST(Precipitation, FarRainFillsTheVisibleWidth) {
    RainCurtain curtain = area();
    curtain.x_m = 0;
    curtain.y_m = 1400;
    curtain.semi_a_m = 2000;
    curtain.semi_b_m = 1000;
    curtain.axis_x = 1;
    curtain.axis_y = 0;
    RenderOptions options = options_at({0, 100, 2}, {0, 1100, 150});
    options.precipitation.edge = 0.05;
    options.precipitation.visibility = 50;
    const CameraFrame camera = camera_frame(options.camera);
    const Particles particles = make_particles(kRain, 3, 50'000);
    const Picture picture = test::grey(options.camera);
    const PrecipitationLight light = precipitation_light(picture, options, 5);
    const StreakView view{options, camera, camera, camera, light, 0, 0, 5};
    const Weather weather = weather_of(curtain);
    std::size_t thirds[3] = {};
    for (const ParticlePass& pass : particle_passes(options, camera, weather, 5)) {
        if (!pass.far) continue;
        for (const Streak& s : streaks_of(particles, pass, view, picture))
            ++thirds[std::clamp(int(3 * s.x0 / float(options.camera.width)), 0, 2)];
    }
    EXPECT_GT(thirds[1], 100u);
    EXPECT_GT(thirds[0], thirds[1] / 8);
    EXPECT_GT(thirds[2], thirds[1] / 8);
}

// Weights of widths are continuous and sum to one.
TEST(Precipitation, FarWidthsFadeIntoEachOther) {
    EXPECT_EQ(far_widths(10, 160)[0].scale, 1);
    EXPECT_EQ(far_widths(10, 160)[1].weight, 0);
    double before[8] = {1};
    for (double wide = 160; wide < 160 * 63; wide *= 1.01) {
        double now[8] = {};
        for (const FarWidth& width : far_widths(wide, 160)) now[int(std::log2(width.scale))] += width.weight;
        double sum = 0;
        for (int level = 0; level < 8; ++level) {
            EXPECT_NEAR(now[level], before[level], 0.02) << wide;
            before[level] = now[level];
            sum += now[level];
        }
        EXPECT_NEAR(sum, 1, 1e-12);
    }
}

// Turning the camera changes the width that is seen, and nothing jumps.
TEST(Precipitation, IsContinuousWhileTheCameraTurns) {
    RainCurtain curtain = area();
    curtain.semi_a_m = 1500;
    const Weather weather = weather_of(curtain);
    double before = -1;
    for (double angle = -0.5; angle <= 0.5; angle += 0.01) {
        const Vec3 eye{100, 100, 2};
        const RenderOptions options =
            options_at(eye, eye + Vec3{100 * std::sin(angle), 100 * std::cos(angle), 12});
        const double now = energy(options, weather, 5);
        if (before >= 0) {
            EXPECT_NEAR(now, before, 0.15 * std::max(now, before)) << angle;
        }
        before = now;
    }
    EXPECT_GT(before, 0);
}

// Drops are there below the cloud alone, and as many as it has water.
TEST(Precipitation, FallsFromTheCloudAbove) {
    RainCurtain curtain = area();
    const Vec3 eye{100, 900, 2};
    const RenderOptions options = options_at(eye, eye + Vec3{0, 100, 10});
    const double everywhere = energy(options, weather_of(curtain), 3);
    const auto below = [&](float water, float base_m) {
        CloudBases cloud{-2000, -2000, 1000, 6, 6, {}, {}};
        cloud.water.assign(36, water);
        cloud.water_base_m.assign(36, water * base_m);
        curtain.cloud = std::make_shared<CloudBases>(cloud);
        return energy(options, weather_of(curtain), 3);
    };
    EXPECT_NEAR(below(1, 800), everywhere, 1e-6 * everywhere);
    EXPECT_NEAR(below(0.5f, 800) / everywhere, 0.5, 0.1);  // opacities end at 0.85
    EXPECT_EQ(below(0, 800), 0);
    EXPECT_LT(below(1, 4), 0.9 * everywhere);
}

// A cloud that hides everything hides far rain, too, and not the drops before it.
TEST(Precipitation, LiesBehindNearerClouds) {
    const Weather weather = weather_of(area());
    RenderOptions options = options_at({100, -2000, 2}, {100, 900, 300});
    Picture hidden = test::grey(options.camera);
    std::fill(hidden.depth_m.begin(), hidden.depth_m.end(), 500.0f);
    std::fill(hidden.transmittance.begin(), hidden.transmittance.end(), 0.0f);
    Picture open = test::grey(options.camera);
    PrecipitationPainter painter;
    painter.draw(hidden, options, weather, 0);
    painter.draw(open, options, weather, 0);
    EXPECT_EQ(hidden.beauty, test::grey(options.camera).beauty);
    EXPECT_NE(open.beauty, hidden.beauty);
    options = options_at({100, 800, 2}, {100, 900, 12});
    Picture near = test::grey(options.camera);
    std::fill(near.depth_m.begin(), near.depth_m.end(), 500.0f);
    std::fill(near.transmittance.begin(), near.transmittance.end(), 0.0f);
    painter.draw(near, options, weather, 0);
    EXPECT_NE(near.beauty, test::grey(options.camera).beauty);
}

// As in photographs: in heavy rain streaks are brighter than what is dark behind them and darker than a bright sky, thin,
// and a part of the picture that is seen at once; farther out in the area there are fewer.
TEST(Precipitation, StreaksStandOutOnDarkAndOnBright) {
    const Weather weather = weather_of(area());
    const auto changed = [&](const Vec3& eye, float behind, double& mean) {
        RenderOptions options = options_at(eye, eye + Vec3{0, 100, 10});
        options.precipitation.shafts = 0;
        options.precipitation.edge = 0.8;
        Picture picture = test::grey(options.camera, behind);
        PrecipitationPainter().draw(picture, options, weather, 3);
        std::size_t count = 0;
        mean = 0;
        for (std::size_t i = 1; i < picture.beauty.size(); i += 3) {
            const double contrast = double(picture.beauty[i]) / double(behind) - 1;
            count += std::abs(contrast) > 0.03 ? 1 : 0;
            mean += contrast / double(picture.pixels());
        }
        return double(count) / double(picture.pixels());
    };
    double on_dark = 0, on_bright = 0, at_rim = 0;
    const double dark = changed({100, 900, 2}, 0.04f, on_dark), bright = changed({100, 900, 2}, 1.2f, on_bright);
    std::printf("dark: %.3f of the pixels, mean %.4f; bright: %.3f, %.4f\n", dark, on_dark, bright, on_bright);
    EXPECT_GT(on_dark, 0.01);
    EXPECT_LT(on_bright, -0.002);
    EXPECT_GT(dark, 0.05);
    EXPECT_LT(dark, 0.7);
    EXPECT_GT(bright, 0.02);
    EXPECT_LT(changed({100, 590, 2}, 0.04f, at_rim), dark);
    EXPECT_LT(at_rim, 0.5 * on_dark);
}

TEST(Precipitation, RefusesBadOptions) {
    RenderOptions options = options_at({0, 0, 2}, {0, 1, 2});
    options.precipitation.exposure_s = -1;
    EXPECT_THROW(check(options), Error);
    options = options_at({0, 0, 2}, {0, 1, 2});
    options.precipitation.evaporation = std::nan("");
    EXPECT_THROW(check(options), Error);
}

}  // namespace
}  // namespace nephos
