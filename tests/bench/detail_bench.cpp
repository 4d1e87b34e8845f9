// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/detail_bench.h"

#include <chrono>
#include <cstddef>
#include <ctime>
#include <span>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <tbb/global_control.h>

#include "render/cloud/cloud_volume.h"
#include "scenes/format/reader.h"
#include "simulation/frame_painter.h"
#include "simulation/simulation.h"
#include "simulation/stage.h"
#include "tests/bench/stage_table.h"
#include "tests/bench/subject.h"

namespace nephos::bench {
namespace {

constexpr int kFirst = 40, kLast = 63;  // frames of cumulus.toml: grown clouds

// The camera 300 m from a cloud, as in tests/realism/cloud_bars.py.
const std::vector<std::string> kNear{"camera.position_m=[-1200, 1600, 1350]", "camera.target_m=[-1200, 2600, 1380]"};

double processor_now_ms() { return 1000.0 * double(std::clock()) / CLOCKS_PER_SEC; }

// Samples, empty space, and all light of clouds that are new, on one thread.
std::vector<BenchRow> preparation_rows(const Scene& scene, std::span<const FrameResult> frames) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    std::vector<double> samples, light;
    std::size_t bricks = 0, bytes = 0, bytes_of_samples = 0;
    for (int round = -1; round < 9; ++round) {
        for (const FrameResult& frame : frames) {
            const DetailedVoxels voxels = voxels_of(scene, frame);
            const double start = processor_now_ms();
            std::vector<CloudVolume> volumes;
            volumes.emplace_back(voxels);
            const double sampled = processor_now_ms();
            light_volumes(volumes, direction_to_sun(scene.render.sun), scene.render.light, true);
            if (round < 0) continue;
            light.push_back(processor_now_ms() - sampled);
            samples.push_back(sampled - start);
            bricks = volumes[0].field.places().size();
            bytes = volumes[0].memory_bytes();
            bytes_of_samples = volumes[0].field.memory_bytes();
        }
    }
    const double voxels = 512.0 * double(bricks);
    return {{"cumulus.toml with detail: preparation of a new cloud, one thread", median(samples) + median(light), 0,
             "<= 150 ms",
             fmt::format("time of the processor; samples and empty space {:.1f} ms, light {:.1f} ms; {} bricks; {:.2f} "
                         "bytes a voxel of half a cell in these (target <= 4), {:.2f} with its light",
                         median(samples), median(light), bricks, double(bytes_of_samples) / voxels,
                         double(bytes) / voxels)}};
}

// Simulation, light and picture as a run makes them: one frame is drawn while the next is simulated.
BenchRow film_row(const std::filesystem::path& file, const std::string& what, std::vector<std::string> overrides,
                  int width, int height, double frames_per_s) {
    overrides.push_back(fmt::format("camera.width={}", width));
    overrides.push_back(fmt::format("camera.height={}", height));
    const Scene scene = read_scene(file, overrides);
    struct Film : SimulationSink {
        FramePainter painter;
        std::vector<std::pair<std::chrono::steady_clock::time_point, double>> drawn;  // when, with processor time
        Stage<FrameResult> drawing;
        explicit Film(const Scene& scene)
            : painter(scene, {.device = {}, .splatting = Splatting::cpu}), drawing(1, true, [this](FrameResult& frame) {
                  painter.draw(frame);
                  drawn.emplace_back(std::chrono::steady_clock::now(), processor_now_ms());
              }) {}
        void step(const StepResult&) override {}
        void frame(const FrameResult& result) override { drawing.add(result); }
    } film(scene);
    Simulation simulation(scene, range_of_frames(scene, kFirst, kLast), {});
    while (!simulation.finished()) simulation.advance(film);
    film.drawing.finish();
    const auto frames = double(film.drawn.size() - 1);
    const std::chrono::duration<double, std::milli> all = film.drawn.back().first - film.drawn.front().first;
    const double ms = all.count() / frames;
    return {fmt::format("cumulus.toml with detail{}: simulate, light and view, {}x{}", what, width, height), ms, 0,
            fmt::format("<= {:g} ms", 1000 / frames_per_s),
            fmt::format("{:.1f} frames/s, mean of {} frames, 2 threads; {:.1f} ms of the processor a frame", 1000 / ms,
                        film.drawn.size(), (film.drawn.back().second - film.drawn.front().second) / frames)};
}

void print_detail_stages(const Scene& scene, std::span<const FrameResult> frames) {
    FramePainter painter(scene, {.device = {}, .splatting = Splatting::cpu});
    std::size_t next = 0;
    print_stages("cumulus.toml with detail", painter.renderer(), 9,
                 [&] { painter.draw(frames[next++ % frames.size()]); });
}

}  // namespace

std::vector<BenchRow> detail_rows(const std::filesystem::path& source) {
    const std::filesystem::path file = source / "scenes/cumulus.toml";
    const std::vector<std::string> size{"camera.width=640", "camera.height=480"};
    const Scene scene = read_scene(file, size);
    const std::vector<FrameResult> frames = frames_of(scene, kFirst, kFirst + 1);
    print_detail_stages(scene, frames);
    std::vector<BenchRow> rows = preparation_rows(scene, frames);
    rows.push_back(film_row(file, "", {}, 640, 480, 20));
    rows.push_back(film_row(file, "", {}, 1280, 720, 8));
    rows.push_back(film_row(file, " 300 m from a cloud", kNear, 640, 480, 10));
    rows.push_back(film_row(file, " 300 m from a cloud", kNear, 1280, 720, 4));
    return rows;
}

}  // namespace nephos::bench
