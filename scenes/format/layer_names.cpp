// SPDX-License-Identifier: Apache-2.0
// Checks that the names of models, skies and layers differ, and that what refers to one by its name finds it.

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// Returns the item of an array of texts, or the text alone.
const Node& text_item(const SectionReader& reader, std::string_view key, std::size_t index) {
    const Node& node = reader.find(key)->value;
    return node.kind == Node::Kind::array ? node.items[index] : node;
}

template <typename Item>
void check_names_differ(const SectionReader& reader, const char* array, const std::vector<Item>& items,
                        const char* what) {
    for (std::size_t n = 0; n < items.size(); ++n) {
        const SectionReader item = reader.item(array, n);
        if (items[n].name.empty()) {
            item.report("name", item.quoted("name") + " is empty",
                        std::string("expected the name of a ") + what);
            continue;
        }
        for (std::size_t m = 0; m < n; ++m) {
            if (items[m].name != items[n].name) continue;
            item.report("name", "there are two of the name " + enclosed(shortened(items[n].name), '"'),
                        std::string("expected another name for each ") + what);
            break;
        }
    }
}

// Reports a name that none of the items has, with the closest name.
template <typename Item>
void check_known(const SectionReader& reader, const Node& node, const std::string& name,
                 const std::string& key, const std::vector<Item>& items, const char* what) {
    if (std::ranges::find(items, name, &Item::name) != items.end()) return;
    std::vector<std::string_view> names;
    std::vector<std::string> quoted;
    for (const Item& item : items) {
        names.push_back(item.name);
        if (quoted.size() < 20) quoted.push_back(enclosed(shortened(item.name), '"'));
    }
    const std::string_view meant = closest_word(name, names);
    std::string expected = quoted.empty()
                               ? std::string("expected the name of a ") + what + ", but there is none"
                               : "expected " + joined(quoted);
    if (!meant.empty()) expected = "did you mean " + enclosed(meant, '"') + "?";
    reader.document.report(
        node.place, reader.quoted(key) + ": there is no " + what + " " + enclosed(shortened(name), '"'),
        std::move(expected));
}

// Reports those of the texts of a key that no item is called by. Only what was read whole is looked at.
template <typename Item>
void check_all_known(const SectionReader& reader, const char* key, const std::vector<std::string>& names,
                     const std::vector<Item>& items, const char* what) {
    const Entry* entry = reader.find(key);
    if (entry == nullptr) return;
    const Node& node = entry->value;
    if (names.size() != (node.kind == Node::Kind::array ? node.items.size() : 1)) return;
    for (std::size_t n = 0; n < names.size(); ++n)
        check_known(reader, text_item(reader, key, n), names[n], key, items, what);
}

void check_sky(const SectionReader& reader, const NamedSky& sky) {
    if (sky.clouds > 0 && sky.models.empty()) {
        reader.report("models",
                      "the sky " + enclosed(sky.name, '"') + " has " + std::to_string(sky.clouds) +
                          " clouds and no base model",
                      "expected at least one name in `models`");
    }
}

void check_layer_name(const SectionReader& reader, const std::string& name) {
    const auto allowed = [](char c) {
        const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
        return letter || (c >= '0' && c <= '9') || c == '-' || c == '_';
    };
    if (name.size() <= 64 && std::ranges::all_of(name, allowed) && !name.starts_with('-')) return;
    reader.report(
        "name",
        reader.quoted("name") + " is " + enclosed(shortened(name), '"') + ", which makes no file names",
        "expected 1 to 64 letters, digits, `-` or `_`, not starting with `-`");
}

// Checks the skies that a layer names: at least one, and no two of one state.
void check_layer_skies(const SectionReader& reader, const Scene& scene, const LayerOptions& layer) {
    if (reader.find("skies") == nullptr) {
        reader.report("skies", reader.quoted("skies") + " is missing",
                      "expected the name of a sky or several, or a `veil`");
        return;
    }
    if (layer.skies.empty()) {
        reader.report("skies", "the layer " + enclosed(layer.name, '"') + " has no sky",
                      "expected at least one");
    }
    std::vector<const NamedSky*> known;
    for (std::size_t s = 0; s < layer.skies.size(); ++s) {
        const Node& node = text_item(reader, "skies", s);
        const auto found = std::ranges::find(scene.skies, layer.skies[s], &NamedSky::name);
        if (found == scene.skies.end()) continue;  // check_models_and_references()
        const NamedSky& sky = *found;
        const auto twin = std::ranges::find(known, sky.state, [](const NamedSky* k) { return k->state; });
        if (twin != known.end()) {
            reader.document.report(node.place,
                                   reader.quoted("skies") + ": \"" + (*twin)->name + "\" and \"" + sky.name +
                                       "\" have the same state " + number_text(sky.state),
                                   "expected skies of different states in one layer");
        }
        known.push_back(&sky);
    }
}

}  // namespace

void check_models_and_references(const SectionReader& reader, const Scene& scene) {
    if (reader.sound({"model"})) check_names_differ(reader, "model", scene.models, "base model");
    const auto all_named = [&](const char* array, const auto& items) {
        const Entry* entry = reader.find(array);
        return (entry == nullptr || entry->value.items.size() == items.size()) &&
               std::ranges::all_of(items, [](const auto& item) { return !item.name.empty(); });
    };
    const bool skies_known = all_named("sky", scene.skies);
    const bool models_known = !reader.document.models_missing && all_named("model", scene.models);
    for (std::size_t s = 0; models_known && s < scene.skies.size(); ++s)
        check_all_known(reader.item("sky", s), "models", scene.skies[s].models, scene.models,
                        "base model");
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const LayerOptions& layer = scene.layers[n];
        const SectionReader item = reader.item("layer", n);
        if (layer.is_veil) continue;
        if (skies_known) check_all_known(item, "skies", layer.skies, scene.skies, "sky");
        for (std::size_t m = 0; models_known && m < layer.metamorphoses.size(); ++m) {
            const SectionReader change = item.item("metamorphoses", m);
            for (const char* key : {"from", "to"}) {
                const NamedMetamorphosis& names = layer.metamorphoses[m];
                const std::string& name = key == std::string_view("from") ? names.from : names.to;
                if (!name.empty())
                    check_known(change, change.find(key)->value, name, key, scene.models, "base model");
            }
        }
        const SectionReader rain = item.below("rain");
        for (std::size_t r = 0; models_known && r < layer.rain.attached.size(); ++r) {
            const std::string& model = layer.rain.attached[r].model;
            if (model.empty()) continue;
            const SectionReader rule = rain.item("attached", r);
            check_known(rule, rule.find("model")->value, model, "model", scene.models, "base model");
        }
    }
}

void check_skies_and_layer_names(const SectionReader& reader, const Scene& scene) {
    check_names_differ(reader, "sky", scene.skies, "sky");
    check_names_differ(reader, "layer", scene.layers, "layer");
    for (std::size_t s = 0; s < scene.skies.size(); ++s) check_sky(reader.item("sky", s), scene.skies[s]);
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const SectionReader item = reader.item("layer", n);
        check_layer_name(item, scene.layers[n].name);
        if (!scene.layers[n].is_veil) check_layer_skies(item, scene, scene.layers[n]);
    }
}

}  // namespace nephos
