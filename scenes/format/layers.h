// SPDX-License-Identifier: Apache-2.0
#pragma once

// Skies, climate and layers as a scene file says them: by name. A layer is T's simulation at one height: its
// own lattice, skies and wind. The functions below turn a layer into the options of the libraries that
// simulate it:
//
//     [[model]], [[sky]], [climate], [[layer]]  -->  sky_options()        -->  SkySimulation
//     [[layer]], what all layers share          -->  automaton_options()  -->  Automaton
//
// A scene without layers is one lattice with the field of [field], as before; none of this concerns it.

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "automaton/options.h"
#include "density/veil.h"
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

// The atmosphere that all layers share.
struct ClimateOptions {
    Region region = Region::temperate;  // where on Earth: decides the heights of genera
    std::vector<StatePoint>
        schedule;  // state over time: linear between points, constant outside; no point: 0
    bool operator==(const ClimateOptions&) const = default;
};

// Rain below every cloud of a kind, the base model by name (seeds/rain_area.h).
struct AttachedRainRule {
    std::string model;           // empty: of any
    std::optional<Genus> genus;  // none: of any
    Range state{0, 1};           // of the sky that the cloud came from
    double size_scale = 1;
    double intensity_mm_per_h = 5;
    bool operator==(const AttachedRainRule&) const = default;
};

struct LayerRain {
    std::vector<PlacedRain> placed;
    std::vector<AttachedRainRule> attached;
    bool find = false;         // look for rain in the automaton
    RainFinderOptions finder;  // how
    // Humid air above every area; infinite heights stand for the bottom and the top of the layer's lattice.
    HumidColumn column{.bottom_m = -std::numeric_limits<double>::infinity(),
                       .top_m = std::numeric_limits<double>::infinity()};
    bool operator==(const LayerRain&) const = default;
};

struct LayerOptions {
    std::string name;  // letters, digits, '-' and '_': part of file names; no two layers share one
    // The density is that of `veil`, a function of place and time: no skies, no clouds, no automaton. What
    // follows further down but for lattice, opacity and wind is nothing to such a layer.
    bool is_veil = false;
    VeilOptions veil;                // its seed is that of veil_options()
    std::vector<std::string> skies;  // names, at least one
    bool automaton = true;           // false: clouds are drawn directly as billboards, there is no density
    double opacity = 1;              // times the density, above 0, at most 1: veils are thin

    // The lattice, as in AutomatonOptions. Its horizontal rectangle is the world in which the clouds live.
    Extent extent{256, 128, 20};
    Placement placement;
    Boundaries boundaries;
    Probabilities background{0, 0, 0.1};  // of the field, everywhere (field.h)

    Range base_height_m{1000, 1000};   // world z of clouds' bases, drawn for each cloud
    Wind wind;                         // no keyframe: the scene's wind
    std::vector<StatePoint> schedule;  // no point: the climate's

    double formation_s = 300, dissolution_s = 300, formation_softness = 0.5;  // as in SkyOptions
    bool cross_edges_whole = true;  // the reader's default: only with an automaton
    CouplingOptions coupling;
    LayerRain rain;
    bool operator==(const LayerOptions&) const = default;
};

// Most layers of one scene.
inline constexpr std::size_t kMaxLayers = 64;

// The seed of a layer's randomness in the automaton: the scene's own for layer 0, so that a scene with one
// layer has the bits of one without, and 64 bits of Philox for the others. A pure function.
std::uint64_t layer_seed(std::uint64_t scene_seed, std::size_t layer);

// Lattices that the scene is simulated on: its layers, or the one of a scene without layers.
std::size_t lattice_count(const Scene& scene);

// Whether frames have a density: of a layer with an automaton or a veil; of any of them.
bool has_density(const LayerOptions& layer);
bool has_density(const Scene& scene);

// What the libraries need to simulate layer `layer` < scene.layers.size(). Pure; throw Error(usage) when the
// scene was not made by the reader and a name in it is unknown.
SkyOptions sky_options(const Scene& scene, std::size_t layer);
AutomatonOptions automaton_options(const Scene& scene, std::size_t layer);
std::vector<AttachedRain> attached_rain(const Scene& scene, std::size_t layer);
// Of a layer that is a veil, with the layer's seed.
VeilOptions veil_options(const Scene& scene, std::size_t layer);

// The rectangle in which clouds live, of all layers together: the world that has a map of its ground.
WorldRectangle whole_world(const Scene& scene);

// The wind of a layer: its own or the scene's.
const Wind& layer_wind(const Scene& scene, std::size_t layer);

// The sky of every layer that has one, the first layer's first, as it stands at a time: at its last step,
// with `since_step_s` the rest. SkySimulation::ahead(cloud, time_s(), since_step_s) moves a cloud on to the
// moment itself. All steps from 0 are taken again, microseconds each. For pictures of clouds without an
// automaton; a run has them in its frames (simulation/pipeline.h).
struct SkiesAtTime {
    std::vector<SkySimulation> skies;
    double since_step_s = 0;
};

// Throws Error(usage) when time_s is negative or not finite, and as SkySimulation.
SkiesAtTime skies_at(const Scene& scene, double time_s);

}  // namespace nephos
