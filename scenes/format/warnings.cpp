// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/warnings.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "automaton/options.h"
#include "render/options/height_format.h"

namespace nephos {
namespace {

// The lattice that parcels belong to.
struct Box {
    Vec3 low_m, high_m;
    Boundaries boundaries;
    bool has_apron = true;
};

Box box_of(const Extent& extent, const Placement& placement, const Boundaries& boundaries,
           const DetailOptions& detail) {
    const Vec3 edges = placement.cell_size_m * Vec3(extent.x, extent.y, extent.z);
    return {placement.origin_m, placement.origin_m + edges, boundaries,
            detail.enabled && detail.apron_cells > 0};
}

// Adds what a parcel whose centre lies between `low_m` and `high_m` has beyond the box.
void add_cuts(const std::string& key, const Vec3& low_m, const Vec3& high_m, const Vec3& reach_m,
              const Box& box, std::vector<std::string>& to) {
    const double above = high_m.z + reach_m.z - box.high_m.z;
    if (box.boundaries.z == Boundary::open && above > 0)
        to.push_back(fmt::format(
            "{} reaches up to {:.0f} m above the lattice's top at {:.0f} m, which cuts its clouds "
            "flat: raise the third number of `cells`, or lower the parcels",
            key, std::ceil(above), box.high_m.z));
    if (box.has_apron) return;
    const char* const names[] = {"west", "east", "south", "north"};
    for (int axis = 0; axis < 2; ++axis) {
        if ((axis == 0 ? box.boundaries.x : box.boundaries.y) != Boundary::open) continue;
        const double beyond[] = {box.low_m[axis] - (low_m[axis] - reach_m[axis]),
                                 high_m[axis] + reach_m[axis] - box.high_m[axis]};
        for (int side = 0; side < 2; ++side)
            if (beyond[side] > 0)
                to.push_back(fmt::format(
                    "{} reaches up to {:.0f} m beyond the lattice's {} side, which cuts its clouds "
                    "straight: set detail.apron_cells, or move the parcels",
                    key, std::ceil(beyond[side]), names[2 * axis + side]));
    }
}

void add_ellipsoids(const std::vector<Ellipsoid>& ellipsoids, const std::string& table, const Box& box,
                    std::vector<std::string>& to) {
    for (std::size_t n = 0; n < ellipsoids.size(); ++n) {
        const Ellipsoid& e = ellipsoids[n];
        add_cuts(fmt::format("{} number {}", table, n + 1), e.centre_m, e.centre_m, reach_m(e), box, to);
    }
}

// `table`: "[[field.scatters]]", and of which layer.
void add_scatters(const std::vector<EllipsoidScatter>& scatters, const std::string& table, const Box& box,
                  std::vector<std::string>& to) {
    for (std::size_t n = 0; n < scatters.size(); ++n) {
        const EllipsoidScatter& s = scatters[n];
        const double rise = is_plume(s) ? s.thermals.rise_m.max : 0;
        const double wander_m =
            is_plume(s) ? s.thermals.wander * std::max(s.semi_axis_x_m.max, s.semi_axis_y_m.max) : 0;
        const Vec3 around(wander_m, wander_m, 0);
        add_cuts(fmt::format("{} number {}", table, n + 1), Vec3(s.x_m.min, s.y_m.min, s.z_m.min) - around,
                 Vec3(s.x_m.max, s.y_m.max, s.z_m.max + rise) + around, reach_m(s), box, to);
    }
}

}  // namespace

std::vector<std::string> warnings(const Scene& scene) {
    std::vector<std::string> result;
    if (!scene.models.empty() && scene.layers.empty())
        result.emplace_back(
            "the scene has base models but no [[layer]] whose skies use them: nothing of them is "
            "simulated (scenes/genera/Cu.toml shows a sky and a layer)");
    if (scene.layers.empty()) {
        const AutomatonOptions& a = scene.automaton;
        const Box box = box_of(a.extent, a.placement, a.boundaries, scene.density.detail);
        add_ellipsoids(a.field.ellipsoids, "[[field.ellipsoids]]", box, result);
        add_scatters(a.field.scatters, "[[field.scatters]]", box, result);
    }
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const LayerOptions& layer = scene.layers[n];
        if (layer.is_veil || !layer.automaton) continue;
        const Box box = box_of(layer.extent, layer.placement, layer.boundaries, layer_detail(scene, n));
        add_ellipsoids(layer.ellipsoids, fmt::format("[[layer.ellipsoids]] of layer '{}',", layer.name), box,
                       result);
        add_scatters(layer.scatters, fmt::format("[[layer.scatters]] of layer '{}',", layer.name), box,
                     result);
    }
    return result;
}

