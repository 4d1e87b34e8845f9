// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iterator>
#include <system_error>

#include "scenes/format/document.h"
#include "scenes/format/reader.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

// Returns "did you mean `genera/Cu.toml`?" when the folder of the missing file has one of a similar name.
std::string advice_on_missing_file(const fs::path& path, const fs::path& requested) {
    std::error_code error;
    std::vector<std::string> names;
    for (fs::directory_iterator at(path.parent_path().empty() ? "." : path.parent_path(), error), end;
         !error && at != end && names.size() < 1000; at.increment(error)) {
        names.push_back(at->path().filename().string());
    }
    std::sort(names.begin(), names.end());
    const std::vector<std::string_view> known(names.begin(), names.end());
    const std::string_view meant = closest_word(path.filename().string(), known);
    if (meant.empty())
        return "expected a scene file with [[model]] tables, named relative to the scene's folder";
    return "did you mean " + enclosed((requested.parent_path() / std::string(meant)).generic_string(), '"') +
           "?";
}

// The [[model]] tables of one file; `name` is the item of `models` that names it.
std::vector<Node> models_in_file(Document& document, const Node& name, const std::string& path_of_item,
                                 const fs::path& folder) {
    const bool in_file = document.origin(name.place.origin).is_file;
    const fs::path path = in_file ? (folder / name.text).lexically_normal() : fs::path(name.text);
    const auto fail = [&](const std::string& what, std::string expected) {
        document.report(name.place, enclosed(path_of_item, '`') + ": " + what, std::move(expected));
        return std::vector<Node>();
    };
    std::string text;
    try {
        text = read_text_file(path, kMaxSceneBytes);
    } catch (const Error& error) {
        return fail(error.what(), advice_on_missing_file(path, name.text));
    }
    if (text.size() > kMaxSceneBytes) {
        return fail(path.string() + " is larger than " + std::to_string(kMaxSceneBytes >> 20) + " MiB",
                    "expected a scene in TOML");
    }
    std::optional<Node> root = document.parse(document.add_origin(path.string(), std::move(text), true));
    if (!root) return {};
    Entry* models = root->find("model");
    if (models == nullptr || models->value.kind != Node::Kind::array) {
        return fail(path.string() + " has no [[model]]", "expected a scene file with base models");
    }
    return std::move(models->value.items);
}

}  // namespace

void take_models_from_files(Document& document, const fs::path& folder) {
    const Entry* files = document.root.find("models");
    if (files == nullptr) return;
    std::vector<Node> names{files->value};
    const bool many = files->value.kind == Node::Kind::array;
    if (many) names = files->value.items;
    std::vector<Node> models;
    const std::size_t problems = document.problems.size();
    for (std::size_t n = 0; n < names.size() && models.size() <= std::size_t(kMaxModels); ++n) {
        if (names[n].kind != Node::Kind::text) continue;  // reported when the scene is read
        std::vector<Node> more =
            models_in_file(document, names[n], many ? indexed("models", n) : "models", folder);
        std::move(more.begin(), more.end(), std::back_inserter(models));
    }
    document.models_missing = document.problems.size() > problems;
    if (models.empty()) return;
    Entry* own = document.root.find("model");
    if (own == nullptr) {
        Entry entry{"model", models.front().place, {}};
        entry.value.kind = Node::Kind::array;
        entry.value.place = models.front().place;
        document.root.entries.push_back(std::move(entry));
        own = &document.root.entries.back();
    }
    if (own->value.kind != Node::Kind::array) return;  // reported when the scene is read
    own->value.items.insert(own->value.items.begin(), std::make_move_iterator(models.begin()),
                            std::make_move_iterator(models.end()));
}

}  // namespace nephos
