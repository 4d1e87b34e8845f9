// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/study_bench.h"

#include "statistics/cloud_statistics.h"
#include "statistics/clouds.h"
#include "statistics/structure.h"
#include "study/packed_series.h"
#include "study/records.h"
#include "study/run_statistics.h"
#include <fmt/format.h>
#include <tbb/global_control.h>

#include "automaton/automaton.h"

namespace nephos::bench {
namespace {

constexpr int kSteps = 300, kRounds = 5;

// The field of docs/research.md.
Scene fair_scene() {
    Scene scene;
    scene.name = "fair";
    scene.automaton.extent = {256, 128, 20};
    scene.automaton.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
    scene.automaton.initial = InitialState::empty;
    scene.automaton.field.background = {0.003, 1e-4, 0.12};
    scene.frames.enabled = false;
    return scene;
}

void step_alone(const Scene& scene) {
    Automaton automaton(scene.automaton);
    for (int n = 0; n < kSteps; ++n) automaton.step();
}

BenchRow sweep_row(int clouds_every, const std::string& what, const std::string& target) {
    const Scene scene = fair_scene();
    SweepOptions options;
    options.steps = {kSteps, kSteps, {}};
    options.clouds_every = clouds_every;
    const auto [ours, other] = interleave(
        kRounds, [&] { run_for_statistics(scene, options, false); }, [&] { step_alone(scene); },
        Clock::processor);
    return {"a run of a sweep, 256x128x20 x 300 steps, " + what + ", against its steps alone", ours, other,
            target, ""};
}

// A run whose clouds are followed against one whose clouds are not.
BenchRow tracks_row() {
    const Scene scene = fair_scene();
    SweepOptions options;
    options.steps = {kSteps, kSteps, {}};
    SweepOptions with_tracks = options;
    with_tracks.tracks = true;
    const auto [ours, other] = interleave(
        kRounds, [&] { run_for_statistics(scene, with_tracks, false); },
        [&] { run_for_statistics(scene, options, false); }, Clock::processor);
    return {"a run of a sweep with tracks of clouds, 256x128x20 x 300 steps, against one without", ours,
            other, "<= 1.40x", ""};
}

// What `run --statistics-only` does at every step against what `hash` does.
BenchRow statistics_only_row() {
    const Scene scene = fair_scene();
    std::uint64_t kept = 0;
    const auto each_step = [&](auto&& look) {
        Automaton automaton(scene.automaton);
        for (int n = 0; n < kSteps; ++n) {
            automaton.step();
            look(automaton);
        }
    };
    const auto [ours, other] = interleave(
        kRounds,
        [&] {
            each_step([&](const Automaton& a) {
                kept += cloud_statistics(count_cloud(a.cld(), scene.automaton.boundaries),
                                         scene.automaton.placement)
                            .cld;
                kept += a.hash().low;
            });
        },
        [&] { each_step([&](const Automaton& a) { kept += a.hash().low; }); }, Clock::processor);
    return {"statistics of every step and its hash, 256x128x20 x 300 steps, against the hash alone", ours,
            other, "<= 1.1x", kept == 0 ? "nothing was measured" : ""};
}

// Series of a run as a sweep stores them, against its steps; the note has their bytes.
BenchRow series_row() {
    const Scene scene = fair_scene();
    SweepOptions options;
    options.steps = {kSteps, kSteps, {}};
    const RunResult run = run_for_statistics(scene, options, false);  // of a point one run has a thumbnail
    const PlannedRun planned{std::string(32, '0'), 0, 0, 0, 1, {"0.12"}};
    std::size_t series = 0, record = 0;
    const auto [ours, other] = interleave(
        kRounds,
        [&] {
            const std::string packed = pack_series(run.series, run.scales);
            series = packed.size();
            record = record_line(planned, run, 0, packed).size();
        },
        [&] { step_alone(scene); }, Clock::processor);
    // The tables keep the series once more, as they are.
    const std::size_t all = series + record + run.series.size() * sizeof(float);
    return {"storing a run of 300 steps, against its steps alone", ours, other, "<= 0.05x",
            fmt::format("{} bytes of series, {} of the record; {} with series.nc (target <= 15,000)", series,
                        record, all)};
}

// One statistic, on the last of the states, against a step.
template <typename Measure>
BenchRow state_row(const std::string& what, const std::string& target, Measure&& measure) {
    const Scene scene = fair_scene();
    Automaton automaton(scene.automaton), other(scene.automaton);
    for (int n = 0; n < kSteps; ++n) automaton.step();
    for (int n = 0; n < kSteps; ++n) other.step();
    constexpr int kRepeat = 50;
    const auto [ours, theirs] = interleave(
        kRounds,
        [&] {
            for (int n = 0; n < kRepeat; ++n) measure(automaton);
        },
        [&] {
            for (int n = 0; n < kRepeat; ++n) other.step();
        },
        Clock::processor);
    return {what + " of a state of 256x128x20, against a step", ours / kRepeat, theirs / kRepeat, target, ""};
}

}  // namespace

std::vector<BenchRow> study_rows() {
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    const Boundaries boundaries = fair_scene().automaton.boundaries;
    std::uint64_t kept = 0;  // so that no work is left out
    std::vector<BenchRow> rows;
    rows.push_back(sweep_row(0, "statistics of every step", "<= 1.05x"));
    rows.push_back(sweep_row(10, "and clouds, correlation and overlap of every tenth", "<= 1.10x"));
    rows.push_back(tracks_row());
    rows.push_back(statistics_only_row());
    rows.push_back(series_row());
    rows.push_back(state_row("cover, profile, base, top and edge", "<= 0.1x",
                             [&](const Automaton& a) { kept += count_cloud(a.cld(), boundaries).edges; }));
    rows.push_back(state_row("sizes of 2-D clouds, a tenth of a snapshot", "<= 0.1x with all of every step",
                             [&](const Automaton& a) {
                                 if (++kept % 10 == 0)
                                     kept += 10 * cloud_sizes_2d(a.cld(), boundaries).size();
                             }));
    rows.push_back(state_row("3-D clouds, a tenth of a snapshot", "<= 0.1x more", [&](const Automaton& a) {
        if (++kept % 10 == 0) kept += 10 * clouds_3d(a.cld(), boundaries).size();
    }));
    rows.back().note = kept == 0 ? "nothing was measured" : "";
    return rows;
}

}  // namespace nephos::bench
