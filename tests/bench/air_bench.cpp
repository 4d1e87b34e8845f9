// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/air_bench.h"

#include <cstring>
#include <string>

#include <fmt/core.h>
#include <tbb/global_control.h>

#include "render/renderer.h"
#include "scenes/format/reader.h"
#include "tests/bench/subject.h"

namespace nephos::bench {
namespace {

constexpr int kRounds = 15;

std::string name_of(const Renderer& renderer) {
    return renderer.backend_name() == "cpu" ? "processor" : "compute tiles on " + renderer.device_name();
}

// What shells add to a picture whose light is known, against copies of a float frame buffer.
BenchRow shells_row(const Subject& subject, Splatting splatting) {
    Renderer renderer({.splatting = splatting});
    const int shells = subject.options.shells.count;
    RenderOptions clear = subject.options;
    clear.light_shafts.strength = 0;
    const std::size_t floats = 4 * std::size_t(clear.camera.width) * std::size_t(clear.camera.height);
    const std::vector<float> buffer(floats, 1.0f);
    std::vector<float> copy(floats);
    std::vector<double> added, copied;
    for (int round = -1; round < kRounds; ++round) {
        const double with = time_ms([&] { renderer.draw_splats(subject.pixels_only(), subject.options); });
        const double without = time_ms([&] { renderer.draw_splats(subject.pixels_only(), clear); });
        const double copies = time_ms([&] {
            for (int k = 0; k < shells; ++k) {
                std::memcpy(copy.data(), buffer.data(), floats * sizeof(float));
                asm volatile("" : : "r"(copy.data()) : "memory");
            }
        });
        if (round < 0) continue;
        added.push_back(with - without);
        copied.push_back(copies);
    }
    return {fmt::format("{} shells of light shafts, 640x480, {}, against {} copies of a float frame buffer",
                        shells, name_of(renderer), shells),
            median(added), median(copied), "<= 3x", "what a picture with them takes longer, 2 cores"};
}

BenchRow frame_row(Subject subject) {
    Renderer renderer({.splatting = Splatting::cpu});
    std::vector<double> times;
    for (int round = -1; round < kRounds; ++round) {
        subject.change();
        const double ms = time_ms([&] { renderer.draw_splats(subject.pixels_only(), subject.options); });
        if (round >= 0) times.push_back(ms);
    }
    const double ms = median(times);
    return {fmt::format("`shafts.toml`, {} metaballs, {} shells, whole frame, 640x480, 2 cores",
                        subject.balls.size(), subject.options.shells.count),
            ms, 0, "<= 66.7 ms (D: 20 to 30 s)", fmt::format("{:.0f} frames/s, light and all", 1000 / ms)};
}

// Sky, shafts and fog without clouds. Where nothing shades the air, shafts cost what their shells cost.
BenchRow atmosphere_row(const std::filesystem::path& file, Splatting splatting) {
    RenderOptions options = read_scene(file).render;
    options.camera.width = 640;
    options.camera.height = 480;
    options.shells = {40, 20, 1.1};
    Renderer renderer({.splatting = splatting});
    const auto draw = [&] {
        Splats nothing;
        nothing.depth = nothing.light = false;
        renderer.draw_splats(nothing, options);
    };
    std::vector<double> times;
    draw();
    for (int round = 0; round < kRounds; ++round) times.push_back(time_ms(draw));
    return {fmt::format(
                "whole atmosphere (physical sky, 40 shells of shafts and fog) without clouds, 640x480, {}",
                name_of(renderer)),
            median(times), 0, "<= 50 ms", "2 cores"};
}

}  // namespace

std::vector<BenchRow> air_rows(const std::filesystem::path& source) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 2);
    const Subject shafts = last_frame_of(source / "scenes/shafts.toml");
    const std::filesystem::path fog = source / "scenes/fog.toml";
    return {shells_row(shafts, Splatting::cpu), shells_row(shafts, Splatting::vulkan), frame_row(shafts),
            atmosphere_row(fog, Splatting::cpu), atmosphere_row(fog, Splatting::vulkan)};
}

}  // namespace nephos::bench
