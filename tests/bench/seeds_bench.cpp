// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/seeds_bench.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>

#include <tbb/global_control.h>

#include "automaton/automaton.h"
#include "seeds/climate.h"
#include "seeds/coupling.h"
#include "seeds/light_absorption.h"
#include "seeds/rain_finder.h"

namespace nephos::bench {
namespace {

double best_ms(int runs, const std::function<void()>& work) {
    double best = 1e300;
    for (int run = 0; run < runs; ++run) {
        const auto start = std::chrono::steady_clock::now();
        work();
        const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
        best = std::min(best, took.count());
    }
    return best;
}

// `seeds` boxes with `roots` roots each on the first one; T's way of giving a cloud.
BaseModel model_of(std::string name, int seeds, double edge_m, int roots, CountRange reproductions, int start,
                   int end) {
    BaseModel model{.name = std::move(name), .genus = Genus::Cu, .seeds = {}, .light_distance_m = 100};
    for (int s = 0; s < seeds; ++s) {
        Seed seed;
        seed.size_m = {edge_m, edge_m, edge_m};
        seed.position_m = {edge_m * 0.8 * (s % 3), edge_m * 0.8 * (s / 3 % 3), edge_m * 0.6 * (s / 9)};
        if (s == 0) {
            for (int r = 0; r < roots; ++r) {
                seed.roots.push_back({.pitch_deg = 30,
                                      .yaw_deg = 180.0 * r,
                                      .seeds_start = start,
                                      .seeds_end = end,
                                      .reproductions = reproductions});
            }
        }
        model.seeds.push_back(seed);
    }
    return model;
}

BenchRow reproduction_row() {
    const BaseModel model = model_of("thirty", 1, 10, 1, {5, 5}, 4, 8);  // 1 + 4 + 5 + 6 + 7 + 8 = 31 boxes
    std::size_t boxes = 0;
    double sum = 0;
    const double ms = best_ms(5, [&] {
        boxes = 0;
        for (std::uint32_t number = 0; boxes < 1'000'000; ++number) {
            const Cloud cloud = reproduce(model, 1, 0, number);
            boxes += cloud.boxes.size();
            sum += cloud.radius_m;
        }
    });
    return {"reproduce " + std::to_string(boxes) + " seed boxes, 1 core", ms, 0, "<= 200 ms",
            "mean radius " + std::to_string(sum / double(5 * boxes) * 31) + " m"};
}

BenchRow absorption_row() {
    const BaseModel model = model_of("thirty", 5, 10, 1, {5, 5}, 4, 6);  // 30 boxes
    std::vector<Cloud> clouds;
    for (std::uint32_t number = 0; number < 1000; ++number) clouds.push_back(reproduce(model, 1, 0, number));
    std::vector<double> absorbed(clouds[0].boxes.size());
    double sum = 0;
    const double ms = best_ms(10, [&] {
        for (const Cloud& cloud : clouds) {
            absorb_light(cloud, {}, {{0.3, 0.4, 0.8}, true}, absorbed);
            sum += absorbed[0];
        }
    });
    return {"light absorption of 1000 clouds of " + std::to_string(absorbed.size()) + " seeds, 1 core", ms, 0,
            "<= 20 ms", "mean absorbed " + std::to_string(sum / 10000)};
}

// T's table of skies for the climate variation: 50..100 clouds above, 100..400 below.
SkyOptions layer_of(bool upper) {
    SkyOptions o;
    o.name = upper ? "upper" : "lower";
    o.layer = upper ? 1 : 0;
    o.world = {0, 0, 12800, 12800};
    o.base_height_m = upper ? Range{4000, 4000} : Range{1000, 1000};
    o.models = {model_of("cloud 1", 6, 200, 1, {1, 2}, 2, 3), model_of("cloud 2", 9, 100, 1, {2, 4}, 2, 3),
                model_of("cloud 3", 9, 100, 2, {2, 3}, 2, 4), model_of("cloud 4", 8, 100, 2, {2, 3}, 2, 3)};
    if (upper) {
        o.skies = {{"1", 0, 50, {{0, 10}}}, {"2", 0.5, 100, {{0, 10}}}};
    } else {
        o.skies = {{"1", 0, 100, {{2, 10}, {3, 10}, {0, 10}}},
                   {"2", 0.5, 200, {{2, 10}, {3, 10}, {0, 10}}},
                   {"3", 1, 400, {{1, 10}, {2, 10}}}};
    }
    o.schedule = straight_schedule(0, 1, 1000);
    o.wind = {{{0, {{0, {8, 3}}, {5000, {15, 8}}}}}};
    return o;
}

std::vector<BenchRow> sky_rows() {
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    std::vector<SkySimulation> skies;
    std::vector<Automaton> automata;
    for (bool upper : {false, true}) {
        const SkyOptions& options = skies.emplace_back(layer_of(upper)).options();
        AutomatonOptions lattice;
        lattice.extent = {256, 256, 20};
        lattice.placement = {{0, 0, options.base_height_m.min}, 50};
        lattice.wind = options.wind;
        automata.emplace_back(lattice);
    }
    const CouplingOptions coupling{.min_semi_axis_m = 75};
    // In the full storm, where most clouds are: the worst case.
    for (SkySimulation& sky : skies) {
        for (int step = 0; step < 150; ++step) sky.step();
    }
    std::size_t clouds = 0, ellipsoids = 0;
    double climate_ms = 1e300, all_ms = 1e300;
    for (int run = 0; run < 30; ++run) {
        clouds = ellipsoids = 0;
        double climate = 0;
        const double all = best_ms(1, [&] {
            for (std::size_t layer = 0; layer < skies.size(); ++layer) {
                std::vector<ActiveEllipsoid> list;
                climate += best_ms(1, [&] {
                    skies[layer].step();
                    list = ellipsoids_of(skies[layer], coupling);
                });
                clouds += skies[layer].clouds().size();
                ellipsoids += list.size();
                automata[layer].set_external_ellipsoids(std::move(list));
                automata[layer].step();
            }
        });
        climate_ms = std::min(climate_ms, climate);
        all_ms = std::min(all_ms, all);
    }
    const std::string note =
        std::to_string(clouds) + " clouds, " + std::to_string(ellipsoids) + " ellipsoids";
    RainFinder finder({}, {256, 256, 20}, automata[0].options().placement, {});
    const double rain_ms = best_ms(10, [&] { finder.update(automata[0].cld(), 10, 0, 0); });
    return {{"rain areas of 256x256x20 cells, 1 core", rain_ms, 0, "",
             std::to_string(finder.areas().size()) + " areas"},
            {"step of T's two-layer sky, climate and ellipsoids, 1 core", climate_ms, 0, "", note},
            {"step of T's two-layer sky with automaton, 2 x 256x256x20, 1 core", all_ms, 0, "<= 5 ms", note}};
}

}  // namespace

std::vector<BenchRow> seeds_rows() {
    std::vector<BenchRow> rows{reproduction_row(), absorption_row()};
    for (BenchRow& row : sky_rows()) rows.push_back(std::move(row));
    return rows;
}

}  // namespace nephos::bench
