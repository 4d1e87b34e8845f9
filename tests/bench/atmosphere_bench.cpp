// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/atmosphere_bench.h"

#include "render/atmosphere/atmosphere.h"
#include "render/renderer.h"

namespace nephos::bench {
namespace {

constexpr int kRounds = 9;

RenderOptions empty_sky(double elevation_deg) {
    RenderOptions options;
    options.atmosphere.model = AirModel::physical;
    options.sun.elevation_deg = elevation_deg;
    options.shadow_map_size = 16;
    return options;
}

// A sun between two heights that have tables needs both; along a path one of them is there already.
double new_sun_ms(double first_deg) {
    const Atmosphere air{AtmosphereModel{}};
    std::vector<double> times;
    for (int round = 0; round < kRounds; ++round)
        times.push_back(time_ms([&] {
            air.sky(300, first_deg + round);
            air.sky(300, first_deg + round + 0.25);
        }));
    return median(times);
}

BenchRow picture_row(Splatting splatting) {
    Renderer renderer({.splatting = splatting});
    renderer.draw({}, empty_sky(30));
    std::vector<double> times;
    for (int round = 0; round < kRounds; ++round)
        times.push_back(time_ms([&] { renderer.draw({}, empty_sky(30)); }));
    return {"whole sky and ground without clouds, 640x480, " + renderer.device_name(), median(times), 0, "<= 50 ms", ""};
}

}  // namespace

std::vector<BenchRow> atmosphere_rows() {
    std::vector<double> made;
    for (int round = 0; round < 3; ++round) made.push_back(time_ms([] { Atmosphere{AtmosphereModel{}}; }));
    return {
        {"sky tables for a new sun by day, both neighbours, all cores", new_sun_ms(5), 0, "<= 20 ms", ""},
        {"the same in twilight", new_sun_ms(-14), 0, "<= 20 ms", ""},
        {"tables that depend on the air alone", median(made), 0, "", "once for each haze, ozone and ground"},
        picture_row(Splatting::cpu),
        picture_row(Splatting::vulkan)};
}

}  // namespace nephos::bench
