// SPDX-License-Identifier: Apache-2.0
// Checks of layers together with the scene: keys that default to those of the scene, and options that SkySimulation would
// refuse.

#include <algorithm>
#include <cmath>
#include <string>

#include <glm/common.hpp>

#include "core/math.h"
#include "density/detail.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"
#include "seeds/sky_simulation.h"

namespace nephos {
namespace {

// Keys that are missing take the values of the scene, or of other keys of the layer.
void fill_in_lattice(const SectionReader& reader, const Scene& scene, LayerOptions& layer) {
    const SectionReader lattice = reader.below("lattice");
    const AutomatonOptions& shared = scene.automaton;
    if (!lattice.find("cells")) layer.extent = shared.extent;
    if (!lattice.find("cell_size_m")) layer.placement.cell_size_m = shared.placement.cell_size_m;
    if (!lattice.find("origin_m")) layer.placement.origin_m = shared.placement.origin_m;
}

void fill_in(const SectionReader& reader, const Scene& scene, LayerOptions& layer) {
    const SectionReader lattice = reader.below("lattice"), background = reader.below("background");
    const AutomatonOptions& shared = scene.automaton;
    fill_in_lattice(reader, scene, layer);
    fill_in_centres(layer.scatters, layer.extent, layer.placement);
    if (layer.initial_state_file && !layer.automaton) {
        lattice.report("initial_state", lattice.quoted("initial_state") + " stands in a layer without automaton",
                       "expected `automaton` = true, or no initial state");
    }
    if (!lattice.find("boundaries")) layer.boundaries = shared.boundaries;
    if (!reader.find("profile") && !reader.find("background")) layer.profile = shared.field.profile;
    if (!background.find("hum")) layer.background.hum = shared.field.background.hum;
    if (!background.find("act")) layer.background.act = shared.field.background.act;
    if (!background.find("ext")) layer.background.ext = shared.field.background.ext;
    if (!reader.below("coupling").find("min_semi_axis_m")) {
        layer.coupling.min_semi_axis_m = layer.placement.cell_size_m;
    }
    if (!reader.find("cross_edges_whole")) layer.cross_edges_whole = layer.automaton;
    HumidColumn& column = layer.rain.column;
    if (std::isinf(column.bottom_m)) column.bottom_m = layer.placement.origin_m.z;
    if (std::isinf(column.top_m)) {
        column.top_m = layer.placement.origin_m.z + layer.extent.z * layer.placement.cell_size_m;
    }
}

// Returns the heights of bases of a genus, world z: those above the ground in the scene's region, and the ground's.
Range bases_of_genus(const Entry& genus, const Scene& scene) {
    const Range above_ground = base_height_m(genus_from_name(genus.value.text), scene.climate.region);
    const double ground_m = scene.render.ground.height_m;
    return {above_ground.min + ground_m, above_ground.max + ground_m};
}

// Returns the heights between which the layer's lattice lies, as messages give them.
std::string heights_of_lattice(const LayerOptions& layer) {
    const double bottom = layer.placement.origin_m.z;
    const double top = bottom + layer.extent.z * layer.placement.cell_size_m;
    return number_text(bottom) + " to " + number_text(top) + " m of its lattice";
}

// Base heights: those of the file, or of the genus as far as they lie in the lattice.
void fill_in_base_height(const SectionReader& reader, const Scene& scene, LayerOptions& layer) {
    const double bottom = layer.placement.origin_m.z;
    const double top = bottom + layer.extent.z * layer.placement.cell_size_m;
    const std::string lattice_text = heights_of_lattice(layer);
    if (const Entry* genus = reader.find("genus")) {
        const Range heights = bases_of_genus(*genus, scene);
        layer.base_height_m = heights;
        if (!layer.automaton) return;
        layer.base_height_m = {std::max(heights.min, bottom), std::min(heights.max, top)};
        if (layer.base_height_m.min <= layer.base_height_m.max) return;
        reader.report("genus",
                      "bases of " + genus->value.text + " lie from " + number_text(heights.min) + " to " +
                          number_text(heights.max) + " m, outside the " + lattice_text,
                      "expected a lattice that reaches these heights, or `base_height_m`");
    } else if (reader.find("base_height_m") == nullptr) {
        reader.report("name", reader.quoted("base_height_m") + " is missing",
                      "expected `base_height_m` or `genus`");
    } else if (layer.automaton && (layer.base_height_m.min < bottom || layer.base_height_m.max > top)) {
        reader.report("base_height_m", reader.quoted("base_height_m") + " leaves the " + lattice_text,
                      "expected heights within the layer's lattice");
    }
}

void check_rain(const SectionReader& reader, const LayerOptions& layer) {
    const SectionReader rain = reader.below("rain");
    if (layer.rain.find && !layer.automaton) {
        rain.report("find", rain.quoted("find") + " is true in a layer without automaton",
                    "expected `automaton` = true, or rain that is placed or attached");
    }
    if (layer.rain.column.bottom_m >= layer.rain.column.top_m) {
        const SectionReader column = rain.below("column");
        column.report(column.find("top_m") ? "top_m" : "bottom_m",
                      column.quoted("bottom_m") + " = " + number_text(layer.rain.column.bottom_m) +
                          " is not below `top_m` = " + number_text(layer.rain.column.top_m),
                      "expected a column that has a height");
    }
}

void check_slab(const SectionReader& reader, const LayerOptions& layer) {
    if (!layer.is_slab || layer.is_veil) return;
    reader.report("slab", reader.quoted("slab") + " stands in a layer without `veil`",
                  "expected none: only veils are drawn per pixel");
}

// Presence is that of veils, at states that rise.
void check_presence(const SectionReader& reader, const LayerOptions& layer) {
    if (!layer.presence.empty() && !layer.is_veil) {
        reader.report("presence", reader.quoted("presence") + " stands in a layer without `veil`",
                      "expected none: how many clouds there are at a state is that of the layer's skies");
    }
    for (std::size_t n = 1; n < layer.presence.size(); ++n) {
        if (layer.presence[n].state > layer.presence[n - 1].state) continue;
        const SectionReader item = reader.item("presence", n);
        item.report("state", item.quoted("state") + " is " + number_text(layer.presence[n].state) +
                                 ", not above the one before it",
                    "expected states that rise");
    }
}

// Reports a veil's base that is none of its genus.
void check_base_of_genus(const SectionReader& reader, const Entry& genus, const Scene& scene, double base_m) {
    const Range heights = bases_of_genus(genus, scene);
    if (base_m >= heights.min && base_m <= heights.max) return;
    const SectionReader veil = reader.below("veil");
    veil.report("base_m",
                veil.quoted("base_m") + " is " + number_text(base_m) + "; bases of " + genus.value.text +
                    " lie from " + number_text(heights.min) + " to " + number_text(heights.max) + " m",
                "expected one of these heights, none, or no `genus`");
}

// Places a veil without `base_m` in the middle of the heights of its genus, and there a lattice that has no place of
// its own.
void place_by_genus(const SectionReader& reader, const Entry& genus, const Scene& scene, LayerOptions& layer) {
    const Range heights = bases_of_genus(genus, scene);
    const double base_m = (heights.min + heights.max) / 2;
    layer.veil.base_m = base_m;
    double& bottom = layer.placement.origin_m.z;
    if (!reader.below("lattice").find("origin_m")) bottom = base_m;
    if (base_m >= bottom && base_m < bottom + layer.extent.z * layer.placement.cell_size_m) return;
    reader.report("genus",
                  "the base of a veil of " + genus.value.text + ", the middle of " + number_text(heights.min) +
                      " to " + number_text(heights.max) + " m, is outside the " + heights_of_lattice(layer),
                  "expected a lattice that reaches this height, one without `origin_m`, or `veil.base_m`");
}

// Fills in the heights of a veil: those of the file, of its genus, or of the lattice.
void fill_in_heights_of_veil(const SectionReader& reader, const Scene& scene, LayerOptions& layer) {
    const SectionReader veil = reader.below("veil");
    const Entry* genus = reader.find("genus");
    const bool has_base = veil.find("base_m") != nullptr;
    if (genus && has_base) check_base_of_genus(reader, *genus, scene, layer.veil.base_m);
    if (genus && !has_base) place_by_genus(reader, *genus, scene, layer);
    const double bottom = layer.placement.origin_m.z;
    if (!genus && !has_base) layer.veil.base_m = bottom;
    if (!veil.find("top_m")) layer.veil.top_m = bottom + layer.extent.z * layer.placement.cell_size_m;
}

// Finishes a layer that is a veil: defaults by its lattice and wind, and keys without effect.
void finish_veil_layer(const SectionReader& reader, const Scene& scene, LayerOptions& layer) {
    for (const std::string_view key : keys_of_clouds()) {
        if (reader.find(key) == nullptr) continue;
        reader.report(key, reader.quoted(key) + " stands beside `veil`",
                      "expected `name`, `genus`, `opacity`, `lattice`, `wind`, `presence`, `veil`, `slab` and "
                      "`detail` alone: a veil has no "
                      "clouds and no automaton");
    }
    const SectionReader lattice = reader.below("lattice"), veil = reader.below("veil");
    if (lattice.find("boundaries") != nullptr) {
        lattice.report("boundaries", lattice.quoted("boundaries") + " stands beside `veil`",
                       "expected none: a veil is a function of place and goes on beyond its lattice");
    }
    if (lattice.find("initial_state") != nullptr) {
        lattice.report("initial_state", lattice.quoted("initial_state") + " stands beside `veil`",
                       "expected none: a veil has no state");
    }
    fill_in_lattice(reader, scene, layer);
    if (scene.tile) layer.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
    fill_in_heights_of_veil(reader, scene, layer);
    if (veil.find("direction_deg")) return;
    const Wind& wind = layer.wind.keyframes.empty() ? scene.automaton.wind : layer.wind;
    const Velocity velocity = wind_at(wind, layer.veil.top_m, 0);
    layer.veil.direction_deg = degrees_of_vector(velocity.east_m_per_s, velocity.north_m_per_s);
}

// Returns half the edges of the largest rain area that a rule attaches to clouds.
Vec3 largest_rain(const AttachedRainRule& rule, const SkySimulation& sky) {
    Vec3 largest{};
    for (const CloudShape& shape : sky.shapes()) {
        const BaseModel& model = sky.options().models[shape.model];
        if ((!rule.model.empty() && model.name != rule.model) || (rule.genus && model.genus != rule.genus))
            continue;
        const Vec3 size = shape.cloud.high_m - shape.cloud.low_m;
        largest = glm::max(largest, Vec3(size.x, size.y, 0) * (rule.size_scale / 2));
    }
    return largest;
}

// Checks the reach of the ellipsoids that clouds and rain make in the layer's automaton; `sky` has all shapes of
// clouds that will ever appear.
void check_reach_of_clouds(const SectionReader& reader, const LayerOptions& layer, const SkySimulation& sky) {
    const Vec3 largest = largest_reach_m(layer.extent, layer.placement.cell_size_m, layer.boundaries);
    const auto check_table = [&](const SectionReader& table, const std::string& what, const Vec3& reach,
                                 std::string_view horizontal, std::string_view vertical) {
        const SectionReader& there = table.table.entries.empty() ? reader : table;
        check_periodic_reach(there, what, largest, reach, horizontal, vertical);
    };
    const SectionReader coupling = reader.below("coupling"), rain = reader.below("rain");
    Vec3 of_boxes{};
    for (const CloudShape& shape : sky.shapes())
        for (const SeedBox& box : shape.cloud.boxes)
            if (sky.options().models[shape.model].seeds[box.seed].strength > 0)
                of_boxes = glm::max(of_boxes, box.size_m * (layer.coupling.size_scale / 2));
    if (layer.coupling.strength > 0) {
        check_table(coupling, "the largest box of a cloud, scaled by " + coupling.quoted("size_scale") + ",",
                    of_boxes, "size_scale", "size_scale");
        check_table(coupling, coupling.quoted("min_semi_axis_m"), Vec3(layer.coupling.min_semi_axis_m),
                    "min_semi_axis_m", "min_semi_axis_m");
    }
    const HumidColumn& column = layer.rain.column;
    if (column.strength <= 0) return;
    for (std::size_t n = 0; n < layer.rain.placed.size(); ++n) {
        const PlacedRain& placed = layer.rain.placed[n];
        if (placed.intensity_mm_per_h <= 0) continue;
        const Ellipsoid area{.semi_axes_m = {placed.semi_a_m, placed.semi_b_m, 0}, .yaw_deg = placed.yaw_deg};
        check_periodic_reach(rain.item("placed", n), {}, largest, reach_m(area),
                             placed.semi_a_m >= placed.semi_b_m ? "semi_a_m" : "semi_b_m", "semi_a_m");
    }
    for (std::size_t n = 0; n < layer.rain.attached.size(); ++n) {
        if (layer.rain.attached[n].intensity_mm_per_h <= 0) continue;
        const SectionReader reader_of_rule = rain.item("attached", n);
        check_periodic_reach(
            reader_of_rule,
            "the rain of the largest cloud, scaled by " + reader_of_rule.quoted("size_scale") + ",", largest,
            largest_rain(layer.rain.attached[n], sky), "size_scale", "size_scale");
    }
    if (!layer.rain.placed.empty() || !layer.rain.attached.empty() || layer.rain.find)
        check_table(rain.below("column"), "the humid column `" + rain.path + ".column`",
                    {0, 0, (column.top_m - column.bottom_m) / 2}, "top_m", "top_m");
}

// The libraries' own checks, and whether every cloud fits into the world: makes the clouds.
void check_simulation(const SectionReader& reader, const Scene& scene, std::size_t layer) {
    const LayerOptions& options = scene.layers[layer];
    if (options.is_veil) {
        try {
            check(veil_options(scene, layer), options.extent, options.placement);
        } catch (const Error& error) {
            if (error.code() != ErrorCode::usage) throw;  // no fault of the scene
            reader.report("veil", error.what());
        }
        return;
    }
    if (options.automaton) {
        const std::size_t before = reader.document.problems.size();
        check_reach_of_ellipsoids(
            reader, options.ellipsoids, options.scatters,
            largest_reach_m(options.extent, options.placement.cell_size_m, options.boundaries));
        if (reader.document.problems.size() > before) return;
    }
    try {
        if (options.automaton) check(automaton_options(scene, layer));
        const SkySimulation sky(sky_options(scene, layer));
        if (options.automaton) check_reach_of_clouds(reader, options, sky);
    } catch (const Error& error) {
        if (error.code() != ErrorCode::usage) throw;
        reader.report("name", error.what());
    }
}

// Reports layers that do not repeat over the rectangle of the first.
void check_tile(const SectionReader& reader, const Scene& scene) {
    if (!scene.tile) return;
    const LayerOptions& first = scene.layers.front();
    const auto edge = [](const LayerOptions& layer, int axis) {
        return (axis == 0 ? layer.extent.x : layer.extent.y) * layer.placement.cell_size_m;
    };
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const LayerOptions& layer = scene.layers[n];
        const SectionReader item = reader.item("layer", n), lattice = item.below("lattice");
        if (!has_density(layer)) {
            item.report("automaton", "the layer " + enclosed(layer.name, '"') + " of a tile has no density",
                        "expected `automaton` = true: clouds drawn as billboards do not repeat");
            continue;
        }
        if (layer.boundaries.x != Boundary::periodic || layer.boundaries.y != Boundary::periodic) {
            lattice.report("boundaries", lattice.quoted("boundaries") + " is open in a tile",
                           "expected [\"periodic\", \"periodic\", \"open\"], or none");
        }
        for (int axis = 0; axis < 2; ++axis) {
            const bool same = std::abs(layer.placement.origin_m[axis] - first.placement.origin_m[axis]) < 1e-6 &&
                              std::abs(edge(layer, axis) - edge(first, axis)) < 1e-6;
            if (same) continue;
            const auto text = [&](const LayerOptions& of) {
                const double low = of.placement.origin_m[axis];
                return number_text(low) + " to " + number_text(low + edge(of, axis)) + " m";
            };
            lattice.report("cells",
                           "the layer " + enclosed(layer.name, '"') + " goes from " + text(layer) + " along " +
                               (axis == 0 ? "x" : "y"),
                           "expected the rectangle of the layer " + enclosed(first.name, '"') + ", " + text(first) +
                               ": all layers of a tile share one period");
        }
    }
}

// Reports the first layer with detail that is one too many for a picture.
void check_count_of_detailed(const SectionReader& reader, const Scene& scene) {
    if (count_detailed(scene) <= kMaxDetailedClouds) return;
    std::size_t count = 0;
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        if (!has_density(scene.layers[n]) || !layer_detail(scene, n).enabled) continue;
        if (++count <= kMaxDetailedClouds) continue;
        reader.item("layer", n)
            .report("detail", std::to_string(count_detailed(scene)) + " layers with detail are too many",
                    "expected at most " + std::to_string(kMaxDetailedClouds) +
                        ", and `detail.enabled = false` in the others");
        return;
    }
}

