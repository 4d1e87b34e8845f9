// SPDX-License-Identifier: Apache-2.0
#include "apps/pipeline.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <malloc.h>

#include "automaton/bytes.h"
#include "automaton/error.h"
#include "density/combine.h"
#include "density/smoothing.h"

namespace nephos {
namespace {

constexpr std::uint32_t kHistoryVersion = 2;

// Layers whose state is about to be replaced: empty lattices are the cheapest to make.
std::vector<LayerSimulation> blank_layers(const Scene& scene) {
    std::vector<LayerSimulation> layers;
    layers.reserve(lattice_count(scene));
    for (std::size_t n = 0; n < lattice_count(scene); ++n) {
        const Extent extent = automaton_options(scene, n).extent;
        layers.emplace_back(scene, n, Lattice{BitPlane(extent), BitPlane(extent), BitPlane(extent)});
    }
    return layers;
}

BitPlane copy_of(const BitPlaneView& view) {
    BitPlane plane(view.extent);
    std::copy_n(view.words, view.word_count(), plane.words().begin());
    return plane;
}

std::uint64_t steps_up_to(const Moment& moment) { return moment.step + (moment.fraction > 0 ? 1 : 0); }

// What decides whether a saved history fits: the range, and what the history holds of each state.
void put_settings(ByteWriter& writer, const Scene& scene, const PipelineRange& range) {
    writer.put(range.last_step);
    writer.put(std::int32_t(range.first_frame));
    writer.put(std::int32_t(range.last_frame));
    writer.put(std::int32_t(scene.density.smoothing.t0));
    writer.put(std::uint8_t(scene.density.write_state));
}

void append_plane(std::vector<std::byte>& bytes, const BitPlane& plane) {
    const std::span<const std::byte> words = std::as_bytes(plane.words());
    bytes.insert(bytes.end(), words.begin(), words.end());
}

// In the order of a checkpoint.
std::array<const BitPlane*, 3> saved_planes(const Lattice& planes) {
    return {&planes.cld, &planes.hum, &planes.act};
}

// Number by number: a structure as bytes would have holes of any content.
void put_clouds(ByteWriter& writer, const std::vector<SkyCloud>& clouds) {
    writer.put(std::uint64_t(clouds.size()));
    for (const SkyCloud& c : clouds) {
        writer.put(std::array{c.serial, c.shape, c.sky, std::uint32_t(c.dissolving)});
        writer.put(std::array{c.place.x, c.place.y});
        writer.put(std::array{c.base_m, c.phase});
    }
}

std::vector<SkyCloud> get_clouds(ByteReader& reader, const SkySimulation* sky) {
    std::vector<SkyCloud> clouds;
    for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
        const auto numbers = reader.get<std::array<std::uint32_t, 4>>();
        const auto place = reader.get<std::array<std::int64_t, 2>>();
        const auto values = reader.get<std::array<double, 2>>();
        if (sky == nullptr || numbers[1] >= sky->shapes().size() ||
            numbers[2] >= sky->options().skies.size()) {
            throw Error(ErrorCode::io, "the checkpoint's history is damaged");
        }
        clouds.push_back({numbers[0],
                          numbers[1],
                          numbers[2],
                          {place[0], place[1]},
                          values[0],
                          values[1],
                          numbers[3] != 0});
    }
    return clouds;
}

void put_rain(ByteWriter& writer, const std::vector<RainArea>& areas) {
    static_assert(sizeof(RainArea) == 8 * sizeof(double), "no holes");
    writer.put(std::uint64_t(areas.size()));
    writer.put_bytes(std::as_bytes(std::span(areas)));
}

std::vector<RainArea> get_rain(ByteReader& reader) {
    std::vector<RainArea> areas;
    for (auto left = reader.get<std::uint64_t>(); left > 0; --left) areas.push_back(reader.get<RainArea>());
    return areas;
}

// Cells of a box in all, and the volume that they fill.
double volume_m3(const AutomatonOptions& options) {
    const double edge = options.placement.cell_size_m;
    return double(options.extent.cells()) * edge * edge * edge;
}

// Statistics of several layers as those of the whole sky (StepResult).
class TotalStatistics {
  public:
    void add(const CloudStatistics& layer, double volume_m3) {
        total_.hum += layer.hum;
        total_.act += layer.act;
        total_.cld += layer.cld;
        clear_ *= 1 - layer.cover;
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
        total.mean_density = volume_ > 0 ? density_ / volume_ : 0;
        return total;
    }

