// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reads a scene file. One pass finds all problems of the file and of the options and throws them together.

#include <filesystem>
#include <memory>
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

// The text of a scene, and those of the files with base models that it names, each read once: whoever reads the scene more
// often, with other overrides, has the same one, whatever is done to the files meanwhile. Copies share the texts.
// Thread-safe.
class SceneSource {
  public:
    // Reads the file. Throws Error(io).
    explicit SceneSource(const std::filesystem::path& path);
    // Takes what was read of the file `path`.
    SceneSource(std::string text, const std::filesystem::path& path);
    SceneSource(std::string text, std::string label, std::filesystem::path folder);

    // As read_scene() and read_scene_text().
    Scene read(std::span<const std::string> overrides = {}, SceneUse use = SceneUse::everything) const;

  private:
    struct Texts;
    std::shared_ptr<Texts> texts_;
};

}  // namespace nephos
