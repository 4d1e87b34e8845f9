// SPDX-License-Identifier: Apache-2.0
#pragma once

// A scene as canonical TOML, and its hashes.

#include <string>
#include <string_view>

#include "scenes/format/scene.h"

namespace nephos {

struct Key;

// The scene with every key, also those at their default, in the order of the reference and with numbers that
// read back exactly: read_scene_text(to_toml(scene)) is the scene again. Equal scenes give equal text. File
// names stand as the Scene holds them. Thread-safe.
std::string to_toml(const Scene& scene);

// XXH3-128 of to_toml(scene), as 32 lower-case hexadecimal digits.
std::string scene_hash(const Scene& scene);

// The same for what decides the bits and the densities alone: automaton and density, not the number of steps,
// the frames or the picture, so that a run that is resumed, extended or drawn in another way has the same
// hash. Of initial_state_file only its presence counts, because the folder may move: give the hash of the
// state that was read from it as `initial_state_hash`.
std::string simulation_hash(const Scene& scene, std::string_view initial_state_hash = {});

// The value of a key as TOML on one line. A path without a value is empty.
std::string value_text(const Key& key, const void* value);

}  // namespace nephos
