// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/layers.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "scenes/format/scene.h"
#include "seeds/climate.h"

namespace nephos {
namespace {

// Index of the item of this name.
template <typename Item>
std::size_t index_of(const std::vector<Item>& items, const std::string& name, const char* what) {
    const auto found = std::ranges::find(items, name, &Item::name);
    if (found == items.end()) {
        throw Error(ErrorCode::usage, std::string("there is no ") + what + " called \"" + name + "\"");
    }
    return std::size_t(found - items.begin());
}

Sky resolved(const Scene& scene, const NamedSky& named) {
    Sky sky{named.name, named.state, named.clouds, {}};
    for (const std::string& model : named.models) {
        sky.models.push_back({index_of(scene.models, model, "base model"), named.generated});
    }
    return sky;
}

}  // namespace

std::uint64_t layer_seed(std::uint64_t scene_seed, std::size_t layer) {
    if (layer == 0) return scene_seed;
    const PhiloxWords words = philox(scene_seed, item_counter(Domain::layers, 0, std::uint32_t(layer), 0, 0));
    return words[0] | std::uint64_t(words[1]) << 32;
}

std::size_t lattice_count(const Scene& scene) { return scene.layers.empty() ? 1 : scene.layers.size(); }

bool has_density(const LayerOptions& layer) { return layer.automaton || layer.is_veil; }

bool has_density(const Scene& scene) {
    return scene.layers.empty() ||
           std::ranges::any_of(scene.layers, [](const LayerOptions& layer) { return has_density(layer); });
}

DetailOptions layer_detail(const Scene& scene, std::size_t layer) {
    const LayerOptions& options = scene.layers[layer];
    if (options.own_detail) return options.detail;
    DetailOptions detail = scene.density.detail;
    if (options.is_veil) detail.enabled = false;
    return detail;
}

std::size_t count_detailed(const Scene& scene) {
    if (scene.layers.empty()) return scene.density.detail.enabled ? 1 : 0;
    std::size_t count = 0;
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        count += has_density(scene.layers[n]) && layer_detail(scene, n).enabled ? 1 : 0;
    return count;
}

const Wind& layer_wind(const Scene& scene, std::size_t layer) {
    const Wind& own = scene.layers[layer].wind;
    return own.keyframes.empty() ? scene.automaton.wind : own;
}

WorldRectangle whole_world(const Scene& scene) {
    WorldRectangle world;
    // Veils count only when there is nothing else: they have no rain, and they may reach to the horizon.
    const bool veils_alone = std::ranges::all_of(scene.layers, &LayerOptions::is_veil);
    bool first = true;
    for (std::size_t n = 0; n < lattice_count(scene); ++n) {
        if (!veils_alone && scene.layers[n].is_veil) continue;
        const AutomatonOptions lattice = automaton_options(scene, n);
        const Vec3& origin = lattice.placement.origin_m;
        const double x_m = lattice.extent.x * lattice.placement.cell_size_m,
                     y_m = lattice.extent.y * lattice.placement.cell_size_m;
        const WorldRectangle layer{origin.x, origin.y, origin.x + x_m, origin.y + y_m};
        world = first ? layer
                      : WorldRectangle{
                            std::min(world.min_x_m, layer.min_x_m), std::min(world.min_y_m, layer.min_y_m),
                            std::max(world.max_x_m, layer.max_x_m), std::max(world.max_y_m, layer.max_y_m)};
        first = false;
    }
    return world;
}

bool absorbs_in_voxels(const Scene& scene, std::size_t layer) {
    const LayerOptions& given = scene.layers[layer];
    if (!given.automaton || given.light_absorption <= 0 || given.coupling.strength <= 0) return false;
    const auto absorbs = [&](const std::string& model) {
        return std::isfinite(scene.models[index_of(scene.models, model, "base model")].light_distance_m);
    };
    return std::ranges::any_of(given.metamorphoses, absorbs, &NamedMetamorphosis::to) ||
           std::ranges::any_of(given.skies, [&](const std::string& name) {
               const NamedSky& sky = scene.skies[index_of(scene.skies, name, "sky")];
               return sky.clouds > 0 && std::ranges::any_of(sky.models, absorbs);
           });
}

SkyOptions sky_options(const Scene& scene, std::size_t layer) {
    const LayerOptions& given = scene.layers[layer];
    SkyOptions options;
    options.name = given.name;
    options.seed = scene.automaton.seed;
    options.layer = std::uint32_t(layer);
    const Vec3& origin = given.placement.origin_m;
    options.world = {origin.x, origin.y, origin.x + given.extent.x * given.placement.cell_size_m,
                     origin.y + given.extent.y * given.placement.cell_size_m};
    options.base_height_m = given.base_height_m;
    options.models = scene.models;
    for (const std::string& sky : given.skies) {
        options.skies.push_back(resolved(scene, scene.skies[index_of(scene.skies, sky, "sky")]));
    }
    if (!scene.climate.schedule.empty()) options.schedule = scene.climate.schedule;
    if (!given.schedule.empty()) options.schedule = given.schedule;
    options.wind = layer_wind(scene, layer);
    options.time_step_s = scene.automaton.time_step_s;
    options.formation_s = given.formation_s;
    options.dissolution_s = given.dissolution_s;
    options.formation_softness = given.formation_softness;
    options.cross_edges_whole = given.cross_edges_whole;
    options.entering = given.entering;
    for (const NamedMetamorphosis& m : given.metamorphoses)
        options.metamorphoses.push_back({index_of(scene.models, m.from, "base model"),
                                         index_of(scene.models, m.to, "base model"), m.state});
    options.shear_s = given.shear_s;
    options.periodic = scene.tile;
    return options;
}

AutomatonOptions automaton_options(const Scene& scene, std::size_t layer) {
    if (scene.layers.empty()) return scene.automaton;
    const LayerOptions& given = scene.layers[layer];
    AutomatonOptions options = scene.automaton;
    options.extent = given.extent;
    options.placement = given.placement;
    options.boundaries = given.boundaries;
    options.seed = layer_seed(scene.automaton.seed, layer);
    options.field.background = given.background;
    options.field.profile = given.profile;
    options.field.ellipsoids.insert(options.field.ellipsoids.end(), given.ellipsoids.begin(), given.ellipsoids.end());
    options.field.scatters.insert(options.field.scatters.end(), given.scatters.begin(), given.scatters.end());
    options.wind = layer_wind(scene, layer);
    return options;
}

std::vector<AttachedRain> attached_rain(const Scene& scene, std::size_t layer) {
    std::vector<AttachedRain> rains;
    for (const AttachedRainRule& rule : scene.layers[layer].rain.attached) {
        AttachedRain& rain = rains.emplace_back();
        if (!rule.model.empty()) rain.model = index_of(scene.models, rule.model, "base model");
        rain.genus = rule.genus;
        rain.state = rule.state;
        rain.size_scale = rule.size_scale;
        rain.intensity_mm_per_h = rule.intensity_mm_per_h;
    }
    return rains;
}

double opacity_at(const LayerOptions& layer, const ClimateOptions& climate, double time_s) {
    if (layer.presence.empty()) return layer.opacity;
    const double state = climate.schedule.empty() ? 0 : state_at(climate.schedule, time_s);
    const auto above =
        std::ranges::find_if(layer.presence, [&](const VeilPresence& p) { return p.state >= state; });
    if (above == layer.presence.begin()) return layer.opacity * above->fraction;
    const VeilPresence& below = *(above - 1);
    if (above == layer.presence.end()) return layer.opacity * below.fraction;
    const double between = (state - below.state) / (above->state - below.state);
    return layer.opacity * (below.fraction + (above->fraction - below.fraction) * between);
}

VeilOptions veil_options(const Scene& scene, std::size_t layer) {
    VeilOptions options = scene.layers[layer].veil;
    options.seed = layer_seed(scene.automaton.seed, layer);
    if (scene.tile) {
        const LayerOptions& given = scene.layers[layer];
        options.period_m = {given.extent.x * given.placement.cell_size_m,
                            given.extent.y * given.placement.cell_size_m};
        options.margin_m = 0;
    }
    return options;
}

}  // namespace nephos
