// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/schema_values.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <limits>
#include <utility>

#include "core/error.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

// Ends of names that repeat the unit, the longest first.
constexpr std::array<std::string_view, 15> kUnitEnds{"_mm_per_h_per_m",
                                                     "_mm_per_h",
                                                     "_m_per_s",
                                                     "_per_m",
                                                     "_cells",
                                                     "_pixels",
                                                     "_mm",
                                                     "_deg",
                                                     "_m2",
                                                     "_um",
                                                     "_km",
                                                     "_ev",
                                                     "_hpa",
                                                     "_m",
                                                     "_s"};

std::string default_of_kind(const Key& key, const Vec3& centre_m) {
    switch (key.kind) {
        case KeyKind::vector: {
            std::string out = "[";
            for (const double part : {centre_m.x, centre_m.y, centre_m.z}) {
                if (out.size() > 1) out += ", ";
                out += number_text(part, 6);
            }
            return out + "]";
        }
        case KeyKind::integer:
        case KeyKind::count:
            return std::to_string(std::max(1LL, static_cast<long long>(std::max(key.limits.min, 0.0))));
        case KeyKind::number:
            return key.limits.min > 0 || key.limits.above_min ? number_text(key.limits.min + 1, 6) : "0";
        default:
            return {};
    }
}

}  // namespace

std::string readable_name(std::string_view name) {
    for (const std::string_view end : kUnitEnds) {
        if (name.size() > end.size() && name.ends_with(end)) {
            name.remove_suffix(end.size());
            break;
        }
    }
    std::string out(name);
    std::ranges::replace(out, '_', ' ');
    if (!out.empty()) out[0] = char(std::toupper(static_cast<unsigned char>(out[0])));
    return out;
}

// Returns true for a key that has to rise from one key frame, level or presence of a veil to the next.
bool rises_from_item_to_item(const Key& tables, const Key& key) {
    return (key.name == "time_s" && tables.name != "lightning") ||
           (key.name == "height_m" && tables.name == "levels") ||
           (key.name == "state" && tables.name == "presence");
}

std::string readable_name(const Key& key) {
    // In the file they are short; beside a slider they need not be.
    static constexpr std::array<std::pair<std::string_view, std::string_view>, 10> kLong{{
        {"hum", "Humidity (hum)"},
        {"act", "Activation (act)"},
        {"ext", "Extinction (ext)"},
        {"i0", "Half width x (i0)"},
        {"j0", "Half width y (j0)"},
        {"k0", "Half width z (k0)"},
        {"t0", "Half width in steps (t0)"},
        {"model", "Model"},
        {"exposure_ev", "Exposure offset"},
        {"vertical_fov_deg", "Field of view"},
    }};
    for (const auto& [name, text] : kLong) {
        if (key.name == name) return std::string(text);
    }
    return readable_name(std::string_view(key.name));
}

std::string unit_sign(std::string_view unit) {
    if (unit == "deg") return "°";
    return std::string(unit);
}

std::string list_name(const Key& key) {
    if (key.name == "model") return "Base models";
    if (key.name == "sky") return "Skies";
    if (key.name == "layer") return "Layers";
    if (key.name == "wind") return "Wind over time";
    if (key.name == "levels") return "Levels";
    if (key.name == "path") return "Path";
    return readable_name(key);
}

std::string element_name(std::string_view key) {
    std::string name = readable_name(key);
    if (name == "Skies") return "Sky";
    if (name.size() > 3 && name.ends_with('s') && !name.ends_with("ss")) name.pop_back();
    return name;
}

const Node* value_node(const Node& values, const TextPath& path) {
    const Node* node = &values;
    for (const TextStep& step : path) {
        if (step.name.empty()) {
            if (step.index >= node->items.size()) return nullptr;
            node = &node->items[step.index];
        } else {
            const Entry* entry = node->find(step.name);
            if (entry == nullptr) return nullptr;
            node = &entry->value;
        }
    }
    return node;
}

const Key* key_at(const TextPath& path) {
    std::vector<std::string> names;
    for (const TextStep& step : path) {
        if (!step.name.empty()) names.push_back(step.name);
    }
    return names.empty() ? nullptr : find_key(names);
}

const Section* section_at(const TextPath& path) {
    if (path.empty()) return &scene_section();
    const Key* key = key_at(path);
    return key != nullptr ? key->section : nullptr;
}

