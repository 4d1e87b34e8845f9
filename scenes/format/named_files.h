// SPDX-License-Identifier: Apache-2.0
#pragma once

// The files that a scene names in its keys (not installed).

#include <filesystem>

#include "scenes/format/document.h"
#include "scenes/format/scene.h"

namespace nephos {

// Makes them relative to the folder of the text that names them: `folder` for the scene's own, none for options. Fills in
// Scene::file_places. `document`: that the scene was read from, without problems.
void resolve_files(Scene& scene, const Document& document, const std::filesystem::path& folder);

}  // namespace nephos
