// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/rain_bench.h"

#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/core.h>
#include <tbb/global_control.h>

#include "core/error.h"
#include "render/rain/particles.h"
#include "render/rain/precipitation.h"
#include "render/renderer.h"

namespace nephos::bench {
namespace {

BenchRow update_row() {
    constexpr std::size_t kDrops = 1'000'000, kFloats = 8;  // five that are read, three that are written
    const Particles drops = make_particles(PrecipitationKind::rain, 1, kDrops);
    std::vector<float> places(3 * kDrops), data(kFloats * kDrops, 1.0f), copy(kFloats * kDrops);
    ParticleBoxes boxes;
    const auto [ours, other] = interleave(
        21,
        [&] {
            boxes.time_s += 1.0 / 24;
            place_particles(drops, boxes, 0, kDrops, &places[0], &places[kDrops], &places[2 * kDrops]);
        },
        [&] { std::memcpy(copy.data(), data.data(), copy.size() * sizeof(float)); });
    return {"update of 1,000,000 drops, against memcpy of their data", ours, other, "<= 2x",
            "32 bytes a drop: phases, reach, speed, place"};
}

Picture empty_picture(const Camera& camera) {
    Picture picture;
    picture.width = camera.width;
    picture.height = camera.height;
    picture.beauty.assign(3 * picture.pixels(), 0.3f);
    picture.transmittance.assign(picture.pixels(), 1.0f);
    picture.depth_m.assign(picture.pixels(), std::numeric_limits<float>::infinity());
    return picture;
}

BenchRow picture_row() {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 2);
    RenderOptions options;
    options.camera.position_m = {0, 0, 2};
    options.camera.target_m = {0, 100, 10};
    options.precipitation.enabled = true;
    options.precipitation.shafts = 0;
    Weather weather;
    weather.curtains.emplace_back();
    weather.curtains.back().base_m = 1000;
    weather.curtains.back().rate_mm_per_h = 20;
    Picture picture = empty_picture(options.camera);
    PrecipitationPainter painter;
    double time_s = 0;
    const auto [ours, other] = interleave(
        15, [&] { painter.draw(picture, options, weather, time_s += 1.0 / 24); }, [] {});
    return {"P's 50,000 particles, 640x480, 2 cores: places, streaks and picture", ours, 0, "<= 16.7 ms",
            fmt::format("{:.0f} frames/s; {} streaks in the picture", 1000 / ours, painter.streaks())};
}

// A storm's curtains over the whole picture, with clouds' shadow on them.
BenchRow shafts_row() {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 2);
    RenderOptions options;
    options.camera.position_m = {0, -9000, 600};
    options.camera.target_m = {0, 0, 900};
    options.camera.vertical_fov_deg = 12;
    options.precipitation.enabled = true;
    options.precipitation.particles = 0;
    Weather weather;
    RainCurtain curtain;
    curtain.semi_a_m = 4000;
    curtain.semi_b_m = 3000;
    curtain.base_m = 2500;
    curtain.ground_m = -500;
    curtain.rate_mm_per_h = 10;
    curtain.lean_x = 0.2;
    weather.curtains = {curtain};
    Picture picture = empty_picture(options.camera);
    picture.shadow_size = 256;
    picture.shadow.assign(256 * 256, 0.4f);
    picture.shadow_frame = {{-10'000, -10'000, 0}, {20'000, 0, 0}, {0, 20'000, 0}, {0, 0, -1}};
    PrecipitationPainter painter;
    double time_s = 0;
    const auto [ours, other] = interleave(
        15, [&] { painter.draw(picture, options, weather, time_s += 1.0 / 24); }, [] {});
    return {"rain shafts that fill the picture, 640x480, 2 cores", ours, 0, "<= 10 ms", ""};
}

// The same drops on a Vulkan device, against the picture without them.
std::vector<BenchRow> device_rows() {
    std::optional<Renderer> renderer;
    try {
        DeviceOptions options;
        options.splatting = Splatting::vulkan;
        renderer.emplace(options);
    } catch (const Error& error) {
        if (error.code() != ErrorCode::gpu) throw;
        return {};
    }
    RenderOptions options;
    options.camera.position_m = {0, 0, 2};
    options.camera.target_m = {0, 100, 10};
    options.precipitation.enabled = true;
    Rainfall rain{options, {}, 0};
    rain.weather.curtains.emplace_back();
    rain.weather.curtains.back().base_m = 1000;
    rain.weather.curtains.back().rate_mm_per_h = 20;
    const auto [ours, other] = interleave(
        5,
        [&] {
            rain.time_s += 1.0 / 24;
            renderer->draw_splats({}, options, {}, rain);
        },
        [&] { renderer->draw_splats({}, options); });
    return {{"50,000 particles and shafts on the device, against the picture without", ours, other, "",
             renderer->device_name()}};
}

}  // namespace

std::vector<BenchRow> rain_rows() {
    std::vector<BenchRow> rows{update_row(), picture_row(), shafts_row()};
    for (BenchRow& row : device_rows()) rows.push_back(std::move(row));
    return rows;
}

}  // namespace nephos::bench
