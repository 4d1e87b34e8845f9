// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the simulation of a scene takes from other files than those of its start: velocities of the wind and
// probabilities of the field.

#include <string>

#include "scenes/format/scene.h"

namespace nephos {

// Returns the scene with the values of these files, where it has not read them yet. Throws Error(io) naming a file that
// cannot be read, Error(usage) when they do not fit into the memory.
Scene with_files(Scene scene);

// Returns a text that differs where their values differ; empty without files. `scene` as with_files() returns it.
std::string hash_of_files(const Scene& scene);

}  // namespace nephos
