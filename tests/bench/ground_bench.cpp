// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/ground_bench.h"

#include <cmath>
#include <cstring>
#include <memory>

#include <tbb/parallel_for.h>

#include "render/frame/frame_data.h"
#include "render/ground/ripples.h"
#include "render/ground/wet_ground.h"
#include "render/options/camera.h"
#include "render/terrain/terrain.h"
#include "render/terrain/terrain_view.h"
#include "seeds/ground_cover.h"

namespace nephos::bench {
namespace {

constexpr int kRounds = 15;

// A copy of so many bytes in all, half of them read and half written.
class Copy {
  public:
    explicit Copy(std::size_t bytes) : from_(bytes / 2, std::byte{1}), to_(bytes / 2) {}
    void operator()() { std::memcpy(to_.data(), from_.data(), from_.size()); }

  private:
    std::vector<std::byte> from_, to_;
};

RainArea shower() {
    RainArea area;
    area.x_m = area.y_m = 6000;
    area.semi_a_m = 5000;
    area.semi_b_m = 4000;
    return area;
}

BenchRow cover_row() {
    GroundCoverOptions options;
    options.initial_snow_mm = 1;
    GroundCover cover(options, PrecipitationKind::rain, {0, 0, 12000, 12000});
    const RainArea area = shower();
    const FallingRain falling[] = {{{&area, 1}, {}}};
    const std::size_t texels = cover.map().water_mm.size();
    Copy copy(6 * sizeof(float) * texels);
    const auto [ours, other] = interleave(
        kRounds,
        [&] {
            cover.advance(10);
            cover.expose(falling);
        },
        copy);
    return {"step of the ground's cover, 256x256, a shower over half of it, against copying its three maps",
            ours, other, "", "two exponentials a texel where it rains"};
}

BenchRow ripples_row() {
    Copy copy(4 * sizeof(float) * kRippleTexels * kRippleTexels *
              std::size_t(kRippleMemory_s / kRippleStep_s));
    double time_s = 100, sum = 0;
    const auto [ours, other] = interleave(
        kRounds, [&] { sum += ripple_slopes(time_s += 0.04, 10).variance; },
        [&] {
            copy();
            sum += 1;
        });
    return {
        "ripples of 10 mm/h at a time, 128x128 and 133 steps from rest, against copying what the steps touch",
        ours, other, "", std::isfinite(sum) ? "a pure function of time" : "not finite"};
}

// Half of it water that mirrors a sky with ripples, half soil.
BenchRow overlay_row() {
    RenderOptions options;
    options.camera.position_m = {0, 0, 2};
    options.camera.target_m = {0, 100, -60};
    Picture picture = blank_picture(options);
    for (float& share : picture.transmittance) share = 1;
    GroundCoverView cover;
    cover.outside.water_mm = 2;
    cover.outside_rain_mm_per_h = 10;
    const Camera below = mirrored_camera(options);
    RenderOptions mirrored_options = options;
    mirrored_options.camera = below;
    Picture sky = blank_picture(mirrored_options);
    for (float& value : sky.beauty) value = 0.5f;
    for (float& share : sky.transmittance) share = 1;
    const std::vector<float> light(16 * 16, 1.0f);
    picture.shadow_frame = {{-1e4, -1e4, 0}, {2e4, 0, 0}, {0, 2e4, 0}, {0, 0, -1}};
    Copy copy(7 * sizeof(float) * picture.pixels() + 4 * sizeof(float) * sky.pixels());
    const auto [ours, other] = interleave(
        kRounds,
        [&] {
            const MirrorView mirror = mirror_view(sky, below);
            draw_wet_ground({options, cover, nullptr, 12.5, &mirror, light.data(), 16}, picture);
        },
        copy);
    return {
        "wet ground in a picture of 640x480 full of it, with its ripples, against copying picture and mirror",
        ours, other, "", "without drawing the mirrored view"};
}

// Rays of a picture that meet mountains, against steps of half a cell along each of them.
BenchRow terrain_row() {
    RenderOptions options;
    options.terrain.relief = Relief::ridges;
    options.terrain.cells = 1024;
    options.ground.height_m = -1;
    const std::shared_ptr<const HeightMap> map = make_terrain(options.terrain, options.ground);
    options.camera.above_ground = true;
    options.camera.position_m = {0, -15'000, 300};
    options.camera.target_m = {0, 0, 0};
    options.camera = standing_camera(options.camera, map.get(), options.ground, 0);
    const CameraFrame frame = camera_frame(options.camera);
    double sum = 0;
    const auto by_steps = [&] {
        tbb::parallel_for(0, options.camera.height, [&](int y) {
            for (int x = 0; x < options.camera.width; ++x) {
                const Vec3 way = pixel_ray(frame, options.camera, x + 0.5, y + 0.5), &eye = options.camera.position_m;
                double t = 0;
                while (t < 60'000 && eye.z + t * way.z > height_at(*map, eye.x + t * way.x, eye.y + t * way.y))
                    t += 0.5 * map->step_x_m;
            }
        });
    };
    const auto [ours, other] =
        interleave(3, [&] { sum += double(terrain_view(*map, options, 0).distance_m.front()); }, by_steps);
    return {"rays of a picture of 640x480 that meet a height map of 1024x1024, against steps of half a cell", ours, other, "",
            std::isfinite(sum) ? "exact, where steps miss crests" : "not finite"};
}

}  // namespace

std::vector<BenchRow> ground_rows() { return {cover_row(), ripples_row(), overlay_row(), terrain_row()}; }

}  // namespace nephos::bench
