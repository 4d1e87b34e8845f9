// SPDX-License-Identifier: Apache-2.0
#include "apps/python/scene_text.h"

#include <system_error>
#include <utility>

#include "core/error.h"
#include "scenes/format/given_keys.h"
#include "scenes/format/named_files.h"
#include "scenes/format/reader.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"

namespace nephos {

SceneText SceneText::from_file(const std::filesystem::path& path) {
    std::string text;
    try {
        text = read_text_file(path, kMaxSceneBytes);
    } catch (const Error& error) {
        throw Error(error.code(), error.what(), {path.string(), 0, 0});
    }
    // Whatever the working folder is later.
    SceneText scene({std::move(text), path.string(), std::filesystem::absolute(path).parent_path()});
    scene.read();
    return scene;
}

SceneText SceneText::from_text(std::string text, const std::filesystem::path& folder) {
    // Without a working folder it stays as it is: only scenes that name files need it.
    std::error_code error;
    std::filesystem::path from = std::filesystem::absolute(folder.empty() ? "." : folder, error);
    SceneText scene({std::move(text), "scene", error ? folder : std::move(from)});
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

std::string SceneText::given() const {
    Scene scene = scene_;
    for_each_file(scene, [](const std::string&, FileKind, const std::filesystem::path& file) {
        std::error_code error;
        std::filesystem::path whole = std::filesystem::absolute(file, error);
        return error ? file : whole;
    });
    return given_toml(scene);
}

// Frames are not made of it: they need not fit into the simulated time.
void SceneText::read() { scene_ = source_.read(settings_, SceneUse::without_frames); }

}  // namespace nephos
