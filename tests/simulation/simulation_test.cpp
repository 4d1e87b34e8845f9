// SPDX-License-Identifier: Apache-2.0

// The simulation against a plain second way to the same frames, and a simulation that was saved at every possible
// moment against one that was not.

#include "simulation/simulation.h"

#include <algorithm>
#include <bit>
#include <functional>

#include <gtest/gtest.h>

#include "core/error.h"
#include "density/sharpen.h"
#include "density/smoothing.h"

namespace nephos {
namespace {

Scene small_scene() {
    Scene scene;
    scene.name = "small";
    scene.automaton.extent = {37, 21, 13};
    scene.automaton.placement.cell_size_m = 50;
    scene.automaton.seed = 11;
    scene.automaton.time_step_s = 10;
    scene.automaton.field.background = {0.15, 0.01, 0.05};
    scene.automaton.wind.keyframes = {{0, {{0, {3, -2}}, {600, {9, 1}}}}};
    scene.steps = 12;
    scene.density.smoothing = {SmoothingKernel::tent, 2, 1, 1, 1};
    scene.frames.per_second = 1;
    scene.frames.time_scale =
        7;  // a frame every 7 s: never the time step's 10 s, but every tenth frame on a step
    scene.frames.start_s = 0;
    return scene;
}

// All results as text, so that two sequences can be compared and shown.
class Listing : public SimulationSink {
  public:
    void step(const StepResult& r) override {
        const CloudStatistics& s = r.statistics;
        events.push_back("step " + std::to_string(r.step) + " " + std::to_string(r.time_s) + " " +
                         r.hash.hex() + " " + std::to_string(s.hum) + " " + std::to_string(s.act) + " " +
                         std::to_string(s.cld) + " " + std::to_string(s.cover) + " " +
                         std::to_string(s.base_m) + " " + std::to_string(s.top_m) + " " +
                         std::to_string(std::bit_cast<std::uint64_t>(s.mean_density)));
        steps.push_back(r);
    }
    void frame(const FrameResult& r) override {
        const std::vector<float> dense = r.density.to_dense();
        std::size_t sum = 0;
        for (const float value : dense) sum = sum * 1000003 + std::bit_cast<std::uint32_t>(value);
        std::string state = "-";
        if (r.cld) {
            std::uint64_t bits = 0;
            for (const auto& plane : {r.hum, r.act, r.cld}) {
                for (std::size_t n = 0; n < plane->word_count(); ++n) bits = bits * 1000003 + plane->words[n];
            }
            state = std::to_string(bits);
        }
        events.push_back("frame " + std::to_string(r.number) + " " + std::to_string(r.time_s) + " " +
                         std::to_string(r.step) + " " + r.hash.hex() + " " + std::to_string(sum) + " " +
                         state);
        frames.push_back(dense);
        numbers.push_back(r.number);
    }

