// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reads a scene file. Every problem of the file and of the options is found in one pass and thrown together.

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "scenes/format/errors.h"
#include "scenes/format/scene.h"

namespace nephos {

// Files larger than this are refused before they are read to the end.
inline constexpr std::size_t kMaxSceneBytes = 8u << 20;

// The scene in `path`, changed by `overrides`: each is "key.path=value" as given to --set, where the path may
// index arrays ("wind[0].levels[1].height_m=800") and the value is TOML; for a key that holds text or a word
// the quotes may be left out. A relative file name in the scene is relative to the scene's folder, one in an
// override to the current folder. Without `name` the scene is called like its file. Throws SceneErrors with
// every problem found, Error(io) when the file cannot be read. Thread-safe.
Scene read_scene(const std::filesystem::path& path, std::span<const std::string> overrides = {});

// The same for TOML text; `label` stands for the file in messages, `folder` is what relative names start
// from.
Scene read_scene_text(std::string_view text, const std::string& label,
                      const std::filesystem::path& folder = {}, std::span<const std::string> overrides = {});

}  // namespace nephos
