// SPDX-License-Identifier: Apache-2.0
#include "apps/python/live_simulation.h"

#include <chrono>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/error.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

// hum and act of the present are kept, as for files of the state. It changes no bit, no density and no picture.
Scene with_whole_state(Scene scene) {
    scene.density.write_state = true;
    return scene;
}

Simulation started(const Scene& scene) {
    check_memory(scene, RunParts::statistics);
    SimulationStart start = simulation_start(scene);
    return Simulation(scene, {kMaxSteps, 1, 0}, std::move(start.simulation_hash), std::move(start.initial));
}

}  // namespace

LiveSimulation::LiveSimulation(Scene scene) : scene_(with_whole_state(std::move(scene))) {
    simulation_.emplace(started(scene_));
    simulation_->go_to(0);
}

std::unique_lock<std::mutex> LiveSimulation::turn() const {
    const std::scoped_lock next(next_);
    return std::unique_lock(mutex_);
}

std::uint64_t LiveSimulation::step(std::uint64_t count, double seconds) {
    const std::unique_lock lock = turn();
    const std::uint64_t present = simulation_->next_step();
    if (count > kMaxSteps - present) {
        throw Error(ErrorCode::usage, fmt::format("{} steps from step {} on are more than the {} of a run",
                                                  count, present, kMaxSteps));
    }
    const auto start = std::chrono::steady_clock::now();
    std::uint64_t done = 0;
    while (done < count) {
        simulation_->go_to(present + ++done);
        if (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() >= seconds) break;
    }
    return done;
}

std::uint64_t LiveSimulation::step_number() const {
    const std::unique_lock lock = turn();
    return simulation_->next_step();
}

double LiveSimulation::time_s() const { return double(step_number()) * scene_.automaton.time_step_s; }

std::vector<std::string> LiveSimulation::layers() const {
    std::vector<std::string> names;
    for (const LayerSimulation& layer : simulation_->layers()) names.push_back(layer.name());
    return names;
}

// The names of layers never change: no lock.
std::size_t LiveSimulation::layer_number(const LayerKey& key) const {
    const std::vector<std::string> names = layers();
    if (const std::string* name = std::get_if<std::string>(&key)) {
        for (std::size_t n = 0; n < names.size(); ++n) {
            if (names[n] == *name && !name->empty()) return n;
        }
        throw Error(ErrorCode::usage,
                    scene_.layers.empty()
                        ? fmt::format("no layer '{}': the scene '{}' has no layers", *name, scene_.name)
                        : fmt::format("no layer '{}': the scene '{}' has the layers {}", *name, scene_.name,
                                      fmt::join(names, ", ")));
    }
    const std::int64_t number = std::get<std::int64_t>(key);
    if (number < 0 || number >= std::int64_t(names.size())) {
        throw Error(ErrorCode::usage, fmt::format("no layer {}: the scene '{}' has layers 0 to {}", number,
                                                  scene_.name, names.size() - 1));
    }
    return std::size_t(number);
}

std::string LiveSimulation::hash() { return statistics(false).hash.hex(); }

StepResult LiveSimulation::statistics(bool density) {
    const std::unique_lock lock = turn();
    return simulation_->present_step(density);
}

LayerPlanes LiveSimulation::planes(const LayerKey& key) {
    const std::size_t number = layer_number(key);
    const std::unique_lock lock = turn();
    const LayerSimulation& layer = simulation_->layers()[number];
    LayerPlanes result{simulation_->present_planes(number), {}, {}};
    if (!result.planes) {
        throw Error(ErrorCode::usage,
                    fmt::format("layer '{}' has no automaton, and so no planes", layer.name()));
    }
    result.placement = layer.automaton()->options().placement;
    result.boundaries = layer.automaton()->options().boundaries;
    return result;
}

DensityGrid LiveSimulation::density(const std::optional<LayerKey>& key) {
    std::optional<std::size_t> number;
    if (key) number = layer_number(*key);
    const std::unique_lock lock = turn();
    DensityGrid density = simulation_->present_density(number);
    if (density.extent().cells() == 0) {
        throw Error(ErrorCode::usage,
                    number ? fmt::format("layer '{}' has no density", simulation_->layers()[*number].name())
                           : fmt::format("the scene '{}' has no density: its clouds are drawn directly",
                                         scene_.name));
    }
    return density;
}

Rgb8Image LiveSimulation::picture() {
    const std::unique_lock lock = turn();
    if (!painter_)
        painter_.emplace(scene_,
                         DeviceOptions{.device = scene_.frames.device, .splatting = scene_.frames.splatting});
    const FrameResult frame = simulation_->present_frame();
    const Picture picture = painter_->draw(frame);
    RenderOptions options = scene_.render;
    options.camera = painter_->camera(frame.time_s);
    return srgb8_image(picture, with_exposure(options, picture));
}

}  // namespace nephos
