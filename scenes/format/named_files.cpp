// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/named_files.h"

#include <string>
#include <vector>

#include "core/error.h"
#include "core/paths.h"
#include "scenes/format/document.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

class Resolver {
  public:
    Resolver(Scene& scene, const Document& document, const fs::path& folder)
        : scene_(scene), document_(document), folder_(folder) {}

    // `expected`: the kind of file, for messages.
    void resolve(const Node* node, const std::string& key, std::optional<fs::path>& file, const std::string& expected) {
        if (node == nullptr || !file) return;
        note(*node, key, expected);
        file = resolved(*node, *file);
    }

    // A text, or an array of them.
    void resolve(const Node* node, const std::string& key, std::vector<std::string>& files, const std::string& expected) {
        if (node == nullptr) return;
        const bool many = node->kind == Node::Kind::array;
        for (std::size_t n = 0; n < files.size(); ++n) {
            const Node& one = many ? node->items[n] : *node;
            note(one, many ? indexed(key, n) : key, expected);
            files[n] = resolved(one, files[n]).string();
        }
    }

  private:
    void note(const Node& node, const std::string& key, const std::string& expected) {
        scene_.file_places.of_key[key] =
            document_.problem_at(node.place, {}, "expected a file that can be read: " + expected);
    }

    // What a base model from another file names is relative to that file.
    fs::path resolved(const Node& node, const fs::path& file) const {
        const Origin& origin = document_.origin(node.place.origin);
        if (!origin.is_file) return file;
        const fs::path from = node.place.origin == 0 ? folder_ : fs::path(origin.label).parent_path();
        return normal_path(from / file);
    }

    Scene& scene_;
    const Document& document_;
    fs::path folder_;
};

const Node* find(const Node* table, std::string_view name) {
    const Entry* entry = table != nullptr ? table->find(name) : nullptr;
    return entry != nullptr ? &entry->value : nullptr;
}

// An element of an array of tables.
const Node* item(const Node* array, std::size_t n) { return array != nullptr ? &array->items[n] : nullptr; }

}  // namespace

void require_scene_name(const fs::path& file) {
    const std::string text = file.string();
    if (find_invalid_utf8(text) == text.size()) return;
    throw Error(ErrorCode::usage,
                text +
                    ": its name is no UTF-8, which the text of a scene has to be: give the file, and the "
                    "folders that it is in, other names");
}

void resolve_files(Scene& scene, const Document& document, const fs::path& folder) {
    Resolver resolver(scene, document, folder);
    const Node* root = &document.root;
    scene.file_places.scene_file = document.origin(0).label;
    const std::string state = "VDB with the cells of a state", state_key = "lattice.initial_state";
    resolver.resolve(find(find(root, "lattice"), "initial_state"), state_key, scene.initial_state_file, state);
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        resolver.resolve(find(find(item(find(root, "layer"), n), "lattice"), "initial_state"),
                         indexed("layer", n) + "." + state_key, scene.layers[n].initial_state_file, state);
    for (std::size_t n = 0; n < scene.automaton.wind.fields.size(); ++n)
        resolver.resolve(find(item(find(root, "wind_field"), n), "files"), indexed("wind_field", n) + ".files",
                         scene.automaton.wind.fields[n].files, "VDB with a vec3s grid");
    for (std::size_t n = 0; n < scene.automaton.field.grids.size(); ++n)
        resolver.resolve(find(item(find(find(root, "field"), "grids"), n), "file"), indexed("field.grids", n) + ".file",
                         scene.automaton.field.grids[n].file, "VDB with a float grid");
    for (std::size_t n = 0; n < scene.models.size(); ++n)
        resolver.resolve(find(item(find(root, "model"), n), "textures"), indexed("model", n) + ".textures",
                         scene.models[n].textures, "PNG with transparency");
    resolver.resolve(find(find(root, "ground"), "height_map"), "ground.height_map", scene.render.terrain.height_map,
                     "PNG of 16 bits, EXR, or raw heights");
}

}  // namespace nephos