namespace {

// Keys of [layer.slab] and beside it that its kind of light, or the slab itself, does not read.
void add_slab_keys(const LayerOptions& layer, std::vector<std::string>& to) {
    const VeilView& slab = layer.slab;
    const VeilView plain;
    if (slab.light == VeilLighting::two_samples && !(slab.g == plain.g && slab.halo == plain.halo))
        to.push_back(fmt::format(
            "layer '{}': `g` and `halo` of [layer.slab] have no effect: its light is \"two_samples\"",
            layer.name));
    if (slab.light == VeilLighting::physical && !(slab.two_samples == plain.two_samples))
        to.push_back(fmt::format(
            "layer '{}': [layer.slab.two_samples] has no effect: its light is \"physical\"", layer.name));
    if (layer.own_detail && layer.detail.enabled)
        to.push_back(fmt::format("layer '{}': [layer.detail] has no effect on pictures beside [layer.slab]",
                                 layer.name));
}

// The base models of a layer's clouds, with those that they turn into.
std::set<std::string> models_of(const Scene& scene, const LayerOptions& layer) {
    std::set<std::string> used;
    for (const NamedSky& sky : scene.skies)
        if (std::ranges::count(layer.skies, sky.name) > 0) used.insert(sky.models.begin(), sky.models.end());
    for (const NamedMetamorphosis& change : layer.metamorphoses) used.insert(change.to);
    return used;
}

// Whether a base model says anything of its billboards.
bool has_billboards(const BaseModel& model) {
    const Seed plain;
    return !model.textures.empty() || std::ranges::any_of(model.seeds, [&](const Seed& seed) {
        return !(seed.billboards == plain.billboards && seed.billboard_width_m == plain.billboard_width_m &&
                 seed.billboard_height_m == plain.billboard_height_m && seed.texture == plain.texture);
    });
}

// Keys of [terrain] that are of another kind of ground.
void add_terrain_keys(const TerrainOptions& terrain, std::vector<std::string>& to) {
    const TerrainOptions plain;
    TerrainOptions other = terrain;
    other.height_map.reset();
    other.relief = Relief::none;
    if (!terrain.any()) {
        if (!(other == plain))
            to.emplace_back("[terrain] has no effect: [ground] has neither `height_map` nor `relief`");
        return;
    }
    const HeightFormat format = terrain.height_map ? height_format(*terrain.height_map) : HeightFormat::none;
    if (format != HeightFormat::raw && (terrain.raw_columns != 0 || terrain.raw_rows != 0))
        to.emplace_back("`raw_columns` and `raw_rows` of [terrain] have no effect: they are of raw files");
    if (format == HeightFormat::exr && terrain.height_scale_m != plain.height_scale_m)
        to.emplace_back("`height_scale_m` of [terrain] has no effect: the heights of an EXR file are metres");
    const bool generates =
        terrain.cells != plain.cells || terrain.feature_m != plain.feature_m || terrain.seed != plain.seed;
    if (terrain.height_map && generates)
        to.emplace_back(
            "`cells`, `feature_m` and `seed` of [terrain] have no effect: they are of `ground.relief`");
}

// Keys of a layer that is drawn directly. What it has from [field] is not its own.
void add_direct_keys(const FieldOptions& shared, const LayerOptions& layer, std::vector<std::string>& to) {
    const auto add = [&](const char* keys) {
        to.push_back(
            fmt::format("layer '{}' is drawn directly: {} no effect without `automaton`", layer.name, keys));
    };
    if (layer.light_absorption != 1) add("`light_absorption` has");
    if (!(layer.background == shared.background)) add("`background` has");
    if (layer.own_detail && !(layer.detail == DetailOptions{})) add("[layer.detail] has");
    const bool profile = !layer.profile.empty() && layer.profile != shared.profile;
    const bool field = !layer.scatters.empty() || !layer.ellipsoids.empty() || profile;
    CouplingOptions plain;
    if (layer.coupling.min_semi_axis_m == layer.placement.cell_size_m)  // its default
        plain.min_semi_axis_m = layer.coupling.min_semi_axis_m;
    if (field || !(layer.coupling == plain))
        add("its ellipsoids, scatters, profile and coupling have");
}

// Returns whether the profile of the wind, which brings clouds into the world, blows at any time.
bool blows(const Wind& wind) {
    return std::ranges::any_of(wind.keyframes, [](const WindKeyframe& keyframe) {
        return std::ranges::any_of(keyframe.levels, [](const WindLevel& level) {
            return level.velocity.east_m_per_s != 0 || level.velocity.north_m_per_s != 0;
        });
    });
}

// The constant background of automata where a profile or a grid is in its place.
void add_background(const Scene& scene, std::vector<std::string>& to) {
    if (!scene.layers.empty() && std::ranges::none_of(scene.layers, &LayerOptions::automaton)) return;
    const FieldOptions& field = scene.automaton.field;
    const Probabilities& constant = field.background;
    const Probabilities plain = FieldOptions{}.background;
    const auto replaced = [](const LayerOptions& layer) {
        return layer.is_veil || !layer.automaton || !layer.profile.empty();
    };
    const bool nowhere = scene.layers.empty() ? !field.profile.empty() : std::ranges::all_of(scene.layers, replaced);
    if (!field.profile.empty() && nowhere && !(constant == plain))
        to.emplace_back("[field.background] has no effect: [[field.profile]] is in its place");
    const char* const names[] = {"hum", "act", "ext"};
    const bool given[] = {constant.hum != plain.hum, constant.act != plain.act, constant.ext != plain.ext};
    for (const ProbabilityGrid& grid : field.grids)
        if (given[int(grid.of)])
            to.push_back(fmt::format("`field.background.{}` has no effect: a file of [[field.grids]] is in its place",
                                     names[int(grid.of)]));
    for (const LayerOptions& layer : scene.layers)
        if (!layer.is_veil && layer.automaton && !layer.profile.empty() && !(layer.background == constant))
            to.push_back(fmt::format("layer '{}': its `background` has no effect: its `profile` is in its place",
                                     layer.name));
}

// Notes how the number of clouds follows the state, where it cannot follow over the horizon.
void add_entering(const Scene& scene, std::size_t n, std::vector<std::string>& to) {
    const LayerOptions& layer = scene.layers[n];
    if (layer.entering != Entering::horizon) return;
    const Wind& wind = layer_wind(scene, n);
    if (scene.tile)
        to.push_back(fmt::format(
            "layer '{}': `entering` has no effect: in a `tile` no cloud leaves, and new ones form inside", layer.name));
    else if (!blows(wind) && wind.fields.empty())
        to.push_back(fmt::format(
            "layer '{}': no cloud will ever enter or leave: `entering` is \"horizon\", and there is no wind", layer.name));
    else if (!blows(wind))
        to.push_back(fmt::format(
            "layer '{}': no cloud will ever enter: `entering` is \"horizon\", and only the profile [[wind]] brings "
            "clouds, not [[wind_field]]",
            layer.name));
}

// Sections of automata and of density, where no layer has any.
void add_sections_of_automata(const Scene& scene, std::vector<std::string>& to) {
    const bool grows = scene.layers.empty() ||
                       std::ranges::any_of(scene.layers, [](const LayerOptions& layer) { return layer.automaton; });
    if (grows) return;
    if (!(scene.automaton.field == FieldOptions{})) to.emplace_back("[field] has no effect: no layer has an automaton");
    if (!(scene.density.detail == DetailOptions{})) to.emplace_back("[detail] has no effect: no layer has an automaton");
    if (has_density(scene)) return;
    DensityOptions density = scene.density;
    density.detail = {};
    if (!(density == DensityOptions{} && scene.density_files == DensityFileOptions{}))
        to.emplace_back("[density] has no effect: all layers are drawn directly");
}

// Returns whether a layer's bases are at the heights of a genus in the region, as far as they lie in its lattice.
bool has_heights_of_genus(const Scene& scene, const LayerOptions& layer) {
    const double ground_m = scene.render.ground.height_m, bottom_m = layer.placement.origin_m.z,
                 top_m = bottom_m + layer.extent.z * layer.placement.cell_size_m;
    return std::ranges::any_of(genera(), [&](const GenusFacts& facts) {
        const Range above_ground = base_height_m(facts.genus, scene.climate.region);
        Range heights{above_ground.min + ground_m, above_ground.max + ground_m};
        if (layer.automaton) heights = {std::max(heights.min, bottom_m), std::min(heights.max, top_m)};
        return layer.base_height_m == heights;
    });
}

// Keys that are of clouds which the scene has none of.
void add_keys_of_clouds(const Scene& scene, std::vector<std::string>& to) {
    const bool direct = std::ranges::any_of(
        scene.layers, [](const LayerOptions& layer) { return !layer.is_veil && !layer.automaton; });
    const bool region = std::ranges::any_of(scene.layers, [&](const LayerOptions& layer) {
        return !layer.is_veil && has_heights_of_genus(scene, layer);
    });
    if (scene.climate.region != ClimateOptions{}.region && !region)
        to.emplace_back("`climate.region` has no effect: no layer has the heights of a `genus`");
    const CloudLight& light = scene.render.light;
    if (light.light_distance_m != CloudLight{}.light_distance_m && light.lighting != Lighting::cfa &&
        scene.render.lightning.empty())
        to.emplace_back(
            "`light.light_distance_m` has no effect: `light.lighting` is not \"cfa\", and there is no [[lightning]]");
    if (scene.render.light.cfa_clouds_per_frame > 0 && !direct)
        to.emplace_back("`light.cfa_clouds_per_frame` has no effect: no layer is drawn directly (`automaton = false`)");
}

// Keys of a layer of clouds.
void add_layer_keys(const Scene& scene, std::size_t n, std::vector<std::string>& to) {
    const LayerOptions& layer = scene.layers[n];
    if (!layer.automaton) add_direct_keys(scene.automaton.field, layer, to);
    if (layer.automaton && layer.light_absorption != 1 && layer.light_absorption > 0 && !absorbs_in_voxels(scene, n))
        to.push_back(fmt::format(
            "layer '{}': `light_absorption` has no effect: no base model of its clouds has a finite "
            "`light_distance_m`, or they do not drive the automaton",
            layer.name));
    add_entering(scene, n, to);
    if (layer.automaton && layer.shear_s > 0)
        to.push_back(fmt::format(
            "layer '{}': `shear_s` has no effect on the clouds of an automaton, which the wind "
            "shears itself",
            layer.name));
}

// Names of the base models of layers without and with an automaton, and of those that absorb the light in voxels.
struct UsedModels {
    std::set<std::string> drawn, grown, absorbing;
};

UsedModels used_models(const Scene& scene) {
    UsedModels used;
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const LayerOptions& layer = scene.layers[n];
        if (layer.is_veil) continue;
        const std::set<std::string> models = models_of(scene, layer);
        (layer.automaton ? used.grown : used.drawn).insert(models.begin(), models.end());
        if (absorbs_in_voxels(scene, n)) used.absorbing.insert(models.begin(), models.end());
    }
    return used;
}

