// SPDX-License-Identifier: Apache-2.0
#include "apps/python/scene_text.h"

#include <utility>

#include "core/error.h"
#include "scenes/format/reader.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"

namespace nephos {

SceneText SceneText::from_file(const std::filesystem::path& path) {
    SceneText scene;
    try {
        scene.text_ = read_text_file(path, kMaxSceneBytes);
    } catch (const Error& error) {
        throw Error(error.code(), error.what(), {path.string(), 0, 0});
    }
    scene.label_ = path.string();
    scene.folder_ = std::filesystem::absolute(path).parent_path();  // whatever the working folder is later
    scene.read();
    return scene;
}

SceneText SceneText::from_text(std::string text, const std::filesystem::path& folder) {
    SceneText scene;
    scene.text_ = std::move(text);
    scene.label_ = "scene";
    // Without a working folder it stays as it is: only scenes that name files need it.
    std::error_code error;
    scene.folder_ = std::filesystem::absolute(folder.empty() ? "." : folder, error);
    if (error) scene.folder_ = folder;
    scene.read();
    return scene;
}

SceneText SceneText::with(const std::string& setting) const {
    SceneText changed = *this;
    changed.settings_.push_back(setting);
    changed.read();
    return changed;
}

std::string SceneText::canonical() const { return to_toml(scene_); }

// Frames are not made of it: they need not fit into the simulated time.
void SceneText::read() {
    scene_ = read_scene_text(text_, label_, folder_, settings_, SceneUse::without_frames);
}

}  // namespace nephos