  private:
    CloudStatistics total_;
    double clear_ = 1, density_ = 0, volume_ = 0;
    double base_ = std::numeric_limits<double>::quiet_NaN(), top_ = base_;
};

CloudStatistics no_automaton() {
    CloudStatistics none;
    none.base_m = none.top_m = std::numeric_limits<double>::quiet_NaN();
    return none;
}

std::vector<std::byte> saved_layers(const std::vector<LayerSimulation>& layers) {
    if (layers.front().sky() == nullptr) return layers.front().save();  // without a copy: it may be large
    ByteWriter writer;
    for (const LayerSimulation& layer : layers) {
        const std::vector<std::byte> bytes = layer.save();
        writer.put(std::uint64_t(bytes.size()));
        writer.put_bytes(bytes);
    }
    return writer.take();
}

BitPlane get_plane(ByteReader& reader, Extent extent) {
    BitPlane plane(extent);
    reader.get_bytes(std::as_writable_bytes(plane.words()));
    return plane;
}

}  // namespace

Moment moment_of(double time_s, double time_step_s) {
    const double steps = time_s / time_step_s;
    const double nearest = std::round(steps);
    constexpr double kTolerance = 4 * std::numeric_limits<double>::epsilon();
    if (std::abs(steps - nearest) <= kTolerance * nearest) return {std::uint64_t(nearest), 0};
    const double whole = std::floor(steps);
    return {std::uint64_t(whole), steps - whole};
}

PipelineRange full_range(const Scene& scene) { return {scene.steps, 1, frame_count(scene)}; }

PipelineRange range_of_frames(const Scene& scene, int first, int last) {
    const int count = frame_count(scene);
    last = std::min(last, count);
    if (first < 1 || last < first) {
        throw Error(ErrorCode::usage,
                    count == 0
                        ? fmt::format("the scene '{}' has no frames", scene.name)
                        : fmt::format("no such frame: the scene '{}' has frames 1 to {}", scene.name, count));
    }
    const double end_s = frame_time_s(scene.frames, last - 1);
    return {steps_up_to(moment_of(end_s, scene.automaton.time_step_s)), first, last};
}

Pipeline::Pipeline(const Scene& scene, const PipelineRange& range, std::string simulation_hash,
                   std::optional<Lattice> initial)
    : scene_(scene),
      range_(range),
      simulation_hash_(std::move(simulation_hash)),
      layers_(make_layers(scene, std::move(initial))),
      next_frame_(range.first_frame) {
    if (range_.last_frame >= range_.first_frame &&
        steps_up_to(moment_of_frame(range_.last_frame)) > range_.last_step) {
        throw Error(ErrorCode::usage,
                    fmt::format("frame {} shows {:g} s, but the simulation ends at {:g} s", range_.last_frame,
                                frame_time_s(scene_.frames, range_.last_frame - 1),
                                double(range_.last_step) * scene_.automaton.time_step_s));
    }
    remember();
}

Pipeline::Pipeline(const Scene& scene, const PipelineRange& range, std::string simulation_hash,
                   const Checkpoint& checkpoint)
    : scene_(scene),
      range_(range),
      simulation_hash_(std::move(simulation_hash)),
      layers_(blank_layers(scene)) {
    if (checkpoint.simulation_hash != simulation_hash_) {
        throw Error(ErrorCode::usage, "the checkpoint belongs to another simulation");
    }
    restore_layers(checkpoint);
    if (steps_taken() != checkpoint.steps || combined_hash(layers_) != checkpoint.state) {
        throw Error(ErrorCode::io, "the checkpoint's state does not have the hash that it names");
    }
    restore_history(checkpoint);
}

