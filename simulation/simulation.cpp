// SPDX-License-Identifier: Apache-2.0
#include "simulation/simulation.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>

#include "core/error.h"
#include "density/combine.h"
#include "density/optical_columns.h"
#include "simulation/scene_files.h"

namespace nephos {
namespace {

// Layers whose state is about to be replaced: empty lattices are the cheapest to make.
std::vector<LayerSimulation> blank_layers(const Scene& scene, LayerParts parts) {
    std::vector<LayerSimulation> layers;
    layers.reserve(lattice_count(scene));
    for (std::size_t n = 0; n < lattice_count(scene); ++n) {
        const Extent extent = automaton_options(scene, n).extent;
        layers.emplace_back(scene, n, Lattice{BitPlane(extent), BitPlane(extent), BitPlane(extent)}, parts);
    }
    return layers;
}

BitPlane copy_of(const BitPlaneView& view) {
    BitPlane plane(view.extent);
    std::copy_n(view.words, view.word_count(), plane.words().begin());
    return plane;
}

// Cells of a box in all, and the volume that they fill.
double volume_m3(const GridBox& box) {
    const double edge = box.placement.cell_size_m;
    return double(box.extent.cells()) * edge * edge * edge;
}

// Statistics of several layers as those of the whole sky (StepResult).
class TotalStatistics {
  public:
    void add(const CloudStatistics& layer, double volume_m3) {
        total_.hum += layer.hum;
        total_.act += layer.act;
        total_.cld += layer.cld;
        clear_ *= 1 - layer.cover;
        optically_clear_ *= 1 - layer.optical_cover;
        base_ = std::fmin(base_, layer.base_m);
        top_ = std::fmax(top_, layer.top_m);
        density_ += layer.mean_density * volume_m3;
        volume_ += volume_m3;
    }
    CloudStatistics result() const {
        CloudStatistics total = total_;
        total.cover = 1 - clear_;
        total.base_m = base_;
        total.top_m = top_;
        total.base_mean_m = total.top_mean_m = total.perimeter_m = std::numeric_limits<double>::quiet_NaN();
        total.optical_cover = 1 - optically_clear_;
        total.mean_density = volume_ > 0 ? density_ / volume_ : 0;
        return total;
    }

