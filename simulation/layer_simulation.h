// SPDX-License-Identifier: Apache-2.0
#pragma once

// One layer of a scene while it is simulated, and all of them together. A step from n to n + 1:
//
//     1. every box of the sky's clouds at n makes an ellipsoid, every rain area at n a humid column
//     2. the automaton steps with that field
//     3. the sky's clouds move, enter and leave
//     4. rain is looked for in the automaton at n + 1
//
// A state at 0 that is drawn from the field is drawn with the ellipsoids and columns of 1.
//
// so that sky and automaton are carried by the same wind over the same way. A layer without automaton has a
// sky alone; a scene without layers is one nameless layer with an automaton alone; a veil has none of these,
// only the number of its steps.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "automaton/automaton.h"
#include "density/combine.h"
#include "scenes/format/scene.h"
#include "seeds/rain_finder.h"
#include "seeds/sky_simulation.h"

namespace nephos {

// Most steps of one run: every step number stays exact in a double and in a 32-bit counter of randomness.
inline constexpr std::uint64_t kMaxSteps = 1'000'000'000;

// Selects the parts of a layer that are simulated: all, or an automaton only where rain is looked for in it.
enum class LayerParts { all, weather };

class LayerSimulation {
  public:
    // Starts at step 0; `layer` < lattice_count(scene). With `initial` the automaton starts from it. Throws as
    // Automaton and SkySimulation.
    LayerSimulation(const Scene& scene, std::size_t layer, std::optional<Lattice> initial = {},
                    LayerParts parts = LayerParts::all);

    void step();

    const std::string& name() const { return options_.name; }
    std::uint64_t steps() const;
    const Automaton* automaton() const { return automaton_ ? &*automaton_ : nullptr; }
    const SkySimulation* sky() const { return sky_ ? &*sky_ : nullptr; }
    double opacity() const { return options_.opacity; }
    // Returns true for a veil; its density at any time, times the opacity, does not depend on steps.
    bool is_veil() const { return options_.is_veil; }
    DensityGrid veil_at(double time_s) const;
    // Return whether there is a density, and the box that it fills.
    bool has_density() const { return options_.automaton || options_.is_veil; }
    GridBox box() const;
    // Returns what lies beyond the box of its density; a veil ends at its sides, but for that of a tile.
    Boundaries boundaries() const;
    // Returns the rain areas now: placed, attached, found.
    std::vector<RainArea> rain() const;
    // Returns the hash of the automaton's planes; without automaton of the sky's saved state; of a veil, XXH3-128 of what
    // decides its density: the layer as canonical scene text with its seed, and the step.
    StateHash hash() const;

    // Serialise and restore the complete state; `restore` throws Error(io) on bytes that no layer of this scene wrote.
    std::vector<std::byte> save() const;
    void restore(std::span<const std::byte> bytes);

  private:
    std::vector<ActiveEllipsoid> field_of_clouds() const;  // ellipsoids of boxes, then columns of rain, now

    LayerOptions options_;  // its defaults in a scene without layers
    std::uint32_t number_ = 0;
    double time_step_s_ = 10;
    VeilOptions veil_;
    Wind wind_;                // of a veil
    ClimateOptions climate_;   // that a veil comes and goes with
    std::string veil_text_;    // what its hash is made of
    std::uint64_t steps_ = 0;  // of a layer without automaton and sky
    GridBox box_;              // of its density
    std::vector<AttachedRain> attached_;
    std::optional<Automaton> automaton_;
    std::optional<SkySimulation> sky_;
    std::optional<RainFinder> finder_;
};

// Makes every layer of a scene at step 0. `initial` only for a scene without layers.
std::vector<LayerSimulation> make_layers(const Scene& scene, std::optional<Lattice> initial = {},
                                         LayerParts parts = LayerParts::all);

// Reads the state that the simulation starts from: the file `from`, else the scene's initial_state_file; none
// where the scene names no file (its own start). Throws as read_state().
std::optional<Lattice> initial_state(const Scene& scene, const std::string& from = {});

// The state at step 0 and the hash that identify a simulation.
struct SimulationStart {
    std::optional<Lattice> initial;  // as initial_state()
    std::string simulation_hash;     // of the scene with that state (scenes/format/writer.h)
};
SimulationStart simulation_start(const Scene& scene);

// Makes every layer at step 0, after a check of memory. `scene_file` names the scene in errors. Throws
// Error(usage) when a scene with layers is to start from a file.
std::vector<LayerSimulation> start_layers(const Scene& scene, const std::string& scene_file,
                                          const std::string& from);

// Returns the hash of a state of all layers: that of the only one, otherwise XXH3-128 of theirs in order.
StateHash combined_hash(std::span<const StateHash> hashes);
StateHash combined_hash(std::span<const LayerSimulation> layers);

}  // namespace nephos
