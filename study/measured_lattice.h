// SPDX-License-Identifier: Apache-2.0
#pragma once

// Finds the lattice of a scene that a study measures.

#include <cstddef>
#include <string>

#include "scenes/format/scene.h"

namespace nephos {

// Returns the place among the lattices of the scene (automaton_options()) of the one that `layer` names: a layer with an
// automaton that is no veil. An empty name means the only one: that of a scene without layers, or of the only such layer.
// Throws Error(usage) that says what the scene has. Thread-safe; pure.
std::size_t measured_lattice(const Scene& scene, const std::string& layer);

}  // namespace nephos
