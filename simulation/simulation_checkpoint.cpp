// SPDX-License-Identifier: Apache-2.0

// The part of Simulation that saves and restores it.

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>

#include <fmt/format.h>
#include <malloc.h>

#include "automaton/plane_bytes.h"
#include "core/bytes.h"
#include "core/error.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

constexpr std::uint32_t kHistoryVersion = 6;

// The range of a simulation, in the order of a checkpoint.
void put_range(ByteWriter& writer, const SimulationRange& range) {
    writer.put(range.last_step);
    writer.put(std::int32_t(range.first_frame));
    writer.put(std::int32_t(range.last_frame));
}

SimulationRange get_range(ByteReader& reader) {
    SimulationRange range;
    range.last_step = reader.get<std::uint64_t>();
    range.first_frame = reader.get<std::int32_t>();
    range.last_frame = reader.get<std::int32_t>();
    return range;
}

// Whether `after` is `before` or goes on from it.
bool continues(const SimulationRange& before, const SimulationRange& after) {
    return after.first_frame == before.first_frame && after.last_step >= before.last_step &&
           after.last_frame >= before.last_frame;
}

// What a history holds of each state: bit 0 for hum and act, from bit 1 on the results.
std::uint8_t content_bits(const Scene& scene, SimulationResults results) {
    return std::uint8_t(unsigned(remembers_whole_state(scene)) | unsigned(results) << 1);
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
        writer.put(std::array{c.serial, c.shape, c.sky, std::uint32_t(c.dissolving), c.slot});
        writer.put(std::array{c.place.x, c.place.y});
        writer.put(std::array{c.base_m, c.phase});
    }
}

std::vector<SkyCloud> get_clouds(ByteReader& reader, const SkySimulation* sky) {
    std::vector<SkyCloud> clouds;
    for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
        const auto numbers = reader.get<std::array<std::uint32_t, 5>>();
        const auto place = reader.get<std::array<std::int64_t, 2>>();
        const auto values = reader.get<std::array<double, 2>>();
        const SkyCloud& cloud = clouds.emplace_back(SkyCloud{numbers[0],
                                                             numbers[1],
                                                             numbers[2],
                                                             {place[0], place[1]},
                                                             values[0],
                                                             values[1],
                                                             numbers[3] != 0,
                                                             numbers[4]});
        if (sky == nullptr || !sky->is_possible(cloud))
            throw Error(ErrorCode::io, "the checkpoint's history is damaged");
    }
    return clouds;
}

BitPlane get_plane(ByteReader& reader, const Extent& extent) {
    BitPlane plane(extent);
    reader.get_bytes(std::as_writable_bytes(plane.words()));
    require_clear_padding(std::as_bytes(plane.words()), extent);
    return plane;
}

void put_rain(ByteWriter& writer, const std::vector<RainArea>& areas) {
    static_assert(sizeof(RainArea) == 8 * sizeof(double), "no holes");
    writer.put(std::uint64_t(areas.size()));
    writer.put_bytes(std::as_bytes(std::span(areas)));
}

std::vector<RainArea> get_rain(ByteReader& reader) {
    std::vector<RainArea> areas;
    for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
        const RainArea& area = areas.emplace_back(reader.get<RainArea>());
        const double values[] = {area.x_m,    area.y_m,    area.semi_a_m,          area.semi_b_m,
                                 area.axis_x, area.axis_y, area.intensity_mm_per_h};
        if (!std::ranges::all_of(values, [](double value) { return std::isfinite(value); }))
            throw Error(ErrorCode::io, "the checkpoint's history is damaged");
    }
    return areas;
}

void put_ground(ByteWriter& writer, const GroundCoverMap& map) {
    writer.put(std::array{map.outside.water_mm, map.outside.snow_mm, map.outside_rain_mm_per_h});
    for (const std::vector<float>* values : {&map.water_mm, &map.snow_mm, &map.rain_mm_per_h})
        writer.put_bytes(std::as_bytes(std::span(*values)));
}

// `map` has the size of the scene's map.
void get_ground(ByteReader& reader, GroundCoverMap& map) {
    const auto outside = reader.get<std::array<double, 3>>();
    map.outside = {outside[0], outside[1]};
    map.outside_rain_mm_per_h = outside[2];
    for (std::vector<float>* values : {&map.water_mm, &map.snow_mm, &map.rain_mm_per_h})
        reader.get_bytes(std::as_writable_bytes(std::span(*values)));
}

std::vector<std::byte> saved_layers(const std::vector<LayerSimulation>& layers) {
    if (layers.front().name().empty()) return layers.front().save();  // without a copy: it may be large
    ByteWriter writer;
    for (const LayerSimulation& layer : layers) {
        const std::vector<std::byte> bytes = layer.save();
        writer.put(std::uint64_t(bytes.size()));
        writer.put_bytes(bytes);
    }
    return writer.take();
}

}  // namespace

Checkpoint Simulation::save() {
    densities_.clear();
    // Hands the small blocks that the densities lay in back to the system; the planes below need large ones.
    ::malloc_trim(0);
    ByteWriter writer;
    writer.put(kHistoryVersion);
    put_range(writer, range_);
    writer.put(std::int32_t(window()));
    writer.put(content_bits(scene_, results_));
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
    for (const Past& state : history_)
        if (state.ground) put_ground(writer, *state.ground);
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
    return {simulation_hash_, steps_taken(), history_.back().hash, saved_layers(layers_), std::move(bytes)};
}

