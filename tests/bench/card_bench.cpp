// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/card_bench.h"

#include <array>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "scenes/format/reader.h"
#include "simulation/frame_painter.h"
#include "tests/bench/subject.h"

namespace nephos::bench {
namespace {

constexpr int kFirst = 40, kLast = 47;  // frames of cumulus.toml: grown clouds
constexpr std::array kSizes{std::pair{640, 480}, std::pair{1280, 720}, std::pair{1920, 1080}};

// The camera 300 m from a cloud, as in tests/realism/cloud_bars.py.
constexpr Vec3 kNearEye{-1200, 1600, 1350}, kNearTarget{-1200, 2600, 1380};

enum class Flight { level, climbing };  // another height of the eye has another sky

void fly(Camera& camera, Flight flight) {
    (flight == Flight::level ? camera.position_m.x : camera.position_m.z) += 0.1;
}

// Milliseconds a picture, one drawn while the next is begun. Each has another camera, and its cloud is another where
// `changes`.
double picture_ms(Renderer& renderer, const Subject& subject, bool changes, Flight flight = Flight::level) {
    const int pictures = renderer.backend_name() == "cpu" ? 8 : 32;  // of a round
    std::vector<double> rounds;
    Camera camera = subject.options.camera;
    // Two frames are in flight, and a cloud must not change until its frame is finished.
    std::array<Subject, 2> subjects{subject, subject};
    for (int round = -1; round < 3; ++round) {
        const double ms = time_ms([&] {
            std::optional<PendingPicture> before;
            for (int i = 0; i < pictures; ++i) {
                Subject& now = subjects[std::size_t(i) % 2];
                if (changes) now.balls.front().density *= 0.99f - 0.01f * float(i % 2);
                fly(camera, flight);
                now.options.camera = camera;
                PendingPicture next = renderer.begin(now.pixels_only(), now.options);
                if (before) renderer.finish(std::move(*before));
                before.emplace(std::move(next));
            }
            renderer.finish(std::move(*before));
        });
        if (round >= 0) rounds.push_back(ms / pictures);
    }
    return median(rounds);
}

// Density, light and view of clouds that are new in every frame, as a run draws them.
double film_ms(const Scene& scene, Splatting splatting, std::span<const FrameResult> frames) {
    DeviceOptions device;
    device.splatting = splatting;
    FramePainter painter(scene, device);
    std::vector<double> rounds;
    for (int round = -1; round < 3; ++round) {
        const double ms = time_ms([&] {
            std::optional<PendingFrame> before;
            for (const FrameResult& frame : frames) {
                PendingFrame next = painter.begin(frame);
                if (before) painter.finish(std::move(*before));
                before.emplace(std::move(next));
            }
            painter.finish(std::move(*before));
        });
        if (round >= 0) rounds.push_back(ms / double(frames.size()));
    }
    return median(rounds);
}

BenchRow row(const std::string& what, const std::pair<int, int>& size, double ms, double other_ms,
             const std::string& target, const std::string& device) {
    return {fmt::format("cumulus.toml {}, {}x{}: {} against the processor", what, size.first, size.second, device), ms,
            other_ms, target, fmt::format("{:.0f} frames/s; all cores", 1000 / ms)};
}

}  // namespace

std::vector<BenchRow> card_rows(const std::filesystem::path& source) {
    Renderer card;  // or, where there is none, the processor
    if (card.backend_name() != "vulkan") {
        fmt::print("without these rows: there is no graphics card; NEPHOS_DEVICE names another Vulkan device\n\n");
        return {};
    }
    Renderer processor({.device = {}, .splatting = Splatting::cpu});
    const std::filesystem::path file = source / "scenes/cumulus.toml";
    const Scene scene = read_scene(file);
    const std::vector<FrameResult> frames = frames_of(scene, kFirst, kLast);
    const std::string device = card.device_name();
    const Subject smooth = subject_of(scene, frames.front(), false), detailed = subject_of(scene, frames.front(), true);
    std::vector<BenchRow> rows;
    for (const auto& size : kSizes) {
        const auto add = [&](const std::string& what, Subject subject, bool changes, const std::string& target = "",
                             Flight flight = Flight::level) {
            subject.options.camera.width = size.first;
            subject.options.camera.height = size.second;
            rows.push_back(row(what, size, picture_ms(card, subject, changes, flight),
                               picture_ms(processor, subject, changes, flight), target, device));
        };
        Subject all = smooth, near = detailed;
        all.options.level_of_detail.pixels = 0;
        near.options.camera.position_m = kNearEye;
        near.options.camera.target_m = kNearTarget;
        add("without detail, no metaballs merged", all, false, size.first == 1920 ? ">= 500 frames/s" : "");
        add("without detail", smooth, false);
        add("without detail, climbing", smooth, false, "", Flight::climbing);
        add("without detail, its light new in each", smooth, true);
        add("with detail", detailed, false);
        add("with detail, climbing", detailed, false, "", Flight::climbing);
        add("with detail, 300 m from a cloud", near, false);
        for (const bool detail : {false, true}) {
            const std::vector<std::string> overrides{fmt::format("camera.width={}", size.first),
                                                     fmt::format("camera.height={}", size.second),
                                                     fmt::format("detail.enabled={}", detail)};
            const Scene film = read_scene(file, overrides);
            rows.push_back(row(detail ? "with detail, a new cloud in each" : "without detail, a new cloud in each", size,
                               film_ms(film, Splatting::automatic, frames), film_ms(film, Splatting::cpu, frames), "",
                               device));
        }
    }
    return rows;
}

}  // namespace nephos::bench
