// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/reader.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "scenes/format/document.h"
#include "scenes/format/named_files.h"
#include "scenes/format/schema.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// Finds the paths of keys with this name in other sections: "density.half".
void find_namesakes(const Section& section, const std::string& path, std::string_view name,
                    std::vector<std::string>& found) {
    for (const Key& key : section.keys) {
        const std::string here = key_path(path, key.name);
        if (key.name == name) found.push_back(enclosed(here, '`'));
        if (key.section != nullptr) find_namesakes(*key.section, here, name, found);
    }
}

std::string advice_on_unknown_key(const Section& section, const std::string& name) {
    for (const Elsewhere& other : section.elsewhere)
        if (other.name == name) return "did you mean " + enclosed(other.meant, '`') + "?";
    std::vector<std::string_view> names;
    for (const Key& key : section.keys) names.push_back(key.name);
    const std::string_view meant = closest_word(name, names);
    if (!meant.empty()) return "did you mean " + enclosed(meant, '`') + "?";
    std::vector<std::string> namesakes;
    find_namesakes(scene_section(), {}, name, namesakes);
    if (namesakes.size() == 1 && namesakes.front() == enclosed(name, '`'))
        return "it is a key of the scene itself, and none of a table in it";
    if (!namesakes.empty() && namesakes.size() <= 3) return "did you mean " + joined(namesakes) + "?";
    std::vector<std::string> quoted;
    for (const std::string_view known : names) quoted.push_back(enclosed(known, '`'));
    return "expected " + joined(quoted);
}

class SceneReader {
  public:
    explicit SceneReader(Document& document) : document_(document) {}

    // Reads a table into its owner and returns whether all is well with it.
    bool read_section(const Section& section, const Node& table, const std::string& path, void* owner) {
        SectionReader reader{document_, table, path, {}};
        for (const Entry& entry : table.entries) {
            const std::size_t before = document_.problems.size();
            if (full()) break;
            if (const Key* key = section.find(entry.name)) {
                read_key(*key, entry, key_path(path, key->name),
                         key->value != nullptr ? key->value(owner) : nullptr);
            } else {
                const std::string in = path.empty() ? "a scene" : enclosed(path, '`');
                document_.report(entry.place,
                                 "unknown key " + enclosed(shortened(entry.name), '`') + " in " + in,
                                 advice_on_unknown_key(section, entry.name));
            }
            if (document_.problems.size() > before) reader.failed.push_back(entry.name);
        }
        check_presence(section, reader);
        const std::size_t before = document_.problems.size();
        const bool whole_scene = path.empty();
        if (section.finish != nullptr && (whole_scene || reader.failed.empty()))
            section.finish(reader, owner);
        return reader.failed.empty() && document_.problems.size() == before;
    }

  private:
    bool full() const { return document_.problems.size() >= kMostProblems; }

    void read_key(const Key& key, const Entry& entry, const std::string& path, void* value) {
        const Node& node = entry.value;
        if (key.kind == KeyKind::table) {
            if (node.kind == Node::Kind::table) {
                read_section(*key.section, node, path, value);
            } else {
                wrong_kind(key, node, path);
            }
        } else if (key.kind == KeyKind::tables) {
            read_tables(key, node, path, value);
        } else {
            read_value(document_, key, node, path, value);
        }
    }

    void read_tables(const Key& key, const Node& node, const std::string& path, void* value) {
        if (node.kind == Node::Kind::table) {
            document_.report(node.place, enclosed(path, '`') + " is one table",
                             "expected an array: write [[" + path + "]]");
            return;
        }
        if (node.kind != Node::Kind::array) {
            wrong_kind(key, node, path);
            return;
        }
        if (int(node.items.size()) < key.min_items || node.items.size() > std::size_t(key.max_items)) {
            document_.report(
                node.place, enclosed(path, '`') + " has " + std::to_string(node.items.size()) + " items",
                "expected " + std::to_string(key.min_items) + " to " + std::to_string(key.max_items));
            return;
        }
        for (std::size_t n = 0; n < node.items.size() && !full(); ++n) {
            const std::string item_path = indexed(path, n);
            void* element = key.append(value);
            if (node.items[n].kind == Node::Kind::table) {
                read_section(*key.section, node.items[n], item_path, element);
            } else {
                document_.report(
                    node.items[n].place,
                    enclosed(item_path, '`') + " is " + std::string(kind_name(node.items[n].kind)),
                    "expected a table");
            }
        }
    }

    void wrong_kind(const Key& key, const Node& node, const std::string& path) {
        document_.report(node.place, enclosed(path, '`') + " is " + std::string(kind_name(node.kind)),
                         "expected " + expected_text(key));
    }

    // Checks required keys, keys that need each other, and keys that exclude each other.
    void check_presence(const Section& section, SectionReader& reader) {
        for (const Key& key : section.keys) {
            const bool present = reader.find(key.name) != nullptr;
            if (key.required && !present && !full()) {
                document_.report(reader.table.place, reader.quoted(key.name) + " is missing",
                                 "expected " + expected_text(key));
                reader.failed.push_back(key.name);
            }
            if (present && !key.replaced_by.empty() && reader.find(key.replaced_by) != nullptr && !full()) {
                reader.report(key.name,
                              reader.quoted(key.name) + " and " + enclosed(key.replaced_by, '`') +
                                  " exclude each other",
                              "expected one of them");
                reader.failed.push_back(key.name);
            }
            for (const std::string& other : key.together_with) {
                if (!present || reader.find(other) != nullptr || full()) continue;
                reader.report(key.name, reader.quoted(key.name) + " stands without " + enclosed(other, '`'),
                              "expected both or none");
                reader.failed.push_back(key.name);
            }
        }
    }

