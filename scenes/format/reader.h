// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reads a scene file. One pass finds all problems of the file and of the options and throws them together.

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "scenes/format/errors.h"
#include "scenes/format/scene.h"

namespace nephos {

// Largest size of a scene file; larger ones are refused without reading them to the end.
inline constexpr std::size_t kMaxSceneBytes = 8u << 20;

// Selects the checks of a scene: frames that are not to be written need not fit into the simulated time.
enum class SceneUse { everything, without_frames };

// Reads the scene in `path` and applies `overrides`, each "key.path=value" as of --set: the path may index
// arrays ("wind[0].levels[1].height_m=800"), the value is TOML, and text and words may lack their quotes. A
// relative file name in the scene is relative to the scene's folder, one in an override to the current
// folder. A scene without `name` is named after its file. Throws SceneErrors with every problem found,
// Error(io) when the file cannot be read. Thread-safe.
Scene read_scene(const std::filesystem::path& path, std::span<const std::string> overrides = {},
                 SceneUse use = SceneUse::everything);

// Reads a scene from TOML text; `label` names it in messages, relative file names are relative to `folder`.
// Errors as above.
Scene read_scene_text(std::string_view text, const std::string& label,
                      const std::filesystem::path& folder = {}, std::span<const std::string> overrides = {},
                      SceneUse use = SceneUse::everything);

}  // namespace nephos