std::uint64_t Pipeline::steps_in_all() const {
    return range_.last_step + std::uint64_t(scene_.density.smoothing.t0);
}

bool Pipeline::finished() const { return next_step_ > range_.last_step && next_frame_ > range_.last_frame; }

Moment Pipeline::moment_of_frame(int number) const {
    return moment_of(frame_time_s(scene_.frames, number - 1), scene_.automaton.time_step_s);
}

bool Pipeline::density_is_due(std::uint64_t step) const {
    return steps_taken() >= step + std::uint64_t(scene_.density.smoothing.t0);
}

// The lowest step whose density a result still needs.
std::uint64_t Pipeline::lowest_needed() const {
    std::uint64_t lowest = next_step_ <= range_.last_step ? next_step_ : steps_taken();
    if (next_frame_ <= range_.last_frame) lowest = std::min(lowest, moment_of_frame(next_frame_).step);
    return lowest;
}

void Pipeline::advance(PipelineSink& sink) {
    assert(!finished());
    const bool frames_left = next_frame_ <= range_.last_frame;
    const std::uint64_t frame_needs = frames_left ? steps_up_to(moment_of_frame(next_frame_)) : 0;
    if (frames_left && frame_needs < next_step_ && density_is_due(frame_needs)) {
        report_frame(sink);
    } else if (next_step_ <= range_.last_step && density_is_due(next_step_)) {
        report_step(sink);
    } else {
        step();
    }
}

void Pipeline::step() {
    for (LayerSimulation& layer : layers_) layer.step();
    remember();
}

void Pipeline::report_step(PipelineSink& sink) {
    const std::vector<DensityGrid>& densities = densities_at_step(next_step_);
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
        if (layers_[n].automaton()) {
            const AutomatonOptions& lattice = layers_[n].automaton()->options();
            layer.statistics.mean_density = densities[n].sum() / double(lattice.extent.cells());
            total.add(layer.statistics, volume_m3(lattice));
        }
        result.layers.push_back(std::move(layer));
    }
    result.statistics = layers_.size() == 1 ? result.layers.front().statistics : total.result();
    if (scene_.layers.empty()) result.layers.clear();
    sink.step(result);
    ++next_step_;
    forget();
}

DensityGrid Pipeline::density_at(std::size_t layer, const Moment& moment) {
    const DensityGrid before = densities_at_step(moment.step)[layer];
    if (moment.fraction == 0 || !layers_[layer].automaton()) return before;
    return mix(before, densities_at_step(moment.step + 1)[layer], moment.fraction);
}