    Document& document_;
};

bool is_array(const Key& key) {
    switch (key.kind) {
        case KeyKind::extent:
        case KeyKind::vector:
        case KeyKind::colour:
        case KeyKind::range:
        case KeyKind::counts:
        case KeyKind::texts:
        case KeyKind::boundaries:
        case KeyKind::tables:
            return true;
        default:
            return false;
    }
}

KeyForm describe(const std::vector<std::string>& path) {
    const Key* key = find_key(path);
    if (key == nullptr) return {};
    return {takes_text(*key), expected_text(*key), is_array(*key)};
}

bool sets_model_files(std::string_view option) {
    constexpr std::string_view kKey = "models";
    return option.starts_with(kKey) && option.size() > kKey.size() &&
           std::string_view("=[ \t").find(option[kKey.size()]) != std::string_view::npos;
}

// Replaces characters that some file system does not allow.
std::string name_from(const std::filesystem::path& file) {
    std::string name = file.stem().string().substr(0, 100);
    for (char& c : name) {
        const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
        if (!letter && !(c >= '0' && c <= '9') && c != '_' && c != '.') c = '-';
    }
    name.erase(0, name.find_first_not_of("-."));
    return name.empty() ? "scene" : name;
}

// A problem of the file as a whole.
[[noreturn]] void throw_problem(const std::string& label, std::string message, std::string expected) {
    Problem problem;
    problem.where.file = label;
    problem.message = std::move(message);
    problem.expected = std::move(expected);
    std::vector<Problem> problems;
    problems.push_back(std::move(problem));
    throw SceneErrors(std::move(problems));
}

// `models`: texts of files that were read before; those that are read now are added.
Scene scene_of_text(std::string_view text, const std::string& label, const std::filesystem::path& folder,
                    std::span<const std::string> overrides, SceneUse use, ModelTexts& models) {
    if (text.size() > kMaxSceneBytes) {
        throw_problem(label, "the file is larger than " + std::to_string(kMaxSceneBytes >> 20) + " MiB",
                      "expected a scene in TOML");
    }
    Document document;
    document.frames_checked = use == SceneUse::everything;
    const int file = document.add_origin(label, std::string(text), true);
    if (std::optional<Node> root = document.parse(file)) {
        if (root->entries.empty() && overrides.empty()) {
            document.report({file, 1, 1}, "the scene is empty",
                            "expected at least one of its keys, such as `name`");
        }
        document.root = std::move(*root);
    }
    const bool readable = document.problems.empty();
    // First what says which files models come from, so that the other options may change those models.
    for (const std::string& option : overrides) {
        if (sets_model_files(option)) document.set(option, &describe);
    }
    if (readable) take_models_from_files(document, folder, models);
    for (const std::string& option : overrides) {
        if (!sets_model_files(option)) document.set(option, &describe);
    }
    if (!readable) throw_problems(std::move(document.problems), label);

    Scene scene;
    SceneReader(document).read_section(scene_section(), document.root, {}, &scene);
    if (!document.problems.empty()) throw_problems(std::move(document.problems), label);
    if (document.root.find("name") == nullptr) scene.name = name_from(label);
    resolve_files(scene, document, folder);
    try {
        check(scene.automaton);  // what this reader overlooked would otherwise pass validation and fail in
                                 // the run
    } catch (const Error& error) {
        const Entry* field = document.root.find("field");
        if (field == nullptr) throw_problem(label, error.what(), {});
        document.report(field->value.place, error.what());
        throw_problems(std::move(document.problems), label);
    }
    scene.given.root = std::make_shared<const Node>(std::move(document.root));
    return scene;
}

}  // namespace

struct SceneSource::Texts {
    std::string scene, label;
    std::filesystem::path folder;
    std::mutex mutex;  // of `models`
    ModelTexts models;
};

SceneSource::SceneSource(const std::filesystem::path& path)
    : SceneSource(read_text_file(path, kMaxSceneBytes), path) {}

SceneSource::SceneSource(std::string text, const std::filesystem::path& path)
    : SceneSource(std::move(text), path.string(), path.parent_path()) {}

SceneSource::SceneSource(std::string text, std::string label, std::filesystem::path folder)
    : texts_(std::make_shared<Texts>()) {
    texts_->scene = std::move(text);
    texts_->label = std::move(label);
    texts_->folder = std::move(folder);
}

Scene SceneSource::read(std::span<const std::string> overrides, SceneUse use) const {
    ModelTexts models;
    {
        const std::scoped_lock lock(texts_->mutex);
        models = texts_->models;
    }
    Scene scene = scene_of_text(texts_->scene, texts_->label, texts_->folder, overrides, use, models);
    const std::scoped_lock lock(texts_->mutex);
    texts_->models.merge(models);
    return scene;
}

Scene read_scene(const std::filesystem::path& path, std::span<const std::string> overrides, SceneUse use) {
    return SceneSource(path).read(overrides, use);
}

Scene read_scene_text(std::string_view text, const std::string& label, const std::filesystem::path& folder,
                      std::span<const std::string> overrides, SceneUse use) {
    ModelTexts models;
    return scene_of_text(text, label, folder, overrides, use, models);
}

}  // namespace nephos
