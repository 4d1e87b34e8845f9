// SPDX-License-Identifier: Apache-2.0
#pragma once

// Skies, climate and layers in the form of the scene file, where they refer to each other by name. A layer is
// T's simulation at one height, with its own lattice, skies and wind. The functions below convert a layer
// into the options of the libraries that simulate it:
//
//     [[model]], [[sky]], [climate], [[layer]]  -->  sky_options()        -->  SkySimulation
//     [[layer]], what all layers share          -->  automaton_options()  -->  Automaton
//
// A scene without layers is one lattice with the field of [field] and uses none of this.

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "automaton/options.h"
#include "density/options.h"
#include "density/veil.h"
#include "render/options/veil_view.h"
#include "seeds/coupling.h"
#include "seeds/genera.h"
#include "seeds/rain_area.h"
#include "seeds/rain_finder.h"
#include "seeds/sky.h"
#include "seeds/sky_simulation.h"

namespace nephos {

struct Scene;

// The clouds of one atmospheric state; layers name the skies that they use.
struct NamedSky {
    std::string name;
    double state = 0;                 // 0 clear .. 1 storm; no two skies of one layer share it
    int clouds = 0;                   // in the world at this state, 0..100000
    std::vector<std::string> models;  // names of base models, equally likely; may be empty when clouds = 0
    int generated = 10;               // different clouds made of each, 1..65536
    bool operator==(const NamedSky&) const = default;
};

// The state of the atmosphere, shared by all layers.
struct ClimateOptions {
    Region region = Region::temperate;  // climatic belt, for the heights of genera
    // State over time: linear between points, constant outside; without points 0.
    std::vector<StatePoint> schedule;
    bool operator==(const ClimateOptions&) const = default;
};

// AttachedRain (seeds/rain_area.h) with the base model by name.
struct AttachedRainRule {
    std::string model;           // empty: of any
    std::optional<Genus> genus;  // none: of any
    Range state{0, 1};           // of the sky that the cloud was drawn from
    double size_scale = 1;
    double intensity_mm_per_h = 5;
    bool operator==(const AttachedRainRule&) const = default;
};

// How much of a veil there is at one state of the atmosphere.
struct VeilPresence {
    double state = 0;     // 0 clear .. 1 storm
    double fraction = 1;  // of its opacity, 0..1
    bool operator==(const VeilPresence&) const = default;
};

struct LayerRain {
    std::vector<PlacedRain> placed;
    std::vector<AttachedRainRule> attached;
    bool find = false;         // detect rain in the automaton's state
    RainFinderOptions finder;  // used if `find`
    // Humid air above every area; infinite heights mean the bottom and the top of the layer's lattice.
    HumidColumn column{.bottom_m = -std::numeric_limits<double>::infinity(),
                       .top_m = std::numeric_limits<double>::infinity()};
    bool operator==(const LayerRain&) const = default;
};

// Metamorphosis (seeds/sky.h) with the base models by name.
struct NamedMetamorphosis {
    std::string from, to;
    Range state{0, 1};
    bool operator==(const NamedMetamorphosis&) const = default;
};

struct LayerOptions {
    std::string name;  // letters, digits, '-' and '_': part of file names; no two layers share one
    // True: the density is that of `veil`, a function of position and time, without skies, clouds and
    // automaton. Of the fields below such a layer uses lattice, opacity, wind, slab and detail alone.
    bool is_veil = false;
    VeilOptions veil;                // its seed is that of veil_options()
    bool is_slab = false;            // true: pictures show the veil as `slab` says, instead of its lattice
    VeilView slab;
    std::vector<VeilPresence> presence;  // of a veil; states rise strictly; without any it is always there, whole
    std::vector<std::string> skies;  // names, at least one
    bool automaton = true;           // false: clouds are drawn directly as billboards, without density
    double opacity = 1;              // factor of the density, above 0, at most 1

    // The lattice, as in AutomatonOptions. Its horizontal rectangle is the clouds' world.
    Extent extent{256, 128, 20};
    Placement placement;
    Boundaries boundaries;
    Probabilities background{0, 0, 0.1};  // of the field, everywhere (field.h)
    std::vector<BackgroundKeyframe> profile;  // of it by height and time, as FieldOptions::profile
    // Of the field, beside the clouds of the skies and what the scene's [field] has for all layers.
    std::vector<Ellipsoid> ellipsoids;
    std::vector<EllipsoidScatter> scatters;
    // As Scene::initial_state_file, of this layer.
    std::optional<std::filesystem::path> initial_state_file;

    Range base_height_m{1000, 1000};   // world z of a cloud's base, drawn for each cloud
    Wind wind;                         // without keyframes: the scene's wind
    std::vector<StatePoint> schedule;  // without points: the climate's

    double formation_s = 300, dissolution_s = 300, formation_softness = 0.5;  // as in SkyOptions
    bool cross_edges_whole = true;  // the reader's default: only with an automaton
    Entering entering = Entering::anywhere;
    std::vector<NamedMetamorphosis> metamorphoses;
    double shear_s = 0;  // as in SkyOptions
    CouplingOptions coupling;
    double light_absorption =
        1;  // 0..1, part of the base models' absorption that voxels have (parcel_absorption.h)
    LayerRain rain;
    bool own_detail = false;  // true: `detail` holds for this layer instead of the scene's
    DetailOptions detail;
    bool operator==(const LayerOptions&) const = default;
};

// Largest number of layers of a scene.
inline constexpr std::size_t kMaxLayers = 64;

// Returns the seed of a layer's automaton: the scene's own for layer 0, so that a scene with one layer has
// the bits of one without, and 64 bits of Philox for the others. Pure.
std::uint64_t layer_seed(std::uint64_t scene_seed, std::size_t layer);

// Returns the number of lattices: one per layer, or 1 for a scene without layers.
std::size_t lattice_count(const Scene& scene);

// Returns true when the layer, or any layer of the scene, has density: an automaton or a veil.
bool has_density(const LayerOptions& layer);
bool has_density(const Scene& scene);

// Convert layer `layer` < scene.layers.size() into the options of the libraries. Pure; throw Error(usage) on
// an unknown name, which only a scene that did not come from the reader can have.
SkyOptions sky_options(const Scene& scene, std::size_t layer);
AutomatonOptions automaton_options(const Scene& scene, std::size_t layer);
std::vector<AttachedRain> attached_rain(const Scene& scene, std::size_t layer);
// Returns the options of a layer that is a veil, with the layer's seed; of a tile with its period and no margin. Pure.
VeilOptions veil_options(const Scene& scene, std::size_t layer);

// Returns the factor of a layer's density at a time: its opacity, of a veil times its presence, linear in the state of the
// climate between its points and constant beyond them. 0..1; pure.
double opacity_at(const LayerOptions& layer, const ClimateOptions& climate, double time_s);

// Returns whether the light distances of base models act on the voxels of a layer: it has an automaton that its clouds drive,
// `light_absorption` above 0, and a base model, or one that others turn into, with a finite light distance. Pure.
bool absorbs_in_voxels(const Scene& scene, std::size_t layer);

// Returns the bounding rectangle of the worlds of all layers, which the map of the ground covers. Pure.
WorldRectangle whole_world(const Scene& scene);

// Returns the detail of a layer: its own, or the scene's; a veil has only its own.
DetailOptions layer_detail(const Scene& scene, std::size_t layer);

// Returns the number of lattices of the scene, automata and veils, whose clouds have detail.
std::size_t count_detailed(const Scene& scene);

// Returns the wind of a layer: its own, or the scene's if it has none.
const Wind& layer_wind(const Scene& scene, std::size_t layer);

}  // namespace nephos
