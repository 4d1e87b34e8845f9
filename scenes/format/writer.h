// SPDX-License-Identifier: Apache-2.0
#pragma once

// Writes a scene as canonical TOML, and hashes it.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "scenes/format/scene.h"

namespace nephos {

struct Key;

// Returns the scene with every key, defaults included, in the order of the reference and with numbers that
// read back exactly: read_scene_text(to_toml(scene)) equals scene. Equal scenes give equal text. File names
// are those of the Scene. Thread-safe.
std::string to_toml(const Scene& scene);

// Returns the XXH3-128 of to_toml(scene), as 32 lower-case hexadecimal digits.
std::string scene_hash(const Scene& scene);

// Returns the scene_hash() of the scene without its number of steps: files of frames carry it, so that those of a run that
// was resumed into more steps are the same as those of a run that had them from the start.
std::string frames_hash(const Scene& scene);

// Returns the hash of the options that determine the bits and the densities: automaton and density, not the
// number of steps, the frames or the rendering, so that a resumed, extended or differently rendered run has
// the same hash. Of initial_state_file only its presence counts, because the folder may move; pass the hash
// of the state in it as `initial_state_hash`.
std::string simulation_hash(const Scene& scene, std::string_view initial_state_hash = {});

// Returns every key of the scene, those at their defaults too, as pairs of path and TOML text in the order of
// the reference: ("field.background.ext", "0.12"), ("field.scatters[0].count", "40"). With them a scene is
// complete. Thread-safe.
std::vector<std::pair<std::string, std::string>> parameters(const Scene& scene);

// Returns the value of a key as TOML on one line. A path without a value is empty.
std::string value_text(const Key& key, const void* value);

}  // namespace nephos