// Keys of a base model that only billboards have, where it drives automata alone.
void add_keys_of_billboards(const BaseModel& model, bool absorbs, std::vector<std::string>& to) {
    if (has_billboards(model))
        to.push_back(fmt::format(
            "base model '{}': the numbers, sizes and textures of billboards have no effect: all layers that use it "
            "have an automaton",
            model.name));
    if (std::isfinite(model.light_distance_m) && !absorbs)
        to.push_back(fmt::format(
            "base model '{}': `light_distance_m` has no effect: no cloud of it drives an automaton in a layer whose "
            "`light_absorption` is above 0",
            model.name));
}

// Keys of a base model that only automata have, where it is drawn directly alone.
void add_keys_of_ellipsoids(const BaseModel& model, std::vector<std::string>& to) {
    const auto add = [&](bool given, const char* key) {
        if (given)
            to.push_back(fmt::format("base model '{}': `{}` has no effect: all layers that use it are drawn directly",
                                     model.name, key));
    };
    add(model.own_centre, "centre");
    add(model.own_rim, "rim");
    add(std::ranges::any_of(model.seeds, [](const Seed& seed) { return seed.strength != Seed{}.strength; }),
        "seeds.strength");
}

void add_model_keys(const Scene& scene, std::vector<std::string>& to) {
    const UsedModels used = used_models(scene);
    for (const BaseModel& model : scene.models) {
        const bool drawn = used.drawn.contains(model.name), grown = used.grown.contains(model.name);
        if (grown && !drawn) add_keys_of_billboards(model, used.absorbing.contains(model.name), to);
        if (drawn && !grown) add_keys_of_ellipsoids(model, to);
        const bool texture = std::ranges::any_of(
            model.seeds, [](const Seed& seed) { return seed.texture != Seed{}.texture; });
        if (drawn && texture && !model.textures.empty())
            to.push_back(fmt::format("base model '{}': `seeds.texture` has no effect: its `textures` are in its place",
                                     model.name));
    }
}

}  // namespace

