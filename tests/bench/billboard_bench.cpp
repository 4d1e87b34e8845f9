// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/billboard_bench.h"

#include <string>

#include <fmt/core.h>

#include "simulation/sky_picture.h"
#include "tests/bench/stage_table.h"

namespace nephos::bench {
namespace {

// T's Cloud 2, that of the rain clouds, with T's numbers: 9 boxes of 10 m, one root with 2 to 3 children in
// each of 2 to 4 reproductions, 4 to 5 billboards a box of 30 to 50 m, light distance 100 m.
BaseModel rain_cloud() {
    BaseModel model{.name = "cloud 2", .genus = Genus::Ns, .seeds = {}, .light_distance_m = 100};
    for (int i = 0; i < 9; ++i) {
        Seed seed;
        seed.size_m = {10, 10, 10};
        seed.position_m = {10.0 * (i % 3 - 1), 10.0 * (i / 3 - 1), i == 4 ? 12.0 : 5.0};
        seed.billboards = {4, 5};
        seed.billboard_width_m = {30, 50};
        seed.billboard_height_m = {30, 50};
        seed.texture = BillboardTexture::dense;
        if (i == 4)
            seed.roots = {{.pitch_deg = 45,
                           .open_pitch_deg = 90,
                           .open_yaw_deg = 179,
                           .seeds_start = 2,
                           .seeds_end = 3,
                           .reproductions = {2, 4}}};
        model.seeds.push_back(seed);
    }
    return model;
}

SkyOptions sky_options(int clouds) {
    SkyOptions options;
    options.world = {-2000, -2000, 2000, 2000};
    options.base_height_m = {400, 400};
    options.models = {rain_cloud()};
    options.skies = {{"rain", 1, clouds, {{0, 10}}}};
    return options;
}

BenchRow sky_row(int clouds) {
    const SkySimulation sky(sky_options(clouds));
    const SkyLayer layer{&sky, sky.clouds()};
    RenderOptions picture;
    picture.camera.position_m = {0, -4600, 100};  // the whole world is in view
    picture.camera.target_m = {0, 0, 350};
    picture.camera.vertical_fov_deg = 50;
    Renderer renderer;
    SkyPainter painter, empty_painter;  // a painter keeps what it strewed
    SkyBillboards counter;
    DrawnClouds drawn;
    counter.append(sky, sky.clouds(), picture, {}, drawn);
    const std::string what = fmt::format("T's {} clouds drawn directly", drawn.clouds.size());
    const auto draw = [&] { painter.draw(renderer, {}, {&layer, 1}, picture, 0, false); };
    const auto [ms, empty_ms] =
        interleave(21, draw, [&] { empty_painter.draw(renderer, {}, {}, picture, 0, false); });
    print_stages(fmt::format("{}, {} billboards", what, drawn.billboards.size()), renderer, 21, draw);
    return {fmt::format("{}, 640x480, {}", what, renderer.device_name()), ms, 0, "<= 16.7 ms",
            fmt::format("{:.1f} frames/s, {} billboards; sky and ground alone {:.1f} ms", 1000 / ms,
                        drawn.billboards.size(), empty_ms)};
}

}  // namespace

std::vector<BenchRow> billboard_rows() { return {sky_row(202), sky_row(1010)}; }

}  // namespace nephos::bench