  private:
    CloudStatistics total_;
    double clear_ = 1, optically_clear_ = 1, density_ = 0, volume_ = 0;
    double base_ = std::numeric_limits<double>::quiet_NaN(), top_ = base_;
};

std::optional<GroundCover> dry_or_covered(const Scene& scene) {
    if (!scene.ground_cover.enabled) return {};
    return GroundCover(scene.ground_cover, scene.render.precipitation.kind, whole_world(scene));
}

LayerParts parts_for(SimulationResults results) {
    return results == SimulationResults::weather ? LayerParts::weather : LayerParts::all;
}

CloudStatistics no_automaton() {
    CloudStatistics none;
    none.base_m = none.top_m = none.base_mean_m = none.top_mean_m = std::numeric_limits<double>::quiet_NaN();
    return none;
}

}  // namespace

std::string version() { return NEPHOS_VERSION; }

SimulationRange full_range(const Scene& scene) { return {scene.steps, 1, frame_count(scene)}; }

SimulationRange range_of_frames(const Scene& scene, int first, int last) {
    const int count = frame_count(scene);
    if (last == kLastFrame) last = count;
    if (first < 1 || last < first || last > count) {
        throw Error(ErrorCode::usage,
                    count == 0
                        ? fmt::format("the scene '{}' has no frames", scene.name)
                        : fmt::format("no such frame: the scene '{}' has frames 1 to {}", scene.name, count));
    }
    return {steps_up_to(moment_of_frame(scene, last - 1)), first, last};
}

Simulation::Simulation(const Scene& scene) : Simulation(scene, simulation_start(scene)) {}

Simulation::Simulation(const Scene& scene, SimulationStart start)
    : Simulation(scene, full_range(scene), std::move(start.simulation_hash), std::move(start.initial)) {}

Simulation::Simulation(const Scene& scene, const SimulationRange& range, std::string simulation_hash,
                       std::optional<Lattice> initial, SimulationResults results)
    : scene_(with_files(scene)),
      range_(range),
      results_(results),
      simulation_hash_(std::move(simulation_hash)),
      layers_(make_layers(scene_, std::move(initial), parts_for(results))),
      ground_(dry_or_covered(scene)),
      next_frame_(range.first_frame) {
    if (results_ == SimulationResults::statistics && range_.has_frames())
        throw Error(ErrorCode::usage, "statistics alone have no frames");
    if (range_.has_frames() && steps_up_to(moment_of_number(range_.last_frame)) > range_.last_step) {
        throw Error(ErrorCode::usage,
                    fmt::format("frame {} shows {:g} s, but the simulation ends at {:g} s", range_.last_frame,
                                frame_time_s(scene_.frames, range_.last_frame - 1),
                                double(range_.last_step) * scene_.automaton.time_step_s));
    }
    remember();
}

Simulation::Simulation(const Scene& scene, const SimulationRange& range, std::string simulation_hash,
                       const Checkpoint& checkpoint, SimulationResults results, Restart restart)
    : scene_(with_files(scene)),
      range_(range),
      results_(results),
      simulation_hash_(std::move(simulation_hash)),
      layers_(blank_layers(scene_, parts_for(results))),
      ground_(dry_or_covered(scene)) {
    if (restart == Restart::same && checkpoint.simulation_hash != simulation_hash_) {
        throw Error(ErrorCode::usage, "the checkpoint belongs to another simulation");
    }
    try {
        this->restore(checkpoint, restart);
    } catch (const Error& error) {
        if (restart == Restart::same || error.code() != ErrorCode::io) throw;
        throw Error(ErrorCode::usage,
                    std::string("the checkpoint does not fit the changed scene (") + error.what() +
                        "): expected its lattices, layers, skies, numbers of ellipsoids, ground cover, kinds of wind "
                        "fields and smoothing");
    }
}

std::uint64_t Simulation::steps_in_all() const { return range_.last_step + window(); }

// Steps on either side of a step that its density is smoothed over.
std::uint64_t Simulation::window() const {
    return results_ == SimulationResults::everything ? std::uint64_t(scene_.density.smoothing.t0) : 0;
}

bool Simulation::makes_density(std::size_t layer) const {
    if (results_ == SimulationResults::everything) return layers_[layer].has_density();
    return results_ == SimulationResults::statistics && layers_[layer].is_veil();
}

bool Simulation::remembers_planes(std::size_t layer) const {
    return results_ == SimulationResults::everything && layers_[layer].automaton() != nullptr;
}

bool Simulation::finished() const { return next_step_ > range_.last_step && next_frame_ > range_.last_frame; }

Moment Simulation::moment_of_number(int number) const { return moment_of_frame(scene_, number - 1); }

bool Simulation::density_is_due(std::uint64_t step) const { return steps_taken() >= step + window(); }

// The lowest step whose density a result still needs, also one of a longer range: all frames that the scene's
// steps hold are then followed by more.
std::uint64_t Simulation::lowest_needed() const {
    // A branch has the last frames alone.
    const SimulationRange full = full_range(scene_);
    const bool frames_follow = scene_.frames.enabled && scene_.frames.count == 0 &&
                               range_.last_step == full.last_step && range_.last_frame == full.last_frame;
    std::uint64_t lowest = next_step_;
    if (next_frame_ <= range_.last_frame || (frames_follow && next_frame_ <= kMaxFrames))
        lowest = std::min(lowest, moment_of_number(next_frame_).step);
    return lowest;
}

void Simulation::advance(SimulationSink& sink) {
    assert(!finished());
    const bool frames_left = next_frame_ <= range_.last_frame;
    const std::uint64_t frame_needs = frames_left ? steps_up_to(moment_of_number(next_frame_)) : 0;
    if (frames_left && frame_needs < next_step_ && density_is_due(frame_needs)) {
        report_frame(sink);
    } else if (next_step_ <= range_.last_step && density_is_due(next_step_)) {
        report_step(sink);
    } else {
        step();
    }
}

void Simulation::step() {
    for (LayerSimulation& layer : layers_) layer.step();
    if (ground_) ground_->advance(scene_.automaton.time_step_s);
    remember();
}

void Simulation::go_to(std::uint64_t step) {
    assert(step >= next_step_ && step <= range_.last_step && !range_.has_frames());
    next_step_ = step;
    forget();
    while (!density_is_due(next_step_)) this->step();
}

StepResult Simulation::present_step(bool density) { return step_result(density); }

FrameResult Simulation::present_frame() {
    const Moment moment{next_step_, 0};
    return frame_at(moment, time_s(moment), 0);
}

DensityGrid Simulation::present_density(std::optional<std::size_t> layer) {
    const std::vector<DensityGrid>& densities = densities_at_step(next_step_);
    if (layer) return densities[*layer];
    std::vector<DensityGrid> made;
    std::vector<Boundaries> boundaries;
    for (std::size_t n = 0; n < layers_.size(); ++n) {
        if (!makes_density(n)) continue;
        made.push_back(densities[n]);
        boundaries.push_back(layers_[n].boundaries());
    }
    return made.empty() ? DensityGrid() : combine(made, boundaries);
}

std::shared_ptr<const Lattice> Simulation::present_planes(std::size_t layer) const {
    return remembers_planes(layer) ? past(next_step_).layers[layer].planes : nullptr;
}

StepResult Simulation::step_result(bool density) {
    const Past& state = past(next_step_);
    StepResult result;
    result.step = state.step;
    result.time_s = double(state.step) * scene_.automaton.time_step_s;
    result.hash = state.hash;
    TotalStatistics total;
    for (std::size_t n = 0; n < layers_.size(); ++n) {
        const PastLayer& past = state.layers[n];
        LayerStep layer{layers_[n].name(), past.state, past.clouds.size(), past.rain.size(), 0,
                        past.statistics,   past.hash};
        for (const RainArea& area : past.rain) {
            layer.rain_mm_per_h = std::max(layer.rain_mm_per_h, area.intensity_mm_per_h);
        }
        if (layers_[n].has_density()) {
            const GridBox box = layers_[n].box();
            layer.statistics.mean_density = std::numeric_limits<double>::quiet_NaN();
            layer.statistics.optical_cover = std::numeric_limits<double>::quiet_NaN();
            // No grid is touched where none is made: not even an empty one, for which OpenVDB would be loaded.
            if (makes_density(n) && (density || layers_[n].is_veil())) {
                const DensityGrid grid = density ? densities_at_step(next_step_)[n] : density_of(n, next_step_);
                if (layers_[n].is_veil()) layer.statistics = cloud_statistics(grid);
                layer.statistics.mean_density = grid.sum() / double(box.extent.cells());
                layer.statistics.optical_cover = optical_cover(grid, scene_.density.extinction_per_m);
            }
            total.add(layer.statistics, volume_m3(box));
        }
        result.layers.push_back(std::move(layer));
    }
    result.statistics = layers_.size() == 1 ? result.layers.front().statistics : total.result();
    if (scene_.layers.empty()) result.layers.clear();
    return result;
}

void Simulation::report_step(SimulationSink& sink) {
    sink.step(step_result(true));
    ++next_step_;
    forget();
}

double Simulation::time_s(const Moment& moment) const {
    return (double(moment.step) + moment.fraction) * scene_.automaton.time_step_s;
}

// A layer at a moment between two steps.
LayerFrame Simulation::layer_frame(std::size_t layer, const Moment& moment) {
    LayerFrame frame;
    frame.name = layers_[layer].name();
    if (makes_density(layer)) frame.density = density_at(layer, moment);
    frame.moisture = moisture_at(layer, moment);
    frame.boundaries = layers_[layer].boundaries();
    const PastLayer& state = past(moment.step).layers[layer];
    frame.hash = state.hash;
    frame.direct = !layers_[layer].has_density();
    frame.sky = layers_[layer].sky();
    frame.rain = state.rain;
    if (scene_.density.write_state && remembers_planes(layer)) {
        frame.planes = state.planes;
        frame.hum = state.planes->hum.view();
        frame.act = state.planes->act.view();
        frame.cld = state.planes->cld.view();
    }
    const double step_s = scene_.automaton.time_step_s, at_s = double(moment.step) * step_s;
    for (const SkyCloud& cloud : state.clouds) {
        frame.clouds.push_back(frame.sky->ahead(cloud, at_s, moment.fraction * step_s));
    }
    if (moment.fraction > 0) {
        frame.rain = mix(state.rain, past(moment.step + 1).layers[layer].rain, moment.fraction);
    }
    return frame;
}

std::shared_ptr<const GroundCoverMap> Simulation::ground_at(const Moment& moment) const {
    const std::shared_ptr<const GroundCoverMap>& before = past(moment.step).ground;
    if (moment.fraction == 0 || !before) return before;
    return std::make_shared<const GroundCoverMap>(
        mix(*before, *past(moment.step + 1).ground, moment.fraction));
}

FrameResult Simulation::frame_at(const Moment& moment, double time_s, int number) {
    FrameResult result;
    result.number = number;
    result.time_s = time_s;
    result.step = moment.step;
    result.hash = past(moment.step).hash;
    std::vector<DensityGrid> densities;
    std::vector<Boundaries> boundaries;
    for (std::size_t n = 0; n < layers_.size(); ++n) {
        result.layers.push_back(layer_frame(n, moment));
        if (!makes_density(n)) continue;
        densities.push_back(result.layers.back().density);
        boundaries.push_back(result.layers.back().boundaries);
    }
    if (!densities.empty()) result.density = combine(densities, boundaries);
    result.ground = ground_at(moment);
    if (scene_.layers.empty()) {
        result.hum = result.layers.front().hum;
        result.act = result.layers.front().act;
        result.cld = result.layers.front().cld;
        result.planes = result.layers.front().planes;
        result.moisture = result.layers.front().moisture;
        result.layers.clear();
    }
    return result;
}

void Simulation::report_frame(SimulationSink& sink) {
    sink.frame(frame_at(moment_of_number(next_frame_), frame_time_s(scene_.frames, next_frame_ - 1), next_frame_));
    ++next_frame_;
    forget();
}

Simulation::PastLayer Simulation::past_of(std::size_t number) const {
    const LayerSimulation& layer = layers_[number];
    PastLayer state;
    state.hash = layer.hash();
    state.statistics = no_automaton();
    Lattice planes;
    if (const Automaton* automaton = layer.automaton()) {
        state.statistics = cloud_statistics(automaton->hum(), automaton->act(), automaton->cld(),
                                            automaton->options().placement, automaton->options().boundaries);
    }
    if (remembers_planes(number)) {
        planes.cld = copy_of(layer.automaton()->cld());
        if (remembers_whole_state(scene_)) {
            planes.hum = copy_of(layer.automaton()->hum());
            planes.act = copy_of(layer.automaton()->act());
        }
    }
    state.planes = std::make_shared<const Lattice>(std::move(planes));
    if (const SkySimulation* sky = layer.sky()) {
        state.state = sky->state();
        state.clouds.assign(sky->clouds().begin(), sky->clouds().end());
        state.rain = layer.rain();
    }
    return state;
}

void Simulation::remember() {
    Past state;
    state.step = steps_taken();
    std::vector<StateHash> hashes;
    for (std::size_t n = 0; n < layers_.size(); ++n) {
        state.layers.push_back(past_of(n));
        hashes.push_back(state.layers.back().hash);
    }
    state.hash = combined_hash(hashes);
    if (ground_) expose_ground(state);
    history_.push_back(std::move(state));
    forget();
}

// The rain areas of a new state fall onto the ground, which lies as it does now.
void Simulation::expose_ground(Past& state) {
    const double time_s = double(state.step) * scene_.automaton.time_step_s;
    std::vector<std::array<std::vector<RainArea>, 2>> areas(scene_.layers.size());  // of each layer: still, carried
    std::vector<FallingRain> falling;
    for (std::size_t n = 0; n < scene_.layers.size(); ++n) {
        std::set<std::uint64_t> still;
        const std::vector<PlacedRain>& placed = scene_.layers[n].rain.placed;
        for (std::size_t i = 0; i < placed.size(); ++i)
            if (!placed[i].carried) still.insert(rain_id(RainSource::placed, std::uint32_t(n), 0, std::uint32_t(i)));
        for (const RainArea& area : state.layers[n].rain) areas[n][!still.contains(area.id)].push_back(area);
        const Range& base = scene_.layers[n].base_height_m;
        const double base_m = (base.min + base.max) / 2, ground_m = scene_.render.ground.height_m,
                     fall_m_per_s = scene_.ground_cover.fall_speed_m_per_s;
        const Wind& wind = layer_wind(scene_, n);
        falling.push_back({areas[n][0], drift_m(wind, time_s, base_m, ground_m, fall_m_per_s)});
        falling.push_back({areas[n][1], lag_m(wind, time_s, base_m, ground_m, fall_m_per_s)});
    }
    ground_->expose(falling);
    state.ground = std::make_shared<const GroundCoverMap>(ground_->map());
}

void Simulation::forget() {
    const std::uint64_t lowest = lowest_needed();
    while (history_.size() > 1 && history_.front().step + window() < lowest) history_.pop_front();
    std::erase_if(densities_, [&](const auto& entry) { return entry.step < lowest; });
}

const Simulation::Past& Simulation::past(std::uint64_t step) const {
    assert(!history_.empty() && step >= history_.front().step && step <= history_.back().step);
    return history_[std::size_t(step - history_.front().step)];
}

}  // namespace nephos