// A layer at a moment between two steps.
LayerFrame Pipeline::layer_frame(std::size_t layer, const Moment& moment) {
    LayerFrame frame;
    frame.name = layers_[layer].name();
    frame.density = density_at(layer, moment);
    const PastLayer& state = past(moment.step).layers[layer];
    frame.hash = state.hash;
    frame.direct = layers_[layer].automaton() == nullptr;
    frame.sky = layers_[layer].sky();
    frame.rain = state.rain;
    if (scene_.density.write_state && !frame.direct) {
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

void Pipeline::report_frame(PipelineSink& sink) {
    const Moment moment = moment_of_frame(next_frame_);
    FrameResult result;
    result.number = next_frame_;
    result.time_s = frame_time_s(scene_.frames, next_frame_ - 1);
    result.step = moment.step;
    result.hash = past(moment.step).hash;
    std::vector<DensityGrid> densities;
    for (std::size_t n = 0; n < layers_.size(); ++n) {
        result.layers.push_back(layer_frame(n, moment));
        if (layers_[n].automaton()) densities.push_back(result.layers.back().density);
    }
    if (!densities.empty()) result.density = combine(densities);
    if (scene_.layers.empty()) {
        result.hum = result.layers.front().hum;
        result.act = result.layers.front().act;
        result.cld = result.layers.front().cld;
        result.planes = result.layers.front().planes;
        result.layers.clear();
    }
    sink.frame(result);
    ++next_frame_;
    forget();
}

Pipeline::PastLayer Pipeline::past_of(const LayerSimulation& layer) const {
    PastLayer state;
    state.hash = layer.hash();
    state.statistics = no_automaton();
    Lattice planes;
    if (const Automaton* automaton = layer.automaton()) {
        state.statistics = cloud_statistics(automaton->hum(), automaton->act(), automaton->cld(),
                                            automaton->options().placement);
        planes.cld = copy_of(automaton->cld());
        if (scene_.density.write_state) {
            planes.hum = copy_of(automaton->hum());
            planes.act = copy_of(automaton->act());
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

void Pipeline::remember() {
    Past state;
    state.step = steps_taken();
    std::vector<StateHash> hashes;
    for (const LayerSimulation& layer : layers_) {
        state.layers.push_back(past_of(layer));
        hashes.push_back(state.layers.back().hash);
    }
    state.hash = combined_hash(hashes);
    history_.push_back(std::move(state));
    forget();
}

void Pipeline::forget() {
    const std::uint64_t lowest = lowest_needed();
    const auto reach = std::uint64_t(scene_.density.smoothing.t0);
    while (history_.size() > 1 && history_.front().step + reach < lowest) history_.pop_front();
    std::erase_if(densities_, [&](const auto& entry) { return entry.step < lowest; });
}

const Pipeline::Past& Pipeline::past(std::uint64_t step) const {
    assert(!history_.empty() && step >= history_.front().step && step <= history_.back().step);
    return history_[std::size_t(step - history_.front().step)];
}

DensityGrid Pipeline::density_of(std::size_t layer, std::uint64_t step) const {
    const Automaton* automaton = layers_[layer].automaton();
    if (automaton == nullptr) return {};
    const auto reach = std::uint64_t(scene_.density.smoothing.t0);
    std::vector<TimedPlane> planes;
    for (std::uint64_t at = step > reach ? step - reach : 0; at <= step + reach; ++at) {
        planes.push_back(
            {past(at).layers[layer].planes->cld.view(), int(std::int64_t(at) - std::int64_t(step))});
    }
    const AutomatonOptions& lattice = automaton->options();
    return scaled(smooth(planes, scene_.density.smoothing, lattice.placement, lattice.boundaries),
                  layers_[layer].opacity());
}

const std::vector<DensityGrid>& Pipeline::densities_at_step(std::uint64_t step) {
    for (const Densities& known : densities_) {
        if (known.step == step) return known.layers;
    }
    Densities made{step, {}};
    for (std::size_t n = 0; n < layers_.size(); ++n) made.layers.push_back(density_of(n, step));
    densities_.push_back(std::move(made));
    return densities_.back().layers;
}

Checkpoint Pipeline::save() {
    densities_.clear();
    // Hands the small blocks that the densities lay in back to the system; the planes below need large ones.
    ::malloc_trim(0);
    ByteWriter writer;
    writer.put(kHistoryVersion);
    put_settings(writer, scene_, range_);
    writer.put(next_step_);
    writer.put(std::int32_t(next_frame_));
    writer.put(std::uint32_t(history_.size()));
    for (const Past& state : history_) {
        writer.put(state.step);
        writer.put(state.hash);
        for (const PastLayer& layer : state.layers) {
            writer.put(layer.statistics);
            writer.put(layer.hash);
            writer.put(layer.state);
            put_clouds(writer, layer.clouds);
            put_rain(writer, layer.rain);
        }
    }
    std::vector<std::byte> bytes = writer.take();
    // The planes at their exact size: a growing vector would hold them twice.
    std::size_t words = 0;
    for (const PastLayer& layer : history_.front().layers) {
        for (const BitPlane* plane : saved_planes(*layer.planes)) words += plane->words().size();
    }
    bytes.reserve(bytes.size() + history_.size() * words * sizeof(std::uint64_t));
    for (const Past& state : history_) {
        for (const PastLayer& layer : state.layers) {
            for (const BitPlane* plane : saved_planes(*layer.planes)) append_plane(bytes, *plane);
        }
    }
    return {simulation_hash_, steps_taken(), combined_hash(layers_), saved_layers(layers_), std::move(bytes)};
}

// The layers' states one after the other, each with its length before it.
void Pipeline::restore_layers(const Checkpoint& checkpoint) {
    if (scene_.layers.empty()) {
        layers_.front().restore(checkpoint.automaton);
        return;
    }
    ByteReader reader(checkpoint.automaton);
    for (LayerSimulation& layer : layers_) {
        const auto size = reader.get<std::uint64_t>();
        if (size > reader.rest().size()) throw Error(ErrorCode::io, "the checkpoint's layers are damaged");
        layer.restore(reader.rest().first(std::size_t(size)));
        reader.skip(std::size_t(size));
    }
    const bool together = std::ranges::all_of(
        layers_, [&](const LayerSimulation& layer) { return layer.steps() == layers_.front().steps(); });
    if (!reader.rest().empty() || !together)
        throw Error(ErrorCode::io, "the checkpoint's layers are damaged");
}

void Pipeline::restore_history(const Checkpoint& checkpoint) {
    ByteReader reader(checkpoint.history);
    if (reader.get<std::uint32_t>() != kHistoryVersion) {
        throw Error(ErrorCode::io, "the checkpoint was written by another version of nephos");
    }
    ByteWriter expected;
    put_settings(expected, scene_, range_);
    const std::vector<std::byte> settings = expected.take();
    std::vector<std::byte> found(settings.size());
    reader.get_bytes(found);
    if (found != settings) {
        throw Error(ErrorCode::usage,
                    "the checkpoint belongs to a run with other frames or another smoothing window");
    }
    next_step_ = reader.get<std::uint64_t>();
    next_frame_ = reader.get<std::int32_t>();
    const auto size = reader.get<std::uint32_t>();
    for (std::uint32_t n = 0; n < size; ++n) {
        Past state;
        state.step = reader.get<std::uint64_t>();
        state.hash = reader.get<StateHash>();
        for (std::size_t n_layer = 0; n_layer < layers_.size(); ++n_layer) {
            PastLayer& layer = state.layers.emplace_back();
            layer.statistics = reader.get<CloudStatistics>();
            layer.hash = reader.get<StateHash>();
            layer.state = reader.get<double>();
            layer.clouds = get_clouds(reader, layers_[n_layer].sky());
            layer.rain = get_rain(reader);
        }
        history_.push_back(std::move(state));
    }
    for (Past& state : history_) {
        for (std::size_t layer = 0; layer < layers_.size(); ++layer) {
            Lattice planes;
            if (const Automaton* automaton = layers_[layer].automaton()) {
                planes.cld = get_plane(reader, automaton->options().extent);
                if (scene_.density.write_state) {
                    planes.hum = get_plane(reader, automaton->options().extent);
                    planes.act = get_plane(reader, automaton->options().extent);
                }
            }
            state.layers[layer].planes = std::make_shared<const Lattice>(std::move(planes));
        }
    }
    // past() relies on these.
    const auto reach = std::uint64_t(scene_.density.smoothing.t0);
    const std::uint64_t lowest = lowest_needed();
    bool good = reader.rest().empty() && !history_.empty() && next_step_ <= range_.last_step + 1 &&
                next_frame_ >= range_.first_frame &&
                next_frame_ <= std::max(range_.last_frame, range_.first_frame - 1) + 1 &&
                history_.back().step == steps_taken() && history_.back().hash == combined_hash(layers_) &&
                (finished() || history_.front().step <= (lowest > reach ? lowest - reach : 0));
    for (std::size_t n = 1; good && n < history_.size(); ++n)
        good = history_[n].step == history_[n - 1].step + 1;
    if (!good) throw Error(ErrorCode::io, "the checkpoint's history is damaged");
}

}  // namespace nephos
