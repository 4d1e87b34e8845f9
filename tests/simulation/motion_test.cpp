// SPDX-License-Identifier: Apache-2.0
// Frames between steps: clouds move as the wind does, by fractions of a cell, and keep their edges.

#include "simulation/motion.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/reader.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

// Eight frames a step. Clouds of one row of parcels, so that none grows or dies unevenly; no births or deaths later.
Scene drifting(double east_m_per_s, double north_m_per_s) {
    Scene scene = read_scene_text(R"(
name = "drift"
seed = 3
[lattice]
cells = [64, 48, 12]
cell_size_m = 40
boundaries = ["periodic", "periodic", "open"]
[time]
step_s = 10
steps = 60
[field.background]
hum = 0
act = 0
ext = 0
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 1, north_m_per_s = 0 }]
[[field.ellipsoids]]
centre_m = [1280, 960, 240]
semi_axes_m = [420, 330, 160]
centre = { hum = 0.4, act = 0.05, ext = 0 }
rim = { hum = 0.3, act = 0, ext = 0 }
life_s = 150
[density.smoothing]
t0 = 2
[frames]
per_second = 1
time_scale = 1.25
start_s = 400
count = 64
)",
                                  "drift.toml");
    scene.automaton.wind.keyframes.front().levels.front().velocity = {east_m_per_s, north_m_per_s};
    return scene;
}

struct Figures {
    double x = 0, y = 0, mass = 0, gradients = 0;
};

// Centre of mass on a circle of the period, which knows no sides.
Figures figures_of(const DensityGrid& grid) {
    const Extent e = grid.extent();
    const std::vector<float> q = grid.to_dense();
    Figures f;
    double cx = 0, sx = 0, cy = 0, sy = 0;
    const auto at = [&](int i, int j, int k) { return double(q[linear_index(e, i % e.x, j % e.y, k)]); };
    for (int k = 0; k < e.z; ++k)
        for (int j = 0; j < e.y; ++j)
            for (int i = 0; i < e.x; ++i) {
                const double value = at(i, j, k);
                f.mass += value;
                cx += value * std::cos(2 * M_PI * i / e.x);
                sx += value * std::sin(2 * M_PI * i / e.x);
                cy += value * std::cos(2 * M_PI * j / e.y);
                sy += value * std::sin(2 * M_PI * j / e.y);
                f.gradients += std::abs(at(i + 1, j, k) - value) + std::abs(at(i, j + 1, k) - value);
            }
    f.x = std::atan2(sx, cx) / (2 * M_PI) * e.x;
    f.y = std::atan2(sy, cy) / (2 * M_PI) * e.y;
    return f;
}

struct Frames : SimulationSink {
    void step(const StepResult&) override {}
    void frame(const FrameResult& result) override { all.push_back(figures_of(result.density)); }
    std::vector<Figures> all;
};

std::vector<Figures> frames_of(const Scene& scene) {
    Simulation simulation(scene);
    Frames frames;
    while (!simulation.finished()) simulation.advance(frames);
    return frames.all;
}

// Fast and slow winds, along and across: 1.25 and 0.1 cells a step, where the bits themselves stand still for ten steps.
TEST(Motion, TheCentreOfMassMovesAsTheWind) {
    for (const Velocity wind : {Velocity{5, -2}, Velocity{0.4, 0.9}, Velocity{-7.3, 0}}) {
        const std::vector<Figures> frames = frames_of(drifting(wind.east_m_per_s, wind.north_m_per_s));
        ASSERT_EQ(frames.size(), 64u);
        EXPECT_GT(frames.front().mass, 100);
        for (std::size_t n = 1; n < frames.size(); ++n) {
            const double x = std::remainder(frames[n].x - frames[n - 1].x, 64),
                         y = std::remainder(frames[n].y - frames[n - 1].y, 48);
            EXPECT_NEAR(x, wind.east_m_per_s * 1.25 / 40, 0.01) << n;
            EXPECT_NEAR(y, wind.north_m_per_s * 1.25 / 40, 0.01) << n;
        }
    }
}

