// SPDX-License-Identifier: Apache-2.0
#pragma once

// The files that a scene names in its keys (not installed).

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/scene.h"
#include "scenes/format/text.h"

namespace nephos {

class Document;

enum class FileKind {
    first_state,  // at step 0: of no use to a run that goes on from a checkpoint
    simulation,   // of every step: wind, probabilities
    picture,      // heights of the ground, textures
};

// Makes them relative to the folder of the text that names them: `folder` for the scene's own, none for options. Fills in
// Scene::file_places. `document`: that the scene was read from, without problems.
void resolve_files(Scene& scene, const Document& document, const std::filesystem::path& folder);

// Returns whether a text cannot be the name of a file: it is empty, has a byte of 0, at which the system's name would end, or
// is longer than any name that the system takes (PATH_MAX). So no message about a file, which has its whole name, is longer.
inline constexpr std::size_t kMostNameBytes = 4095;
inline bool names_no_file(std::string_view text) {
    return text.empty() || text.size() > kMostNameBytes || text.find('\0') != text.npos;
}

// Throws Error(usage) for the name of a file that no text of a scene can hold, as it is no UTF-8.
void require_scene_name(const std::filesystem::path& file);

// Calls use(key, kind, path) for each file, and takes the path that it returns. Each file of a list has its number:
// "model[0].textures[1]".
template <class Use>
void for_each_file(Scene& scene, const Use& use) {
    const auto one = [&](const std::string& key, FileKind kind, std::optional<std::filesystem::path>& file) {
        if (file) file = use(key, kind, *file);
    };
    const auto many = [&](const std::string& list, FileKind kind, std::vector<std::string>& files) {
        for (std::size_t n = 0; n < files.size(); ++n)
            files[n] =
                std::filesystem::path(use(indexed(list, n), kind, std::filesystem::path(files[n]))).string();
    };
    const std::string state = "lattice.initial_state";
    one(state, FileKind::first_state, scene.initial_state_file);
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        one(indexed("layer", n) + "." + state, FileKind::first_state, scene.layers[n].initial_state_file);
    for (std::size_t n = 0; n < scene.automaton.wind.fields.size(); ++n)
        many(indexed("wind_field", n) + ".files", FileKind::simulation, scene.automaton.wind.fields[n].files);
    for (std::size_t n = 0; n < scene.automaton.field.grids.size(); ++n)
        one(indexed("field.grids", n) + ".file", FileKind::simulation, scene.automaton.field.grids[n].file);
    for (std::size_t n = 0; n < scene.models.size(); ++n)
        many(indexed("model", n) + ".textures", FileKind::picture, scene.models[n].textures);
    one("ground.height_map", FileKind::picture, scene.render.terrain.height_map);
}

}  // namespace nephos
