// SPDX-License-Identifier: Apache-2.0
#pragma once

// What hash, state and run share: a simulation that fits into memory and starts where the user says.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "automaton/automaton.h"
#include "scenes/format/scene.h"
#include "simulation/layer_simulation.h"

namespace nephos {

// Most steps of one run: every step number stays exact in a double and in a 32-bit counter of randomness.
inline constexpr std::uint64_t kMaxSteps = 1'000'000'000;

// Throws Error(usage) unless `bytes` of memory are available; `what` starts the sentence.
void require_memory(std::size_t bytes, const std::string& what);

// The state that the simulation starts from: the file `from`, else the scene's initial_state_file, else
// nothing (the scene's own start). Throws as read_state().
std::optional<Lattice> initial_state(const Scene& scene, const std::string& from = {});

// Every layer at step 0, after a check of memory. `scene_file` names the scene in errors. Throws Error(usage)
// when a scene with layers is to start from a file.
std::vector<LayerSimulation> start_layers(const Scene& scene, const std::string& scene_file,
                                          const std::string& from);

}  // namespace nephos