    std::vector<std::string> events;
    std::vector<StepResult> steps;
    std::vector<std::vector<float>> frames;
    std::vector<int> numbers;
};

Listing run_to_end(Simulation& simulation) {
    Listing listing;
    while (!simulation.finished()) simulation.advance(listing);
    return listing;
}

Listing uninterrupted(const Scene& scene, const SimulationRange& range) {
    Simulation simulation(scene, range, std::string(32, '0'));
    return run_to_end(simulation);
}

TEST(Moment, SplitsTimeIntoStepAndFraction) {
    EXPECT_EQ(moment_of(0, 10).step, 0u);
    EXPECT_EQ(moment_of(25, 10).step, 2u);
    EXPECT_DOUBLE_EQ(moment_of(25, 10).fraction, 0.5);
    // 3 * 0.1 is a little above 0.3, 0.7 / 0.1 a little below 7: both are meant as the step itself.
    EXPECT_EQ(moment_of(3 * 0.1, 0.1).step, 3u);
    EXPECT_EQ(moment_of(3 * 0.1, 0.1).fraction, 0);
    EXPECT_EQ(moment_of(0.7, 0.1).step, 7u);
    EXPECT_EQ(moment_of(0.7, 0.1).fraction, 0);
    // After a long time a moment between two steps is still one.
    EXPECT_EQ(moment_of(1e9 + 0.25, 1).step, 1000000000u);
    EXPECT_EQ(moment_of(1e9 + 0.25, 1).fraction, 0.25);
    EXPECT_EQ(moment_of(1e9 + 0.75, 1).fraction, 0.75);
    // Film rates and steps that are no binary fractions: every frame of a step is that step.
    for (const double rate : {24.0, 30.0, 29.97, 0.3}) {
        for (const double step_s : {0.1, 0.7, 10.0, 1.0 / 3.0}) {
            FrameOptions frames;
            frames.per_second = rate;
            frames.time_scale = rate * step_s;
            frames.start_s = 3 * step_s;
            for (int index = 0; index < 20000; index += 7) {
                const Moment moment = moment_of(frame_time_s(frames, index), step_s);
                ASSERT_EQ(moment.fraction, 0) << rate << " " << step_s << " " << index;
                ASSERT_EQ(moment.step, std::uint64_t(index) + 3);
            }
        }
    }
}

// The same frames from all states kept in memory: q by smooth() over the window, then mix(). In calm air; wind carries
// both (motion_test.cpp).
TEST(Simulation, FramesAreTheSmoothedAndMixedStates) {
    for (const int t0 : {0, 1, 3}) {
        Scene scene = small_scene();
        scene.density.smoothing.t0 = t0;
        scene.automaton.wind = {};
        const Listing got = uninterrupted(scene, full_range(scene));

        std::vector<BitPlane> clds;
        Automaton automaton(scene.automaton);
        for (std::uint64_t step = 0; step <= scene.steps + 3; ++step) {
            BitPlane plane(scene.automaton.extent);
            std::copy_n(automaton.cld().words, automaton.cld().word_count(), plane.words().begin());
            clds.push_back(std::move(plane));
            automaton.step();
        }
        const auto q = [&](int step) {
            std::vector<TimedPlane> planes;
            for (int t = std::max(-t0, -step); t <= t0; ++t)
                planes.push_back({clds[std::size_t(step + t)].view(), t});
            return smooth(planes, scene.density.smoothing, scene.automaton.placement,
                          scene.automaton.boundaries);
        };
        // As sharp as both, level by level (density/sharpen.h).
        const auto sharp_mix = [&](const DensityGrid& before, const DensityGrid& after, double fraction) {
            const Boundaries& boundaries = scene.automaton.boundaries;
            std::vector<Vec2> gradients = gradients_of(before, boundaries);
            const std::vector<Vec2> later = gradients_of(after, boundaries);
            for (std::size_t k = 0; k < gradients.size(); ++k)
                gradients[k] += fraction * (later[k] - gradients[k]);
            return sharpened(mix(before, after, fraction), gradients, boundaries);
        };
        ASSERT_EQ(int(got.frames.size()), frame_count(scene));
        ASSERT_EQ(got.frames.size(), 18u);  // 0, 7, ... 119 s of 120 s
        bool any = false;
        for (int n = 0; n < 18; ++n) {
            const int step = 7 * n / 10;
            const int rest = 7 * n % 10;
            const DensityGrid expected = rest == 0 ? q(step) : sharp_mix(q(step), q(step + 1), rest / 10.0);
            const std::vector<float> want = expected.to_dense();
            for (std::size_t c = 0; c < want.size(); ++c) {
                ASSERT_NEAR(got.frames[std::size_t(n)][c], want[c], 1e-6)
                    << "t0 " << t0 << " frame " << n + 1;
                any = any || want[c] > 0;
            }
        }
        EXPECT_TRUE(any) << "an empty sky proves nothing";

        ASSERT_EQ(got.steps.size(), scene.steps + 1);
        for (std::size_t step = 0; step < got.steps.size(); ++step) {
            EXPECT_EQ(got.steps[step].step, step);
            EXPECT_EQ(got.steps[step].statistics.cld, clds[step].count());
            const std::vector<float> dense = q(int(step)).to_dense();
            double sum = 0;
            for (const float value : dense) sum += value;
            EXPECT_NEAR(got.steps[step].statistics.mean_density, sum / double(dense.size()), 1e-9);
        }
    }
}

void expect_same_after_restart_anywhere(const Scene& scene, const SimulationRange& range) {
    const Listing whole = uninterrupted(scene, range);
    Listing dummy;
    Simulation simulation(scene, range, std::string(32, '0'));
    std::size_t restarts = 0;
    for (;; ++restarts) {
        Simulation again(scene, range, std::string(32, '0'), simulation.save());
        ASSERT_EQ(again.steps_taken(), simulation.steps_taken());
        const Listing rest = run_to_end(again);
        std::vector<std::string> joined = dummy.events;
        joined.insert(joined.end(), rest.events.begin(), rest.events.end());
        ASSERT_EQ(joined, whole.events) << "restart " << restarts << " at step " << simulation.steps_taken();
        if (simulation.finished()) break;
        simulation.advance(dummy);
    }
    EXPECT_GT(restarts, scene.steps);
}

TEST(Simulation, RestartsAnywhereWithTheSameResults) {
    expect_same_after_restart_anywhere(small_scene(), full_range(small_scene()));
}

TEST(Simulation, RestartsAnywhereWithAndWithoutATimeWindow) {
    Scene scene = small_scene();
    scene.steps = 6;
    for (const int t0 : {0, 2}) {
        scene.density.smoothing.t0 = t0;
        scene.density.write_state = t0 == 2;
        expect_same_after_restart_anywhere(scene, full_range(scene));
    }
}

TEST(Simulation, RestartsAnywhereWithManyFramesAStepAndFewAndNone) {
    Scene scene = small_scene();
    scene.steps = 5;
    for (const double time_scale : {1.7, 23.0}) {
        scene.frames.time_scale = time_scale;
        expect_same_after_restart_anywhere(scene, full_range(scene));
    }
    expect_same_after_restart_anywhere(scene, {scene.steps, 1, 0});
}

TEST(Simulation, ARangeOfFramesIsThatPartOfTheWhole) {
    const Scene scene = small_scene();
    const Listing whole = uninterrupted(scene, full_range(scene));
    const SimulationRange range = range_of_frames(scene, 5, 8);
    EXPECT_EQ(range.last_step, 5u);  // frame 8 shows 49 s
    const Listing part = uninterrupted(scene, range);
    ASSERT_EQ(part.numbers, (std::vector<int>{5, 6, 7, 8}));
    for (std::size_t n = 0; n < 4; ++n) EXPECT_EQ(part.frames[n], whole.frames[n + 4]);
    EXPECT_EQ(part.steps.size(), 6u);
    EXPECT_EQ(part.steps.back().hash, whole.steps[5].hash);
    EXPECT_EQ(part.steps.back().statistics.mean_density, whole.steps[5].statistics.mean_density);
}

TEST(Simulation, RefusesFramesThatAreNotThere) {
    Scene scene = small_scene();
    EXPECT_THROW(range_of_frames(scene, 19, 20), Error);
    EXPECT_THROW(range_of_frames(scene, 0, 1), Error);
    EXPECT_THROW(range_of_frames(scene, 17, 19), Error);
    EXPECT_EQ(range_of_frames(scene, 17, kLastFrame).last_frame, 18);
    scene.frames.count = 100;  // more than the simulated time holds
    EXPECT_THROW(Simulation(scene, full_range(scene), std::string(32, '0')), Error);
}

ErrorCode code_of(const std::function<void()>& action) {
    try {
        action();
    } catch (const Error& error) {
        return error.code();
    }
    ADD_FAILURE() << "no error";
    return ErrorCode::check;
}

TEST(Simulation, RefusesForeignAndDamagedCheckpoints) {
    const Scene scene = small_scene();
    const SimulationRange range = full_range(scene);
    Simulation simulation(scene, range, std::string(32, '0'));
    Listing dummy;
    for (int n = 0; n < 9; ++n) simulation.advance(dummy);
    const Checkpoint good = simulation.save();
    const auto restart = [&](const Scene& s, const SimulationRange& r, const std::string& hash,
                             const Checkpoint& c) { return code_of([&] { Simulation(s, r, hash, c); }); };
    EXPECT_EQ(restart(scene, range, std::string(32, '1'), good), ErrorCode::usage);
    EXPECT_EQ(restart(scene, range_of_frames(scene, 1, 3), std::string(32, '0'), good), ErrorCode::usage);
    Scene wider = scene;
    wider.density.smoothing.t0 = 2;
    EXPECT_EQ(restart(wider, range, std::string(32, '0'), good), ErrorCode::usage);
    // Every truncation of the history is noticed.
    for (std::size_t size = 0; size < good.history.size(); size += 37) {
        Checkpoint cut = good;
        cut.history.resize(size);
        EXPECT_EQ(restart(scene, range, std::string(32, '0'), cut), ErrorCode::io) << size;
    }
    Checkpoint other_state = good;
    other_state.state.low ^= 1;
    EXPECT_EQ(restart(scene, range, std::string(32, '0'), other_state), ErrorCode::io);
}

}  // namespace
}  // namespace nephos