SavedPoint saved_point(const Checkpoint& checkpoint) {
    ByteReader reader(checkpoint.history);
    if (reader.get<std::uint32_t>() != kHistoryVersion)
        throw Error(ErrorCode::io, "the checkpoint was written by another version of nephos");
    get_range(reader);
    reader.get<std::int32_t>();  // window
    reader.get<std::uint8_t>();  // content
    SavedPoint point;
    point.next_step = reader.get<std::uint64_t>();
    point.next_frame = reader.get<std::int32_t>();
    return point;
}

void Simulation::restore(const Checkpoint& checkpoint, Restart restart) {
    restore_layers(checkpoint);
    restore_history(checkpoint, restart);
    // The hash of a veil is made of its options, which a branch may change: what was reported of this step stays.
    std::vector<StateHash> hashes;
    for (std::size_t n = 0; n < layers_.size(); ++n)
        hashes.push_back(layers_[n].is_veil() ? history_.back().layers[n].hash : layers_[n].hash());
    if (steps_taken() != checkpoint.steps || combined_hash(hashes) != checkpoint.state)
        throw Error(ErrorCode::io, "the checkpoint's state does not have the hash that it names");
}

// The layers' states one after the other, each with its length before it.
void Simulation::restore_layers(const Checkpoint& checkpoint) {
    if (ByteReader(checkpoint.history).get<std::uint32_t>() != kHistoryVersion) {
        throw Error(ErrorCode::io, "the checkpoint was written by another version of nephos");
    }
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

void Simulation::restore_ground(ByteReader& reader) {
    GroundCoverMap map = ground_->map();
    for (Past& state : history_) {
        get_ground(reader, map);
        state.ground = std::make_shared<const GroundCoverMap>(map);
    }
    ground_->restore(std::move(map));
}

void Simulation::restore_history(const Checkpoint& checkpoint, Restart restart) {
    ByteReader reader(checkpoint.history);
    reader.skip(sizeof kHistoryVersion);  // read by restore_layers()
    const SimulationRange before = get_range(reader);
    const bool same_window = std::uint64_t(reader.get<std::int32_t>()) == window();
    const std::uint8_t content = reader.get<std::uint8_t>(), expected = content_bits(scene_, results_);
    if ((content & 1) != (expected & 1)) {
        throw Error(ErrorCode::usage,
                    (content & 1) != 0
                        ? "the checkpoint belongs to a run that drew detail or wrote the state: expected "
                          "`detail.enabled` or `density.write_state` as then"
                        : "the checkpoint belongs to a run without detail and without the state: expected "
                          "`detail.enabled = false` and no `density.write_state`, as then");
    }
    if ((content >> 1) != (expected >> 1)) {
        const bool was_of_frames = content >> 1 == unsigned(SimulationResults::everything);
        throw Error(ErrorCode::usage,
                    was_of_frames
                        ? "the checkpoint belongs to a run with density: leave out --statistics-only "
                          "(--no-render writes no pictures)"
                        : "the checkpoint belongs to a run of statistics alone, or without density: expected "
                          "--statistics-only, or as then");
    }
    const bool may_continue = restart == Restart::branch || continues(before, range_);
    if (!may_continue || !same_window) {
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
    if (ground_) restore_ground(reader);
    for (Past& state : history_) {
        for (std::size_t layer = 0; layer < layers_.size(); ++layer) {
            Lattice planes;
            if (remembers_planes(layer)) {
                const Extent& extent = layers_[layer].automaton()->options().extent;
                planes.cld = get_plane(reader, extent);
                if (remembers_whole_state(scene_)) {
                    planes.hum = get_plane(reader, extent);
                    planes.act = get_plane(reader, extent);
                }
            }
            state.layers[layer].planes = std::make_shared<const Lattice>(std::move(planes));
        }
    }
    // past() relies on these.
    const std::uint64_t lowest = lowest_needed();
    const std::uint64_t needed = lowest > window() ? lowest - window() : 0;
    const bool reaches_back = !history_.empty() && history_.front().step <= needed;
    bool good = reader.rest().empty() && !history_.empty() && next_step_ <= before.last_step + 1 &&
                next_frame_ >= range_.first_frame &&
                next_frame_ <= std::max(before.last_frame, before.first_frame - 1) + 1 &&
                history_.back().step == steps_taken() && history_.back().hash == checkpoint.state;
    for (std::size_t n = 1; good && n < history_.size(); ++n)
        good = history_[n].step == history_[n - 1].step + 1;
    if (good && !reaches_back && !finished() && (before != range_ || restart == Restart::branch)) {
        throw Error(
            ErrorCode::usage,
            fmt::format("the checkpoint holds the states from step {} on, but {} made of those from "
                        "step {} on: expected {}",
                        history_.front().step,
                        lowest < next_step_ ? fmt::format("frame {} is", next_frame_) : "further steps are",
                        needed,
                        lowest < next_step_ ? "later frames (`frames.start_s`), or a new run" : "a new run"));
    }
    good = good && (finished() || reaches_back);
    if (!good) throw Error(ErrorCode::io, "the checkpoint's history is damaged");
}

}  // namespace nephos
