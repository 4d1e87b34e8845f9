// SPDX-License-Identifier: Apache-2.0
#include "study/placed_scene.h"

#include <optional>
#include <string>
#include <system_error>

namespace nephos {
namespace {

namespace fs = std::filesystem;

// Returns the absolute path without "." and ".." and without a slash at its end.
fs::path normal(const fs::path& path) {
    const fs::path whole = fs::absolute(path).lexically_normal();
    return whole.has_filename() ? whole : whole.parent_path();
}

// Returns whether two absolute paths have the same first folder below the root.
bool begin_alike(const fs::path& a, const fs::path& b) {
    const fs::path first = a.relative_path(), second = b.relative_path();
    return first.begin() != first.end() && second.begin() != second.end() && *first.begin() == *second.begin();
}

}  // namespace

Scene placed_scene(Scene scene, const fs::path& folder) {
    const fs::path from = normal(folder);
    std::error_code error;
    const bool has_links = fs::weakly_canonical(from, error) != from;
    const auto placed = [&](const fs::path& file) {
        const fs::path whole = normal(file);
        return has_links || !begin_alike(whole, from) ? whole : whole.lexically_relative(from);
    };
    const auto place = [&](std::optional<fs::path>& file) {
        if (file) file = placed(*file);
    };
    place(scene.initial_state_file);
    place(scene.render.terrain.height_map);
    for (LayerOptions& layer : scene.layers) place(layer.initial_state_file);
    for (ProbabilityGrid& grid : scene.automaton.field.grids) place(grid.file);
    for (WindField& field : scene.automaton.wind.fields)
        for (std::string& file : field.files) file = placed(file).generic_string();
    for (BaseModel& model : scene.models)
        for (std::string& file : model.textures) file = placed(file).generic_string();
    return scene;
}

}  // namespace nephos
