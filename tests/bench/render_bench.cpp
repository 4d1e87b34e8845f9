// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/render_bench.h"

#include <array>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <stdexcept>

#include <fmt/core.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include "apps/framing.h"
#include "apps/pipeline.h"
#include "apps/sky_picture.h"
#include "density/metaballs.h"
#include "density/vdb_file.h"
#include "scenes/reader.h"

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

// Metaballs and how to look at them.
struct Subject {
    std::string name;
    std::vector<Metaball> balls;
    double extinction_per_m = 0;
    RenderOptions options;
    MetaballCloud cloud() const { return {balls, extinction_per_m, metaball_normalisation(2)}; }
};

// The last density that a pipeline hands out.
struct LastFrame : PipelineSink {
    DensityGrid density;
    void step(const StepResult&) override {}
    void frame(const FrameResult& result) override { density = result.density; }
};

Subject last_frame_of(const std::filesystem::path& file) {
    const Scene scene = read_scene(file);
    const int last = full_range(scene).last_frame;
    Pipeline pipeline(scene, range_of_frames(scene, last, last), {});
    LastFrame frame;
    while (!pipeline.finished()) pipeline.advance(frame);
    Subject subject{file.filename().string(), metaballs(frame.density, 2), scene.density.extinction_per_m,
                    scene.render};
    subject.options.camera.width = 640;
    subject.options.camera.height = 480;
    return subject;
}

Subject volume(const DensityGrid& grid, const std::string& name, double extinction_per_m) {
    Subject subject{
        fmt::format("{}, extinction {}", name, extinction_per_m), metaballs(grid, 2), extinction_per_m, {}};
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
std::vector<BenchRow> compare_ways(const Subject& subject, int rounds) {
    std::vector<Renderer> renderers;
    for (const Way& way : kWays)
        renderers.emplace_back(DeviceOptions{.device = {}, .splatting = way.splatting});
    std::array<std::vector<double>, kWays.size()> times;
    for (int round = -1; round < rounds; ++round) {
        for (std::size_t w = 0; w < kWays.size(); ++w) {
            const double ms = processor_ms([&] { renderers[w].draw(subject.cloud(), subject.options); });
            if (round >= 0) times[w].push_back(ms);
        }
    }
    std::vector<BenchRow> rows;
    for (std::size_t w = 1; w < kWays.size(); ++w)
        rows.push_back(
            {fmt::format("{}, full frame 640x480: {} against {} on {}", subject.name, kWays[0].name,
                         kWays[w].name, renderers[w].device_name()),
             median(times[0]), median(times[w]), ">= 1x faster",
             fmt::format("{} metaballs; time of the processor, not of the wall", subject.balls.size())});
    return rows;
}

BenchRow sky_row() {
    SkyOptions options;
    options.world = {-2000, -2000, 2000, 2000};
    options.base_height_m = {400, 400};
    options.models = {rain_cloud()};
    options.skies = {{"rain", 1, 1100, {{0, 10}}}};
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
            painter.draw(renderer, {}, {&layer, 1}, picture, 0);
        },
        [&] { painter.draw(renderer, {}, {}, picture, 0, false); });
    return {
        fmt::format("T's {} clouds drawn directly, 640x480, {}", drawn.clouds.size(), renderer.device_name()),
        ms, 0, "<= 100 ms",
        fmt::format("{:.1f} frames/s, {} billboards; sky and ground alone {:.1f} ms", 1000 / ms,
                    drawn.billboards.size(), empty_ms)};
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
std::vector<BenchRow> against_vdb_render(const std::filesystem::path& file, const Subject& subject) {
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
        const double ms = processor_ms([&] {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 2);
            renderer.draw(subject.cloud(), subject.options);
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
    std::vector<BenchRow> rows{sky_row()};
    append(rows, compare_ways(last_frame_of(source / "scenes/cumulus.toml"), 5));
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
