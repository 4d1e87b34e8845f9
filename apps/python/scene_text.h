// SPDX-License-Identifier: Apache-2.0
#pragma once

// A scene as Python has it: its text and what was set after, so that errors name places in the text.

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "scenes/format/reader.h"
#include "scenes/format/scene.h"

namespace nephos {

// An immutable value.
class SceneText {
  public:
    // Reads a file. Throws as read_scene().
    static SceneText from_file(const std::filesystem::path& path);
    // Takes TOML text; relative file names in it are relative to `folder`. Throws as read_scene_text().
    static SceneText from_text(std::string text, const std::filesystem::path& folder);

    // Returns a copy with one more key set, "key.path=value" as of --set. Throws SceneErrors.
    SceneText with(const std::string& setting) const;

    const Scene& scene() const { return scene_; }
    // Returns every key, defaults included, as canonical TOML.
    std::string canonical() const;
    // Returns the given keys alone (scenes/format/given_keys.h), for a file in any folder.
    std::string given() const;

  private:
    void read();

    explicit SceneText(SceneSource source) : source_(std::move(source)) {}

    SceneSource source_;
    std::vector<std::string> settings_;
    Scene scene_;
};

}  // namespace nephos
