// SPDX-License-Identifier: Apache-2.0
#include "study/placed_scene.h"

#include <string>
#include <system_error>

#include "scenes/format/named_files.h"

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

fs::path placed_path(const fs::path& file, const fs::path& folder) {
    const fs::path whole = normal(file), from = normal(folder);
    std::error_code error;
    const bool has_links = fs::weakly_canonical(from, error) != from;
    return has_links || !begin_alike(whole, from) ? whole : whole.lexically_relative(from);
}

Scene placed_scene(Scene scene, const fs::path& folder) {
    for_each_file(
        scene, [&](const std::string&, FileKind, const fs::path& file) { return placed_path(file, folder); });
    return scene;
}

}  // namespace nephos