const void* owner_at(const Scene& scene, const TextPath& path, std::size_t models_from_files) {
    const Section* section = &scene_section();
    const void* owner = &scene;
    const Key* list = nullptr;
    for (const TextStep& step : path) {
        if (!step.name.empty()) {
            const Key* key = section != nullptr ? section->find(step.name) : nullptr;
            if (key == nullptr || key->section == nullptr || key->value == nullptr) return nullptr;
            owner = key->value(const_cast<void*>(owner));
            section = key->section;
            list = key->kind == KeyKind::tables ? key : nullptr;
        } else {
            if (list == nullptr) return nullptr;
            const std::size_t index = step.index + (list->name == "model" ? models_from_files : 0);
            owner = index < list->size(owner) ? list->element(owner, index) : list->element_defaults;
            list = nullptr;
        }
    }
    return list == nullptr ? owner : nullptr;
}

std::string default_value(const Key& key, const void* owner) {
    if (owner == nullptr || key.value == nullptr) return {};
    if (key.kind == KeyKind::table || key.kind == KeyKind::tables) return {};
    return value_text(key, key.value(const_cast<void*>(owner)));
}

Node parsed_value(const std::string& toml) {
    Document document;
    const int origin = document.add_origin("value", "v = " + toml, true);
    std::optional<Node> parsed = document.parse(origin);
    if (!parsed || parsed->entries.empty()) return {};
    return std::move(parsed->entries.front().value);
}

double number_in(const Node& table, std::string_view key) {
    const Entry* entry = table.find(key);
    if (entry == nullptr) return 0;
    return entry->value.kind == Node::Kind::integer ? double(entry->value.integer) : entry->value.number;
}

std::vector<std::string> names_of(const Node* array) {
    std::vector<std::string> names;
    if (array == nullptr) return names;
    for (const Node& item : array->items) {
        const Entry* name = item.find("name");
        if (name != nullptr && name->value.kind == Node::Kind::text) names.push_back(name->value.text);
    }
    return names;
}

std::vector<std::string> taken_names(const Node& values, const TextPath& array, const Scene* scene) {
    std::vector<std::string> names = names_of(value_node(values, array));
    if (scene == nullptr || array != text_path("model")) return names;
    for (const BaseModel& model : scene->models)
        if (std::ranges::find(names, model.name) == names.end()) names.push_back(model.name);
    return names;
}

std::string unused_name(std::string_view start, const std::vector<std::string>& taken) {
    for (std::size_t number = taken.size() + 1;; ++number) {
        std::string name = std::string(start) + "-" + std::to_string(number);
        if (std::ranges::find(taken, name) == taken.end()) return name;
    }
}

namespace {

// Returns how far a new element stands behind the last one.
double step_of(const Key& key) {
    if (key.name == "state") return 0.25;
    return key.name == "height_m" ? 500 : 600;
}

// Returns the text of a value in nine digits, or in all that it takes to stay between two others.
std::string readable_between(double low, double value, double high) {
    const std::string text = number_text(value, 9);
    double rounded = value;
    std::from_chars(text.data(), text.data() + text.size(), rounded);
    return low < rounded && rounded < high ? text : number_text(value);
}

}  // namespace

std::optional<TextEntry> place_of_copy(const Key& tables, const Node& array, std::size_t index) {
    for (const Key& key : tables.section->keys) {
        if (!rises_from_item_to_item(tables, key)) continue;
        const double here = number_in(array.items.at(index), key.name);
        const double next = index + 1 < array.items.size()
                                ? number_in(array.items[index + 1], key.name)
                                : std::min(here + 2 * step_of(key), key.limits.max);
        const double middle = here + 0.5 * (next - here);
        if (!(here < middle && middle < next))
            throw Error(ErrorCode::usage,
                        "Not copied: no " + std::string(key.name) + " is left behind " + number_text(here));
        return TextEntry{key.name, readable_between(here, middle, next)};
    }
    return std::nullopt;
}

