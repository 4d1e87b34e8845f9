// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_inputs.h"

#include <algorithm>
#include <map>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "core/paths.h"
#include "scenes/format/text.h"
#include "simulation/scene_files.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kNamed = 3;

// Returns the absolute path, with the links of what is there of it resolved where that can be.
fs::path resolved(const fs::path& path) {
    std::error_code error;
    const fs::path whole = fs::absolute(path, error);
    fs::path found = fs::weakly_canonical(whole, error);
    return error ? whole : found;
}

// Returns the key as the places of a scene's files have it: a list may be one text.
std::string placed_key(const Scene& scene, const std::string& key) {
    const std::size_t bracket = key.rfind('[');
    if (scene.file_places.of_key.contains(key) || bracket == key.npos || !key.ends_with(']')) return key;
    const std::string list = key.substr(0, bracket);
    return scene.file_places.of_key.contains(list) ? list : key;
}

}  // namespace

fs::path path_from(const fs::path& folder, const fs::path& file) {
    if (file.is_absolute()) return file;
    // A file that is a link keeps its own name, which is that of the scene.
    return (resolved(file.has_parent_path() ? file.parent_path() : ".") / file.filename())
        .lexically_relative(resolved(folder));
}

fs::path path_of(const fs::path& folder, const fs::path& named) {
    return named.is_absolute() ? named : normal_path(resolved(folder) / named);
}

std::vector<RunInput> inputs_of(const Scene& scene, const fs::path& folder, const InputUse& use) {
    std::vector<RunInput> inputs;
    std::map<fs::path, FileDigest> digests;
    Scene named = scene;
    for_each_file(named, [&](const std::string& key, FileKind kind, const fs::path& file) {
        if ((kind == FileKind::first_state && !use.first_states) ||
            (kind == FileKind::picture && !use.pictures))
            return file;
        const auto [found, added] = digests.try_emplace(file);
        if (added)
            found->second = read_at_key(scene, placed_key(scene, key), [&] { return file_digest(file); });
        inputs.push_back({key, path_from(folder, file), found->second, kind});
        return file;
    });
    return inputs;
}

std::vector<RunInput> inputs_of(const RunSettings& settings) {
    return inputs_of(settings.scene, settings.folder, {.first_states = !settings.branch, .pictures = settings.render});
}

std::string changed_inputs(const std::vector<RunInput>& before, const std::vector<RunInput>& now,
                           const std::vector<FileKind>& kinds) {
    std::map<std::string, FileDigest> then;
    for (const RunInput& input : before) then[input.key] = input.digest;
    std::vector<std::string> names;
    for (const RunInput& input : now) {
        const auto found = then.find(input.key);
        if (found == then.end() || found->second == input.digest || std::ranges::count(kinds, input.kind) == 0) continue;
        names.push_back(fmt::format("{} of `{}`", input.path.filename().string(), input.key));
    }
    const std::size_t more = names.size() > kNamed ? names.size() - kNamed : 0;
    names.resize(names.size() - more);
    return fmt::format("{}{}", fmt::join(names, ", "), more > 0 ? fmt::format(" and {} more", more) : "");
}

void locate_inputs(Scene& scene, const fs::path& folder, const std::vector<RunInput>& inputs) {
    std::map<std::string, fs::path> places;
    for (const RunInput& input : inputs) places[input.key] = path_of(folder, input.path);
    for_each_file(scene, [&](const std::string& key, FileKind, const fs::path& file) {
        const auto place = places.find(key);
        std::error_code missing;
        if (place == places.end() || !fs::exists(place->second, missing) || fs::equivalent(place->second, file, missing))
            return file;
        const fs::path near = place->second.lexically_relative(resolved("."));
        return near.empty() || file.is_absolute() ? place->second : near;
    });
}

}  // namespace nephos
