// SPDX-License-Identifier: Apache-2.0
#include "study/axis_files.h"

#include <string_view>
#include <system_error>
#include <utility>

#include "study/sweep_plan.h"
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/digest.h"
#include "core/error.h"
#include "core/paths.h"
#include "scenes/format/named_files.h"
#include "scenes/format/text.h"
#include "simulation/scene_files.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

// Returns whether a key is an item of a list: "a.b[0]" of "a.b".
bool is_item(std::string_view key, std::string_view list) {
    return key.starts_with(list) && key.size() > list.size() && key[list.size()] == '[' &&
           key.find_first_not_of("0123456789", list.size() + 1) == key.size() - 1;
}

// Returns whether a key is in the table or array of another one: "a.b[0].c" in "a".
bool is_within(std::string_view key, std::string_view outer) {
    return key.starts_with(outer) && key.size() > outer.size() && (key[outer.size()] == '.' || key[outer.size()] == '[');
}

fs::path absolute(const fs::path& folder, const fs::path& file) {
    std::error_code error;
    const fs::path whole = fs::absolute(folder / file, error);
    if (error) throw Error(ErrorCode::io, file.string() + ": there is no current folder: " + error.message());
    return normal_path(whole);
}

}  // namespace

std::optional<AxisFiles> axis_files(const Axis& axis, const std::string& value, const Scene& scene) {
    AxisFiles files;
    Digest digest;
    std::string_view of;  // the key that has them; those that are moved with it have the same
    Scene named = scene;
    for_each_file(named, [&](const std::string& key, FileKind, const fs::path& file) {
        for (const std::string& outer : axis.keys) {
            const bool is_itself = key == outer || is_item(key, outer);
            if (!is_itself && !is_within(key, outer)) continue;
            if (!is_itself)
                throw Error(ErrorCode::usage,
                            fmt::format("axis {}: value {} names the file {}: expected `{}` itself as an axis",
                                        fmt::join(axis.keys, "+"), value, file.string(), key));
            if (of.empty()) of = outer;
            if (of != outer) continue;
            const fs::path whole = absolute(axis.folder, file);
            files.stamps.emplace(whole, file_stamp(whole));
            digest.add(read_at_key(scene, key, [&] { return file_digest(whole); }).xxh3);
            files.paths.push_back(whole);
        }
        return file;
    });
    if (files.paths.empty()) return {};
    files.is_list = value.starts_with('[');
    files.digest = digest.hex();
    return files;
}

std::string axis_value(const AxisFiles& files, const std::vector<fs::path>& names) {
    if (!files.is_list) return toml_string(names.front().string());
    std::vector<std::string> texts;
    for (const fs::path& name : names) texts.push_back(toml_string(name.string()));
    return "[" + fmt::format("{}", fmt::join(texts, ", ")) + "]";
}

}  // namespace nephos
