// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <iterator>
#include <map>
#include <system_error>

#include "core/descriptor.h"
#include "core/paths.h"
#include "scenes/format/document.h"
#include "scenes/format/named_files.h"
#include "scenes/format/reader.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const char* const kWanted =
    "expected a scene file with [[model]] tables, named relative to the scene's folder";

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
    if (meant.empty()) return kWanted;
    return "did you mean " + enclosed((requested.parent_path() / std::string(meant)).generic_string(), '"') +
           "?";
}

constexpr std::size_t kMostFiles = 1000;
// Limits the bytes of all files together, each counted as often as it is named.
constexpr std::size_t kMostBytes = kMaxSceneBytes;
constexpr std::size_t kMostAdvised = 20;  // looking for similar names takes long in a large folder

// Holds what was read from a file, for each item that names it.
struct ModelFile {
    std::size_t bytes = 0;
    std::vector<Node> models;
    // No problem: there is none, or one with a place in the file, which is reported.
    std::string problem, expected;
};

// The files that `models` names, each read once.
class ModelFiles {
  public:
    ModelFiles(Document& document, const fs::path& folder, ModelTexts& texts)
        : document_(document), folder_(folder), texts_(texts) {}

    // Adds the [[model]] tables of a file; `name` is the item of `models` that names it. Returns false when there are
    // too many files, or they are too large, which is reported as any other problem.
    bool add(const Node& name, const std::string& path_of_item, std::vector<Node>& models) {
        if (names_no_file(name.text)) {
            document_.report(name.place, enclosed(path_of_item, '`') + " names no file");
            return true;
        }
        const bool in_file = document_.origin(name.place.origin).is_file;
        const fs::path path = in_file ? normal_path(folder_ / name.text) : fs::path(name.text);
        auto found = files_.find(path.string());
        if (found == files_.end()) {
            if (files_.size() == kMostFiles) return refuse(name, path_of_item);
            found = files_.emplace(path.string(), read(path, name.text)).first;
        }
        const ModelFile& file = found->second;
        bytes_ += file.bytes;
        if (bytes_ > kMostBytes) return refuse(name, path_of_item);
        if (!file.problem.empty())
            document_.report(name.place, enclosed(path_of_item, '`') + ": " + file.problem, file.expected);
        models.insert(models.end(), file.models.begin(), file.models.end());
        return true;
    }

  private:
    bool refuse(const Node& name, const std::string& path_of_item) {
        document_.report(name.place,
                         enclosed(path_of_item, '`') + ": the files up to this one are too many or too large",
                         "expected at most " + std::to_string(kMostFiles) + " files, of " +
                             std::to_string(kMostBytes >> 20) + " MiB together");
        return false;
    }

    const std::string& text_of(const fs::path& path) {
        // Keyed by the absolute path: a name in an option is relative to the current folder, which may change.
        std::error_code error;
        const fs::path whole = fs::absolute(path, error);
        const std::string key = error ? path.string() : normal_path(whole).string();
        const auto known = texts_.find(key);
        if (known != texts_.end()) return known->second;
        const fs::file_status status = fs::status(path, error);
        if (fs::is_character_file(status) || fs::is_block_file(status)) require_regular_file(path);  // throws
        return texts_[key] = read_text_file(path, kMaxSceneBytes);
    }

    ModelFile read(const fs::path& path, const fs::path& requested) {
        std::string text;
        try {
            text = text_of(path);
        } catch (const Error& error) {
            return {0,
                    {},
                    error.what(),
                    ++missing_ <= kMostAdvised ? advice_on_missing_file(path, requested) : kWanted};
        }
        ModelFile file{text.size(), {}, {}, {}};
        if (text.size() > kMaxSceneBytes) {
            file.problem = path.string() + " is larger than " + std::to_string(kMaxSceneBytes >> 20) + " MiB";
            file.expected = "expected a scene in TOML";
            return file;
        }
        std::optional<Node> root =
            document_.parse(document_.add_origin(path.string(), std::move(text), true));
        if (!root) return file;
        Entry* models = root->find("model");
        if (models == nullptr || models->value.kind != Node::Kind::array) {
            file.problem = path.string() + " has no [[model]]";
            file.expected = "expected a scene file with base models";
            return file;
        }
        file.models = std::move(models->value.items);
        return file;
    }

    Document& document_;
    const fs::path& folder_;
    ModelTexts& texts_;
    std::map<std::string, ModelFile> files_;
    std::size_t bytes_ = 0, missing_ = 0;
};

}  // namespace

void take_models_from_files(Document& document, const fs::path& folder, ModelTexts& texts) {
    const Entry* files = document.root.find("models");
    if (files == nullptr) return;
    std::vector<Node> names{files->value};
    const bool many = files->value.kind == Node::Kind::array;
    if (many) names = files->value.items;
    std::vector<Node> models;
    const std::size_t problems = document.problems.size();
    ModelFiles read(document, folder, texts);
    for (std::size_t n = 0;
         n < names.size() && models.size() <= std::size_t(kMaxModels) && !document.is_full(); ++n) {
        if (names[n].kind != Node::Kind::text) continue;  // reported when the scene is read
        if (!read.add(names[n], many ? indexed("models", n) : "models", models)) break;
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