std::vector<TextEntry> new_element(const Key& tables, const Node& values, const TextPath& path,
                                   const Scene* scene, const Vec3& centre_m) {
    std::vector<TextEntry> entries;
    const Node* array = value_node(values, path);
    for (const Key& key : tables.section->keys) {
        const bool layer_skies = tables.name == "layer" && key.name == "skies";
        const bool sky_models = tables.name == "sky" && (key.name == "models" || key.name == "clouds");
        const bool base = tables.name == "layer" && key.name == "base_height_m";
        // No two skies have one state; the points of a schedule may.
        const bool rises = key.kind == KeyKind::number && array != nullptr &&
                           (rises_from_item_to_item(tables, key) || key.name == "state");
        const bool next = rises && !array->items.empty();  // it may not be the value of the item before
        if (!key.required && !layer_skies && !sky_models && !base && !next) continue;
        std::string value;
        if (key.name == "name") {
            std::string start = element_name(tables.name);
            start[0] = char(std::tolower(static_cast<unsigned char>(start[0])));
            value = toml_string(unused_name(start, taken_names(values, path, scene)));
        } else if (layer_skies && scene != nullptr && !scene->skies.empty()) {
            value = "[" + toml_string(scene->skies.front().name) + "]";
        } else if (sky_models && key.name == "models" && scene != nullptr && !scene->models.empty()) {
            value = "[" + toml_string(scene->models.front().name) + "]";
        } else if (sky_models && key.name == "models") {
            const std::vector<std::string> names = names_of(value_node(values, text_path("model")));
            if (!names.empty()) value = "[" + toml_string(names.front()) + "]";
        } else if (sky_models && key.name == "clouds") {
            value = "20";
        } else if (layer_skies) {
            const std::vector<std::string> names = names_of(value_node(values, text_path("sky")));
            if (!names.empty()) value = "[" + toml_string(names.front()) + "]";
        } else if (base) {
            value = number_text(centre_m.z, 6);
        } else if (key.kind == KeyKind::tables) {
            value = "[{ ";
            for (const auto& [name, inner] : new_element(key, values, path, scene, centre_m)) {
                if (value.size() > 3) value += ", ";
                value += name + " = " + inner;
            }
            value += value.size() > 3 ? " }]" : "}]";
        } else if (rises) {
            double last = 0;
            for (const Node& item : array->items) last = std::max(last, number_in(item, key.name));
            const double place = array->items.empty() ? 0 : std::min(last + step_of(key), key.limits.max);
            value = readable_between(last, place, std::numeric_limits<double>::infinity());
        } else if (key.name == "position_m" && tables.section->find("target_m") != nullptr) {
            value = default_of_kind(key, {centre_m.x, centre_m.y - 4000, std::max(2.0, centre_m.z - 500)});
        } else {
            value = default_of_kind(key, centre_m);
        }
        if (!value.empty()) entries.emplace_back(key.name, value);
    }
    if (tables.name == "levels" &&
        tables.section->find("from_deg") != nullptr) {  // a wind, in one of its two forms
        entries.emplace_back("from_deg", "270");
        entries.emplace_back("speed_m_per_s", "5");
    }
    return entries;
}

namespace {

// Adds the paths of texts that are `name` at places such as "sky.*.models", where "*" stands for all elements of an
// array; of an array of texts at the end, those of its elements.
void add_users(const Node& node, std::string_view places, const std::string& name, const TextPath& path,
               std::vector<TextPath>& users) {
    const auto below = [&path](TextStep step) {
        TextPath longer = path;
        longer.push_back(std::move(step));
        return longer;
    };
    if (places.empty() && node.kind == Node::Kind::text && node.text == name) users.push_back(path);
    if (places.empty() || places.front() == '*') {
        const std::string_view rest =
            places.empty() ? places : places.substr(std::min<std::size_t>(2, places.size()));
        for (std::size_t n = 0; n < node.items.size(); ++n)
            add_users(node.items[n], rest, name, below({{}, n}), users);
        return;
    }
    const std::size_t end = std::min(places.find('.'), places.size());
    const std::string key(places.substr(0, end));
    const Entry* entry = node.find(key);
    if (entry != nullptr)
        add_users(entry->value, places.substr(std::min(end + 1, places.size())), name, below({key, 0}),
                  users);
}

}  // namespace

std::string with_new_name(std::string text, const Node& values, const TextPath& path, const std::string& name,
                          const std::vector<std::string>& elsewhere) {
    const Node* old = value_node(values, path);
    const std::string was = old != nullptr ? old->text : "";
    const bool of_model = path.size() == 3 && path[0].name == "model";
    const bool of_sky = path.size() == 3 && path[0].name == "sky";
    const std::vector<std::string> taken =
        path.size() == 3 ? names_of(value_node(values, {path.front()})) : std::vector<std::string>();
    const bool is_of_file = of_model && std::ranges::count(elsewhere, name) > 0;
    if (name != was && (std::ranges::count(taken, name) > 0 || is_of_file))
        throw Error(ErrorCode::usage, "Not renamed: there is another \"" + shortened(name) + "\" already" +
                                          (is_of_file ? ", in a file that the scene names" : ""));
    if (name.empty() && (of_model || of_sky))
        throw Error(ErrorCode::usage,
                    "Not renamed: the name is empty, and what refers to it would name nothing");
    text = with_value(text, path, toml_string(name));
    // Of two elements of one name nobody knows which one is meant.
    if (old == nullptr || (!of_model && !of_sky) || std::ranges::count(taken, was) > 1) return text;
    const std::vector<std::string> uses =
        of_sky ? std::vector<std::string>{"layer.*.skies"}
               : std::vector<std::string>{"sky.*.models", "layer.*.rain.attached.*.model",
                                          "layer.*.metamorphoses.*.from", "layer.*.metamorphoses.*.to"};
    std::vector<TextPath> users;
    for (const std::string& use : uses) add_users(values, use, was, {}, users);
    for (const TextPath& user : users) text = with_value(text, user, toml_string(name));
    return text;
}

}  // namespace nephos
