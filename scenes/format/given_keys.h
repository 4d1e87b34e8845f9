// SPDX-License-Identifier: Apache-2.0
#pragma once

// The keys that a scene was given, by its text, options and files with base models, apart from those at their defaults. Many
// defaults follow other keys: the box of a scatter the lattice, the field of a layer the common one. In the canonical text
// (writer.h) they are numbers that follow nothing any more; in this one they still do, so it is the one to change later.

#include <cstddef>
#include <string>

#include "scenes/format/scene.h"

namespace nephos {

// Returns the scene as TOML with the given keys alone, base models of other files in place of `models`. Names of files, name,
// seed, number of steps and whether there is a video are those of `scene`, which may have changed since it was read; no other
// change is seen. A scene
// that was not read from a text has to_toml(). Thread-safe.
std::string given_toml(const Scene& scene);

// Returns the abbreviation that a layer was given as its `genus`; "" without. In the canonical text it is heights alone.
// Thread-safe.
std::string given_genus(const Scene& scene, std::size_t layer);

}  // namespace nephos
