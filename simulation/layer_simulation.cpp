// SPDX-License-Identifier: Apache-2.0
#include "simulation/layer_simulation.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/bytes.h"
#include "core/error.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"
#include "seeds/coupling.h"
#include "simulation/memory.h"
#include "simulation/scene_files.h"

namespace nephos {
namespace {

// A part of the saved state, with its length before it; nothing but the length when there is no such part.
template <typename Part>
void put_part(ByteWriter& writer, const std::optional<Part>& part) {
    const std::vector<std::byte> bytes = part ? part->save() : std::vector<std::byte>();
    writer.put(std::uint64_t(bytes.size()));
    writer.put_bytes(bytes);
}

template <typename Part>
void restore_part(ByteReader& reader, std::optional<Part>& part) {
    const auto size = reader.get<std::uint64_t>();
    if (size > reader.rest().size() || (size > 0) != part.has_value()) {
        throw Error(ErrorCode::io, "the saved state is not of this layer");
    }
    const std::span<const std::byte> bytes = reader.rest().first(std::size_t(size));
    if (part) part->restore(bytes);
    reader.skip(bytes.size());
}

double metres(std::int64_t after, std::int64_t before) {
    // Unsigned: the sum of a very long simulation wraps around.
    return double(std::int64_t(std::uint64_t(after) - std::uint64_t(before))) * 0x1p-32;
}

// All that a veil's density depends on, but for the time.
std::string text_of_veil(const Scene& scene, std::size_t layer) {
    Scene alone;
    alone.tile = scene.tile;
    if (!scene.layers[layer].presence.empty()) alone.climate = scene.climate;
    alone.automaton.seed = layer_seed(scene.automaton.seed, layer);
    alone.automaton.time_step_s = scene.automaton.time_step_s;
    alone.automaton.wind = layer_wind(scene, layer);
    alone.automaton.wind.fields.clear();  // they do not carry veils
    alone.layers = {scene.layers[layer]};
    alone.layers.front().wind = {};
    alone.layers.front().own_detail = false;
    alone.layers.front().is_slab = false;
    return to_toml(alone);
}

}  // namespace

LayerSimulation::LayerSimulation(const Scene& scene, std::size_t layer, std::optional<Lattice> initial,
                                 LayerParts parts)
    : number_(std::uint32_t(layer)), time_step_s_(scene.automaton.time_step_s) {
    const AutomatonOptions lattice = automaton_options(scene, layer);
    box_ = {lattice.extent, lattice.placement};
    if (!scene.layers.empty()) {
        options_ = scene.layers[layer];
        if (options_.is_veil) {
            veil_ = veil_options(scene, layer);
            climate_ = scene.climate;
            wind_ = layer_wind(scene, layer);
            veil_text_ = text_of_veil(scene, layer);
            return;
        }
        attached_ = attached_rain(scene, layer);
        sky_.emplace(sky_options(scene, layer));
    }
    if (!options_.automaton || (parts == LayerParts::weather && !options_.rain.find)) return;
    if (initial) {
        automaton_.emplace(lattice, std::move(*initial));
    } else {
        automaton_.emplace(lattice, field_of_clouds());
    }
    if (options_.rain.find) {
        finder_.emplace(options_.rain.finder, lattice.extent, lattice.placement, lattice.boundaries, number_);
    }
}

std::uint64_t LayerSimulation::steps() const {
    if (!automaton_ && !sky_) return steps_;
    return automaton_ ? automaton_->steps() : sky_->steps();
}

DensityGrid LayerSimulation::veil_at(double time_s) const {
    const double opacity = opacity_at(options_, climate_, time_s);
    if (opacity <= 0)
        return DensityGrid::from_dense(std::vector<float>(options_.extent.cells(), 0.0f), options_.extent, options_.placement);
    return scaled(veil_density(veil_, wind_, options_.extent, options_.placement, time_s), opacity);
}

GridBox LayerSimulation::box() const { return box_; }

Boundaries LayerSimulation::boundaries() const {
    return automaton_ ? automaton_->options().boundaries : options_.boundaries;
}

void LayerSimulation::step() {
    if (!automaton_ && !sky_) {
        ++steps_;
        return;
    }
    if (sky_ && automaton_) automaton_->set_external_ellipsoids(field_of_clouds());
    if (automaton_) automaton_->step();
    if (!sky_) return;
    const Displacement before = sky_->carried();
    sky_->step();
    if (!finder_) return;
    const Displacement& after = sky_->carried();
    finder_->update(automaton_->cld(), time_step_s_, metres(after.x, before.x), metres(after.y, before.y));
}

std::vector<ActiveEllipsoid> LayerSimulation::field_of_clouds() const {
    if (!sky_) return {};
    std::vector<ActiveEllipsoid> ellipsoids = ellipsoids_of(*sky_, options_.coupling);
    append_columns(ellipsoids, rain(), options_.rain.column);
    return ellipsoids;
}

std::vector<RainArea> LayerSimulation::rain() const {
    if (!sky_) return {};
    std::vector<RainArea> areas =
        placed_areas(options_.rain.placed, sky_->time_s(), sky_->carried(), number_);
    if (sky_->options().periodic) {
        const WorldRectangle& w = sky_->options().world;
        const auto inside = [](double at, double min, double max) {
            return at - (max - min) * std::floor((at - min) / (max - min));
        };
        for (RainArea& area : areas) {
            area.x_m = inside(area.x_m, w.min_x_m, w.max_x_m);
            area.y_m = inside(area.y_m, w.min_y_m, w.max_y_m);
        }
    }
    const auto add = [&](const std::vector<RainArea>& more) {
        areas.insert(areas.end(), more.begin(), more.end());
    };
    add(attached_areas(attached_, *sky_));
    if (finder_) add(finder_->areas());
    return areas;
}

StateHash LayerSimulation::hash() const {
    if (!automaton_ && !sky_) {
        ByteWriter writer;
        writer.put_bytes(std::as_bytes(std::span(veil_text_)));
        writer.put(steps_);
        return hash_of_bytes(writer.bytes());
    }
    return automaton_ ? automaton_->hash() : sky_->hash();
}

std::vector<std::byte> LayerSimulation::save() const {
    if (!automaton_ && !sky_) {
        ByteWriter writer;
        writer.put(steps_);
        return writer.take();
    }
    if (!sky_) return automaton_->save();
    ByteWriter writer;
    put_part(writer, automaton_);
    put_part(writer, sky_);
    put_part(writer, finder_);
    return writer.take();
}

void LayerSimulation::restore(std::span<const std::byte> bytes) {
    if (!automaton_ && !sky_) {
        ByteReader reader(bytes);
        steps_ = reader.get<std::uint64_t>();
        if (!reader.rest().empty()) throw Error(ErrorCode::io, "the saved state is not of this layer");
        return;
    }
    if (!sky_) {
        automaton_->restore(bytes);
        return;
    }
    ByteReader reader(bytes);
    restore_part(reader, automaton_);
    restore_part(reader, sky_);
    restore_part(reader, finder_);
    if (!reader.rest().empty() || (automaton_ && automaton_->steps() != sky_->steps())) {
        throw Error(ErrorCode::io, "the saved state is not of this layer");
    }
}

std::optional<Lattice> initial_state_of_layer(const Scene& scene, std::size_t layer) {
    const LayerOptions& options = scene.layers[layer];
    if (!options.initial_state_file) return {};
    return read_at_key(scene, indexed("layer", layer) + ".lattice.initial_state",
                       [&] { return read_state(*options.initial_state_file, options.extent, options.placement); });
}

std::vector<LayerSimulation> make_layers(const Scene& scene, std::optional<Lattice> initial,
                                         LayerParts parts) {
    const Scene complete = with_files(scene);
    std::vector<LayerSimulation> layers;
    layers.reserve(lattice_count(scene));
    for (std::size_t n = 0; n < lattice_count(scene); ++n) {
        layers.emplace_back(complete, n, scene.layers.empty() ? std::move(initial) : initial_state_of_layer(scene, n), parts);
    }
    return layers;
}

std::optional<Lattice> initial_state(const Scene& scene, const std::string& from) {
    const AutomatonOptions& lattice = scene.automaton;
    if (!from.empty()) return read_state(from, lattice.extent, lattice.placement);
    if (scene.initial_state_file) {
        return read_at_key(scene, "lattice.initial_state", [&] {
            return read_state(*scene.initial_state_file, lattice.extent, lattice.placement);
        });
    }
    return {};
}

SimulationStart simulation_start(const Scene& scene) {
    SimulationStart start;
    start.initial = initial_state(scene);
    std::string states = start.initial ? hash_of(*start.initial).hex() : std::string();
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        if (const std::optional<Lattice> state = initial_state_of_layer(scene, n)) states += hash_of(*state).hex();
    start.simulation_hash = simulation_hash(scene, states + hash_of_files(with_files(scene)));
    return start;
}

std::vector<LayerSimulation> start_layers(const Scene& scene, const std::string& scene_file,
                                          const std::string& from) {
    if (!from.empty() && !scene.layers.empty()) {
        throw Error(ErrorCode::usage,
                    fmt::format("{}: has layers, but --from gives the state of one lattice: name the file as "
                                "`initial_state` in the `lattice` of its layer",
                                scene_file));
    }
    const Scene complete = with_files(scene);
    std::size_t bytes = 0;
    for (std::size_t n = 0; n < lattice_count(scene); ++n) {
        if (!scene.layers.empty() && scene.layers[n].is_veil) continue;  // holds nothing
        bytes += Automaton::memory_bytes(automaton_options(complete, n));
    }
    const Extent& extent = scene.automaton.extent;
    require_memory(bytes, scene.layers.empty()
                              ? fmt::format("{}: a lattice of {} x {} x {} cells", scene_file, extent.x,
                                            extent.y, extent.z)
                              : fmt::format("{}: {} layers", scene_file, scene.layers.size()));
    return make_layers(complete, initial_state(complete, from));
}

StateHash combined_hash(std::span<const StateHash> hashes) {
    return hashes.size() == 1 ? hashes.front() : hash_of_bytes(std::as_bytes(hashes));
}

StateHash combined_hash(std::span<const LayerSimulation> layers) {
    std::vector<StateHash> hashes;
    for (const LayerSimulation& layer : layers) hashes.push_back(layer.hash());
    return combined_hash(hashes);
}

}  // namespace nephos