// Reports keys that a scene with layers may not have, and keys that need layers.
void check_layers_or_field(const SectionReader& reader, const Scene& scene) {
    if (scene.layers.empty()) {
        if (!scene.skies.empty()) {
            reader.report("sky", "the scene has skies and no layer",
                          "expected [[layer]] tables that use them");
        }
        return;
    }
    if (scene.initial_state_file) {
        reader.report("lattice", "the scene has layers and `lattice.initial_state`",
                      "expected `initial_state` in the `lattice` of the layer that starts from the file");
    }
}

}  // namespace

void finish_layers(const SectionReader& reader, Scene& scene) {
    check_models_and_references(reader, scene);
    if (!reader.sound({"model", "models", "sky", "climate", "layer", "lattice", "field"})) return;
    check_layers_or_field(reader, scene);
    check_skies_and_layer_names(reader, scene);
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const SectionReader item = reader.item("layer", n);
        LayerOptions& layer = scene.layers[n];
        check_presence(item, layer);
        check_slab(item, layer);
        check_wind_times(item, layer.wind);
        check_profile_times(item, layer.profile);
        if (layer.is_veil) {
            finish_veil_layer(item, scene, layer);
            continue;
        }
        fill_in(item, scene, layer);
        fill_in_base_height(item, scene, layer);
        check_rain(item, layer);
    }
    if (!scene.layers.empty() && reader.document.problems.empty()) check_tile(reader, scene);
    if (!reader.document.problems.empty()) return;
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        check_simulation(reader.item("layer", n), scene, n);
    check_count_of_detailed(reader, scene);
}

}  // namespace nephos
