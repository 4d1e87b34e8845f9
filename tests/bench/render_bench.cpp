// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/render_bench.h"

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <stdexcept>

#include <fmt/core.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include "density/metaballs.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/reader.h"
#include "simulation/framing.h"
#include "simulation/simulation.h"
#include "tests/bench/stage_table.h"
#include "tests/bench/subject.h"

namespace nephos::bench {
namespace {

Subject volume(const DensityGrid& grid, const std::string& name, double extinction_per_m) {
    Subject subject{fmt::format("{}, extinction {}", name, extinction_per_m),
                    metaballs(grid, 2),
                    extinction_per_m,
                    {},
                    2};
    const WorldBox box = cloud_box(grid);
    subject.options.ground.height_m = ground_below(box);
    frame(subject.options.camera, box, View::side, subject.options.ground.height_m);
    return subject;
}

// Time of the processor, all threads: where others use the machine too, it says more than the clock on the
// wall.
template <class F>
double processor_ms(F&& work) {
    const std::clock_t start = std::clock();
    work();
    return 1000.0 * double(std::clock() - start) / CLOCKS_PER_SEC;
}

struct Way {
    Splatting splatting;
    const char* name;
};
constexpr std::array kWays{Way{Splatting::cpu, "vectors on the processor"},
                           Way{Splatting::vulkan, "compute tiles"},
                           Way{Splatting::blended, "compute light and blended billboards"}};

// Of the last picture: from the sorted splats to the pixels.
double splatting_ms(const Renderer& renderer) {
    double sum = 0;
    for (const DrawStage stage : {DrawStage::eye_bins, DrawStage::look, DrawStage::colour, DrawStage::view})
        sum += renderer.times()[stage].processor_ms;
    return sum;
}

// The same picture in all ways, in turn: medians of the processor's time.
std::vector<BenchRow> compare_backends(Subject subject, int rounds) {
    std::vector<Renderer> renderers;
    for (const Way& way : kWays)
        renderers.emplace_back(DeviceOptions{.device = {}, .splatting = way.splatting});
    std::array<std::vector<double>, kWays.size()> times, splatting;
    for (int round = -1; round < rounds; ++round) {
        for (std::size_t w = 0; w < kWays.size(); ++w) {
            subject.change();
            const double ms =
                processor_ms([&] { renderers[w].draw_splats(subject.pixels_only(), subject.options); });
            if (round < 0) continue;
            times[w].push_back(ms);
            splatting[w].push_back(splatting_ms(renderers[w]));
        }
    }
    std::vector<BenchRow> rows;
    for (std::size_t w = 1; w < kWays.size(); ++w) {
        // Against the tiles it is their time that has a target.
        const auto add = [&](const std::string& what, double ours, double other, const std::string& note) {
            if (w == 1)
                rows.push_back({fmt::format("{}, {}: {} on {} against {}", subject.name, what, kWays[w].name,
                                            renderers[w].device_name(), kWays[0].name),
                                other, ours, "<= 1.5x", note});
            else
                rows.push_back({fmt::format("{}, {}: {} against {} on {}", subject.name, what, kWays[0].name,
                                            kWays[w].name, renderers[w].device_name()),
                                ours, other, ">= 20x faster", note});
        };
        add("the same sorted splats, without light", median(splatting[0]), median(splatting[w]),
            "time of the processor, not of the wall");
        add("full frame 640x480", median(times[0]), median(times[w]),
            fmt::format("{} metaballs; time of the processor, not of the wall", subject.balls.size()));
    }
    return rows;
}

void print_stages_of(Subject subject, int rounds) {
    Renderer renderer(DeviceOptions{.device = {}, .splatting = Splatting::cpu});
    const std::string what = fmt::format("{}, {} metaballs", subject.name, subject.balls.size());
    print_stages(what, renderer, rounds, [&] {
        subject.change();
        renderer.draw_splats(subject.pixels_only(), subject.options);
    });
}

// Splats of a cube of noise, as many as wanted, all in view: how the time grows with their number.
void print_growth() {
    fmt::print("| metaballs | processor, ms | ns a metaball and log2 |\n|---|---|---|\n");
    for (const double count : {1e4, 1e5, 1e6, 1e7}) {
        Subject subject{"noise", {}, 0.002, {}, 2};
        subject.balls.reserve(std::size_t(count));
        const float radius = float(2000 * std::cbrt(1 / count) * 1.5);
        std::uint64_t state = 1;
        const auto random = [&state] {  // Knuth's MMIX generator
            state = state * 6364136223846793005u + 1442695040888963407u;
            return float(state >> 40) * 0x1p-24f;
        };
        for (std::size_t i = 0; i < std::size_t(count); ++i) {
            const float x = 2000 * random() - 1000, y = 2000 * random() - 1000, z = 2000 * random();
            subject.balls.push_back({x, y, z, radius, 0.2f + 0.8f * random()});
        }
        subject.options.camera.position_m = {0, -4000, 800};
        Renderer renderer(DeviceOptions{.device = {}, .splatting = Splatting::cpu});
        std::vector<double> times;
        for (int round = -1; round < (count < 1e6 ? 5 : 1); ++round) {
            subject.change();
            const double ms =
                processor_ms([&] { renderer.draw_splats(subject.pixels_only(), subject.options); });
            if (round >= 0) times.push_back(ms);
        }
        fmt::print("| {:.0e} | {:.3g} | {:.3f} |\n", count, median(times),
                   1e6 * median(times) / (count * std::log2(count)));
        std::fflush(stdout);
    }
    fmt::print("\n");
}

// Simulation, density, light and picture of each frame, as a run makes them, on the wall.
BenchRow film_row(const std::filesystem::path& file, int frames) {
    const Scene scene = read_scene(file);
    struct Film : SimulationSink {
        const Scene* scene = nullptr;
        Renderer renderer;
        std::size_t drawn = 0, frames = 0;
        std::chrono::steady_clock::time_point first, last;  // ends of the first and the last frame
        void step(const StepResult&) override {}
        void frame(const FrameResult& result) override {
            const double radius = scene->density.metaball_radius_cells;
            const std::vector<Metaball> balls = metaballs(result.density, radius);
            Splats splats;
            splats.metaballs = {balls, scene->density.extinction_per_m, metaball_normalisation(radius)};
            splats.depth = splats.light = false;
            RenderOptions options = scene->render;
            options.camera.width = 640;
            options.camera.height = 480;
            renderer.draw_splats(splats, options);
            last = std::chrono::steady_clock::now();
            if (++frames == 1) first = last;
            drawn += balls.size();
        }
    } film;
    film.scene = &scene;
    Simulation simulation(scene, range_of_frames(scene, 1, frames), {});
    while (!simulation.finished()) simulation.advance(film);
    const std::chrono::duration<double, std::milli> all = film.last - film.first;
    const double ms = all.count() / double(film.frames - 1);
    return {fmt::format("{}: simulate, density, light and view, 640x480, {}", file.filename().string(),
                        film.renderer.device_name()),
            ms, 0, "<= 33.3 ms",
            fmt::format(
                "{:.1f} frames/s, one after the other, 2 threads; mean of {} frames of {} metaballs in the "
                "mean; one frame in four has a new step",
                1000 / ms, film.frames, film.drawn / film.frames)};
}

double children_ms() {
    rusage usage{};
    ::getrusage(RUSAGE_CHILDREN, &usage);
    const auto ms = [](const timeval& t) { return 1e3 * double(t.tv_sec) + 1e-3 * double(t.tv_usec); };
    return ms(usage.ru_utime) + ms(usage.ru_stime);
}

// A point of the world in the file's axes, of which y is up, as vdb_render takes it.
std::string in_file(const Vec3& p) { return fmt::format("{},{},{}", p.x, p.z, -p.y); }

// The ray-marcher that comes with OpenVDB, with the same file, camera, sun and extinction, all of it
// scattered.
std::vector<BenchRow> against_vdb_render(const std::filesystem::path& file, Subject subject) {
    const std::filesystem::path program = "/usr/bin/vdb_render";
    if (!std::filesystem::exists(program)) {
        fmt::print("without the row of vdb_render: install libopenvdb-tools\n\n");
        return {};
    }
    const Camera& camera = subject.options.camera;
    const double half_height = std::tan(camera.vertical_fov_deg * std::numbers::pi / 360);
    const double across_deg = 360 / std::numbers::pi * std::atan(half_height * camera.width / camera.height);
    const std::filesystem::path out =
        std::filesystem::temp_directory_path() / fmt::format("nephos_bench_{}.ppm", ::getpid());
    const std::string command = fmt::format(
        "{} '{}' {} -cpus 2 -res {}x{} -fov {} -translate {} -lookat {} -light {},0.7,0.7,0.7 -absorb 0,0,0 "
        "-scatter "
        "{},{},{} "
        ">/dev/null 2>&1",
        program.string(), file.string(), out.string(), camera.width, camera.height, across_deg,
        in_file(camera.position_m), in_file(camera.target_m), in_file(direction_to_sun(subject.options.sun)),
        subject.extinction_per_m, subject.extinction_per_m, subject.extinction_per_m);
    Renderer renderer;
    std::vector<double> ours, other;
    for (int round = -1; round < 3; ++round) {
        subject.change();
        const double ms = processor_ms([&] {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 2);
            renderer.draw_splats(subject.pixels_only(), subject.options);
        });
        const double start = children_ms();
        if (std::system(command.c_str()) != 0) throw std::runtime_error("failed: " + command);
        if (round < 0) continue;
        ours.push_back(ms);
        other.push_back(children_ms() - start);
    }
    std::filesystem::remove(out);
    return {{"full frame of the Disney cloud against vdb_render, 2 threads", median(ours), median(other),
             ">= 10x faster",
             fmt::format(
                 "extinction {}; time of the processor, not of the wall; vdb_render also reads the file and "
                 "writes a picture",
                 subject.extinction_per_m)}};
}

void append(std::vector<BenchRow>& rows, const std::vector<BenchRow>& more) {
    rows.insert(rows.end(), more.begin(), more.end());
}

}  // namespace

std::vector<BenchRow> render_rows(const std::filesystem::path& source, const std::filesystem::path& data) {
    const Subject cumulus = last_frame_of(source / "scenes/cumulus.toml");
    print_stages_of(cumulus, 9);
    print_growth();
    std::vector<BenchRow> rows{film_row(source / "scenes/cumulus.toml", 48)};
    append(rows, compare_backends(cumulus, 5));
    const std::filesystem::path disney = data / "wdas_cloud_sixteenth.vdb";
    if (data.empty() || !std::filesystem::exists(disney)) {
        fmt::print(
            "without the rows of the Disney cloud: NEPHOS_TEST_DATA names no folder with "
            "wdas_cloud_sixteenth.vdb\n\n");
        return rows;
    }
    VdbReadOptions reading;
    reading.up_axis = UpAxis::y;
    const DensityGrid grid = read_density(disney, reading);
    for (const double extinction : {0.02, 1.0}) {
        const Subject subject = volume(grid, "Disney cloud", extinction);
        print_stages_of(subject, 9);
        append(rows, compare_backends(subject, 5));
        append(rows, against_vdb_render(disney, subject));
    }
    return rows;
}

}  // namespace nephos::bench