std::vector<std::string> keys_without_effect(const Scene& scene) {
    std::vector<std::string> result;
    const bool sea = scene.render.ground.pattern == GroundPattern::water;
    if (!sea && !(scene.render.water == WaterOptions{}))
        result.emplace_back("[water] has no effect: `ground.pattern` is not \"water\"");
    if (scene.render.light.bows == 0 && scene.render.light.droplet_variance != CloudLight{}.droplet_variance)
        result.emplace_back("`light.droplet_variance` has no effect: `light.bows` is 0");
    const PrecipitationOptions& rain = scene.render.precipitation;
    if (rain.splashes > 0 && (!rain.enabled || rain.kind == PrecipitationKind::snow))
        result.emplace_back("`precipitation.splashes` has no effect: it needs rain (`enabled`, `kind`)");
    add_terrain_keys(scene.render.terrain, result);
    add_background(scene, result);
    add_sections_of_automata(scene, result);
    add_keys_of_clouds(scene, result);
    if (sea && scene.ground_cover.enabled)
        result.emplace_back(
            "[wet_ground] has no effect but for its reflection and the rings of drops (`ripples`): rain and snow vanish "
            "in a ground of water");
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        if (scene.layers[n].is_slab) add_slab_keys(scene.layers[n], result);
        if (!scene.layers[n].is_veil) add_layer_keys(scene, n, result);
    }
    add_model_keys(scene, result);
    return result;
}

}  // namespace nephos
