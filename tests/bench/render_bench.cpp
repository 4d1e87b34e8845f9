// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/render_bench.h"

#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <numbers>
#include <stdexcept>

#include <fmt/core.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include "apps/framing.h"
#include "apps/pipeline.h"
#include "apps/sky_picture.h"
#include "density/metaballs.h"
#include "density/vdb_file.h"
#include "scenes/reader.h"
#include "tests/bench/subject.h"

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
constexpr std::array kWays{Way{Splatting::processor, "vectors on the processor"},
                           Way{Splatting::tiles, "compute tiles"},
                           Way{Splatting::billboards, "compute light and blended billboards"}};

// The same picture in all ways, in turn: medians of the processor's time.
std::vector<BenchRow> compare_ways(Subject subject, int rounds) {
    std::vector<Renderer> renderers;
    for (const Way& way : kWays)
        renderers.emplace_back(DeviceOptions{.device = {}, .splatting = way.splatting});
    std::array<std::vector<double>, kWays.size()> times;
    for (int round = -1; round < rounds; ++round) {
        for (std::size_t w = 0; w < kWays.size(); ++w) {
            subject.change();
            const double ms =
                processor_ms([&] { renderers[w].draw_splats(subject.pixels_only(), subject.options); });
            if (round >= 0) times[w].push_back(ms);
        }
    }
    std::vector<BenchRow> rows;
    for (std::size_t w = 1; w < kWays.size(); ++w)
        rows.push_back(
            {fmt::format("{}, full frame 640x480: {} against {} on {}", subject.name, kWays[0].name,
                         kWays[w].name, renderers[w].device_name()),
             median(times[0]), median(times[w]), w == 1 ? ">= 0.67x faster" : ">= 20x faster",
             fmt::format("{} metaballs; time of the processor, not of the wall", subject.balls.size())});
    return rows;
}

BenchRow sky_row(int clouds) {
    SkyOptions options;
    options.world = {-2000, -2000, 2000, 2000};
    options.base_height_m = {400, 400};
    options.models = {rain_cloud()};
    options.skies = {{"rain", 1, clouds, {{0, 10}}}};
    const SkySimulation sky(options);
    const SkyLayer layer{&sky, sky.clouds()};
    RenderOptions picture;
    picture.camera.position_m = {0, -4600, 100};  // the whole world is in view
    picture.camera.target_m = {0, 0, 350};
    picture.camera.vertical_fov_deg = 50;
    Renderer renderer;
    SkyPainter painter;
    SkyBillboards counter;
    DrawnClouds drawn;
    counter.append(sky, sky.clouds(), picture, {}, drawn);
    const auto [ms, empty_ms] = interleave(
        9,
        [&] {
            painter.draw(renderer, {}, {&layer, 1}, picture, 0, false);
        },
        [&] { painter.draw(renderer, {}, {}, picture, 0, false); });
    return {
        fmt::format("T's {} clouds drawn directly, 640x480, {}", drawn.clouds.size(), renderer.device_name()),
        ms, 0, "<= 16.7 ms",
        fmt::format("{:.1f} frames/s, {} billboards; sky and ground alone {:.1f} ms", 1000 / ms,
                    drawn.billboards.size(), empty_ms)};
}

// Bytes that both threads together copy in a nanosecond, read and written.
double copied_bytes_per_ns() {
    constexpr std::size_t kBytes = std::size_t{1} << 26;
    std::vector<std::byte> from(kBytes, std::byte{1}), to(kBytes);
    std::vector<double> times;
    for (int round = 0; round < 7; ++round) {
        times.push_back(time_ms([&] {
            tbb::parallel_for(std::size_t{0}, std::size_t{64}, [&](std::size_t part) {
                std::memcpy(&to[part * kBytes / 64], &from[part * kBytes / 64], kBytes / 64);
            });
        }));
    }
    return 2 * double(kBytes) / (1e6 * median(times));
}

// Where the time of a picture goes, and how far each stage is from what memory or vector units allow.
void print_stages(Subject subject, int rounds) {
    constexpr std::array<const char*, kDrawStages> kNames{"has it changed, checks",
                                                          "order from the eye",
                                                          "shapes and bins for the eye",
                                                          "what is seen",
                                                          "order from the sun",
                                                          "bins for the light",
                                                          "light",
                                                          "what scatters",
                                                          "pixels"};
    Renderer renderer(DeviceOptions{.device = {}, .splatting = Splatting::processor});
    std::array<std::vector<double>, kDrawStages> wall, processor;
    StageTimes last;
    for (int round = -1; round < rounds; ++round) {
        subject.change();
        renderer.draw_splats(subject.pixels_only(), subject.options);
        last = renderer.times();
        for (std::size_t s = 0; round >= 0 && s < kDrawStages; ++s) {
            wall[s].push_back(last.stages[s].wall_ms);
            processor[s].push_back(last.stages[s].processor_ms);
        }
    }
    const double copied = copied_bytes_per_ns();
    fmt::print(
        "Stages of {}, {} metaballs, 640x480; memory copies {:.1f} GB/s\n\n"
        "| stage | wall, ms | processor, ms | MB moved | against copying them | pairs, millions | ns a pair "
        "|\n|---|---|---|---|---|---|---|\n",
        subject.name, subject.balls.size(), copied);
    for (std::size_t s = 0; s < kDrawStages; ++s) {
        const StageTime& time = last.stages[s];
        const double ms = median(wall[s]), mega = 1e-6 * double(time.bytes),
                     pairs = 1e-6 * double(time.pairs);
        fmt::print("| {} | {:.2f} | {:.2f} | {} | {} | {} | {} |\n", kNames[s], ms, median(processor[s]),
                   time.bytes != 0 ? fmt::format("{:.1f}", mega) : "",
                   time.bytes != 0 ? fmt::format("{:.1f}x", ms * copied / mega) : "",
                   time.pairs != 0 ? fmt::format("{:.2f}", pairs) : "",
                   time.pairs != 0 ? fmt::format("{:.3f}", median(processor[s]) / pairs) : "");
    }
    fmt::print("\n");
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
        Renderer renderer(DeviceOptions{.device = {}, .splatting = Splatting::processor});
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
    struct Film : PipelineSink {
        const Scene* scene = nullptr;
        Renderer renderer;
        std::vector<double> times;
        std::chrono::steady_clock::time_point last = std::chrono::steady_clock::now();
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
            const auto now = std::chrono::steady_clock::now();
            times.push_back(std::chrono::duration<double, std::milli>(now - last).count());
            last = now;
        }
    } film;
    film.scene = &scene;
    Pipeline pipeline(scene, range_of_frames(scene, 1, frames), {});
    while (!pipeline.finished()) pipeline.advance(film);
    const double ms = median(film.times);
    return {fmt::format("{}: simulate, density, light and view, 640x480, {}", file.filename().string(),
                        film.renderer.device_name()),
            ms, 0, "<= 33.3 ms", fmt::format("{:.1f} frames/s, one after the other, 2 threads", 1000 / ms)};
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
    print_stages(cumulus, 9);
    print_growth();
    std::vector<BenchRow> rows{sky_row(202), sky_row(1010), film_row(source / "scenes/cumulus.toml", 48)};
    append(rows, compare_ways(cumulus, 5));
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
        append(rows, compare_ways(subject, 5));
        append(rows, against_vdb_render(disney, subject));
    }
    return rows;
}

}  // namespace nephos::bench
