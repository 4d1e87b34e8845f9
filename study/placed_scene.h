// SPDX-License-Identifier: Apache-2.0
#pragma once

// Scenes that are written into a folder of a study, from where the files that they name are found.

#include <filesystem>

#include "scenes/format/scene.h"

namespace nephos {

// Returns the scene with the names of its files as a text in `folder` has them: relative to the folder, so that both may
// move together; absolute where the two have no folder in common but the root. Neither the current folder, nor the way in
// which the scene named them, nor links on the way to the folder change the result. Throws Error(usage) where a name is no UTF-8.
Scene placed_scene(Scene scene, const std::filesystem::path& folder);

// The same for one file.
std::filesystem::path placed_path(const std::filesystem::path& file, const std::filesystem::path& folder);

}  // namespace nephos
