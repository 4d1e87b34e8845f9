// SPDX-License-Identifier: Apache-2.0
#include "study/placed_scene.h"

#include <string>
#include <system_error>

#include "core/paths.h"
#include "scenes/format/named_files.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

// Returns the absolute path with its links resolved, of what is there of it.
fs::path resolved(const fs::path& path) {
    const fs::path whole = normal_path(fs::absolute(path));
    std::error_code error;
    const fs::path found = fs::weakly_canonical(whole.has_filename() ? whole : whole.parent_path(), error);
    return error ? whole : found;
}

// Returns whether two absolute paths have the same first folder below the root.
bool begin_alike(const fs::path& a, const fs::path& b) {
    const fs::path first = a.relative_path(), second = b.relative_path();
    return first.begin() != first.end() && second.begin() != second.end() && *first.begin() == *second.begin();
}

}  // namespace

fs::path placed_path(const fs::path& file, const fs::path& folder) {
    const fs::path named = normal_path(fs::absolute(file));
    // A file that is a link keeps its own name.
    const fs::path whole = resolved(named.parent_path()) / named.filename(), from = resolved(folder);
    const fs::path placed = begin_alike(whole, from) ? whole.lexically_relative(from) : whole;
    require_scene_name(placed);
    return placed;
}

Scene placed_scene(Scene scene, const fs::path& folder) {
    for_each_file(
        scene, [&](const std::string&, FileKind, const fs::path& file) { return placed_path(file, folder); });
    return scene;
}

}  // namespace nephos