TEST(Motion, EdgesAreAsSharpBetweenStepsAsAtThem) {
    for (const Velocity wind : {Velocity{5, -2}, Velocity{16.6, 3.1}}) {
        const std::vector<Figures> frames = frames_of(drifting(wind.east_m_per_s, wind.north_m_per_s));
        double least = 1e30, most = 0;
        for (const Figures& f : frames) {
            least = std::min(least, f.gradients / f.mass);
            most = std::max(most, f.gradients / f.mass);
        }
        EXPECT_LT(most / least, 1.02) << wind.east_m_per_s;
    }
}

// Cells are born and die in every step, so that states that follow each other differ; in calm air, too. Four frames a step.
TEST(Motion, FramesOfChangingCloudsAreAsSharpAsThoseOnTheSteps) {
    for (const double east : {0.0, 5.0}) {
        Scene scene = drifting(east, -0.4 * east);
        scene.automaton.field.background = {0.05, 0.004, 0.03};
        scene.frames.time_scale = 2.5;
        const std::vector<Figures> frames = frames_of(scene);
        ASSERT_EQ(frames.size(), 64u);
        double changed = 0;
        for (std::size_t n = 0; n + 4 < frames.size(); n += 4) {
            const Figures &from = frames[n], &to = frames[n + 4];
            changed += std::abs(to.mass - from.mass) / from.mass;
            for (std::size_t m = 1; m < 4; ++m) {
                const double wanted = from.gradients + (to.gradients - from.gradients) * double(m) / 4;
                EXPECT_NEAR(frames[n + m].gradients, wanted, 0.01 * wanted) << east << " " << n + m;
                const double mass = from.mass + (to.mass - from.mass) * double(m) / 4;
                EXPECT_NEAR(frames[n + m].mass, mass, 0.005 * mass) << east << " " << n + m;
            }
        }
        EXPECT_GT(changed, 0);
    }
}

// In calm air a frame on a step is that step's q, bit by bit, and so it is where bits move whole cells with the wind.
TEST(Motion, AFrameOnAStepOfWholeCellsIsThatOfTheStep) {
    for (const double east : {0.0, 8.0}) {
        Scene scene = drifting(east, 0);
        scene.frames.time_scale = 10;
        scene.frames.count = 3;
        Simulation simulation(scene, {scene.steps, 1, 0}, "");
        simulation.go_to(40);
        const DensityGrid q = simulation.present_density();
        EXPECT_TRUE(simulation.present_frame().density.to_dense() == q.to_dense()) << east;
    }
}

// Where density lies is a matter of its own steps: how far the automaton is when somebody asks would make voxels depend on when
// a run was saved. Winds and a kernel whose mean place is no binary fraction.
TEST(Motion, WhereDensityLiesDoesNotDependOnLaterSteps) {
    for (const Velocity wind : {Velocity{42.3, -2}, Velocity{63.45, 7.7}, Velocity{0.1, -999.9}}) {
        Scene scene = drifting(wind.east_m_per_s, wind.north_m_per_s);
        scene.automaton.time_step_s = 30;
        SmoothingOptions smoothing = scene.density.smoothing;
        smoothing.kernel = SmoothingKernel::box;
        smoothing.t0 = 3;
        Automaton automaton(scene.automaton);
        while (automaton.steps() < 20) automaton.step();
        const Moment moments[] = {{16, 1}, {16, 0.3}, {17, 0}};
        std::vector<std::vector<Vec2>> first;
        for (const Moment& moment : moments)
            first.push_back(displacement_of_density(automaton, smoothing, 17, moment));
        for (int later = 0; later < 40; ++later) {
            automaton.step();
            for (std::size_t n = 0; n < first.size(); ++n)
                ASSERT_EQ(displacement_of_density(automaton, smoothing, 17, moments[n]), first[n]) << later;
        }
    }
}

}  // namespace
}  // namespace nephos
