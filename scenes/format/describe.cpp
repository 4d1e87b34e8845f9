// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/describe.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "scenes/format/schema.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

// Returns the default of a key as TOML; empty where there is none.
std::string default_of(const Key& key, const void* owner) {
    if (key.required || key.value == nullptr || key.section != nullptr) return {};
    if (!key.default_text.empty()) return key.default_text;
    return value_text(key, key.value(const_cast<void*>(owner)));
}

// Returns the effect with unit, range, default and source, as editors display it.
std::string description_of(const Key& key, const std::string& otherwise) {
    std::string out = key.effect;
    if (key.section == nullptr) out += " Expects " + expected_text(key) + ".";
    if (!otherwise.empty()) out += " Default: " + otherwise + ".";
    return out;
}

void add_limits(Json& json, const Limits& limits) {
    if (std::isfinite(limits.min)) json["minimum"] = limits.min;
    if (limits.above_min) json["exclusiveMinimum"] = true;
    if (std::isfinite(limits.max)) json["maximum"] = limits.max;
    if (limits.below_max) json["exclusiveMaximum"] = true;
}

Json number_json(const Key& key, const char* type) {
    Json json{{"type", type}};
    add_limits(json, key.limits);
    return json;
}

Json array_json(Json item, int count) {
    return {{"type", "array"}, {"items", std::move(item)}, {"minItems", count}, {"maxItems", count}};
}

Json word_json(const Key& key) {
    Json words = Json::array();
    for (const std::string_view word : key.words) words.push_back(std::string(word));
    return {{"type", "string"}, {"enum", std::move(words)}};
}

Json any_of(Json first, Json second) {
    return {{"anyOf", Json::array({std::move(first), std::move(second)})}};
}

Json section_json(const Section& section, const void* owner);

Json key_json(const Key& key, const void* owner) {
    switch (key.kind) {
        case KeyKind::boolean:
            return {{"type", "boolean"}};
        case KeyKind::integer:
        case KeyKind::count:
            return number_json(key, "integer");
        case KeyKind::seed:
            return any_of({{"type", "integer"}, {"minimum", 0}, {"maximum", 0x7fffffffffffffff}},
                          {{"type", "string"}, {"pattern", "^([0-9]{1,20}|0[xX][0-9a-fA-F]{1,16})$"}});
        case KeyKind::number:
            return number_json(key, "number");
        case KeyKind::text:
        case KeyKind::path:
            return {{"type", "string"}};
        case KeyKind::word:
            return word_json(key);
        case KeyKind::extent:
            return array_json(number_json(key, "integer"), 3);
        case KeyKind::vector:
        case KeyKind::colour:
            return array_json(number_json(key, "number"), 3);
        case KeyKind::range:
            return any_of(number_json(key, "number"), array_json(number_json(key, "number"), 2));
        case KeyKind::counts:
            return any_of(number_json(key, "integer"), array_json(number_json(key, "integer"), 2));
        case KeyKind::texts:
            return any_of({{"type", "string"}}, {{"type", "array"}, {"items", {{"type", "string"}}}});
        case KeyKind::boundaries:
            return any_of(word_json(key), array_json(word_json(key), 3));
        case KeyKind::table:
            return section_json(*key.section, key.value(const_cast<void*>(owner)));
        case KeyKind::tables:
            return {{"type", "array"},
                    {"items", section_json(*key.section, key.element_defaults)},
                    {"minItems", key.min_items},
                    {"maxItems", key.max_items}};
    }
    return {};
}

Json section_json(const Section& section, const void* owner) {
    Json properties = Json::object(), required = Json::array(), dependencies = Json::object();
    for (const Key& key : section.keys) {
        Json json{{"description", description_of(key, default_of(key, owner))}};
        json.update(key_json(key, owner));
        properties[key.name] = std::move(json);
        if (key.required) required.push_back(key.name);
        if (!key.together_with.empty()) dependencies[key.name] = key.together_with;
    }
    Json json{{"type", "object"}, {"additionalProperties", false}, {"properties", std::move(properties)}};
    if (!required.empty()) json["required"] = std::move(required);
    if (!dependencies.empty()) json["dependencies"] = std::move(dependencies);
    for (const Key& key : section.keys) {
        if (key.replaced_by.empty()) continue;
        json["not"] = {{"required", {key.name, key.replaced_by}}};  // no section has two such pairs
    }
    return json;
}

std::string type_text(const Key& key) {
    switch (key.kind) {
        case KeyKind::boolean:
            return "boolean";
        case KeyKind::integer:
        case KeyKind::count:
            return "integer";
        case KeyKind::seed:
            return "integer or text";
        case KeyKind::number:
            return "number";
        case KeyKind::text:
            return "text";
        case KeyKind::path:
            return "file";
        case KeyKind::word:
            return "word";
        case KeyKind::extent:
            return "3 integers";
        case KeyKind::vector:
            return "3 numbers";
        case KeyKind::colour:
            return "linear RGB";
        case KeyKind::range:
            return "[min, max] or number";
        case KeyKind::counts:
            return "[min, max] or integer";
        case KeyKind::texts:
            return "texts";
        case KeyKind::boundaries:
            return "3 words or 1";
        case KeyKind::table:
            return "table";
        case KeyKind::tables:
            return "array of tables";
    }
    return {};
}

std::string range_text(const Key& key) {
    if (!key.words.empty()) {
        std::vector<std::string> words;
        for (const std::string_view word : key.words) words.push_back(enclosed(toml_string(word), '`'));
        return joined(words);
    }
    if (key.kind == KeyKind::seed) return "64 bits";
    return limits_text(key.limits) + (key.limits.infinite ? " or inf" : "");
}

std::string default_cell(const Key& key, const void* owner, bool top) {
    if (key.required) return "required";
    if (key.kind == KeyKind::table && !top) {
        return enclosed(value_text(key, key.value(const_cast<void*>(owner))), '`');
    }
    const std::string text = default_of(key, owner);
    return text.empty() || !key.default_text.empty() ? text : enclosed(text, '`');
}

// The table of a section's keys; the top of the file has no header.
void add_section(std::string& out, const Section& section, const void* owner, const std::string& header) {
    if (!header.empty()) out += "\n## " + header + "\n\n" + section.effect + "\n\n";
    out += "| key | type | unit | range | default | effect | source |\n|---|---|---|---|---|---|---|\n";
    for (const Key& key : section.keys) {
        out += "| " + enclosed(key.name, '`');
        for (const std::string& cell : {type_text(key), key.unit, range_text(key),
                                        default_cell(key, owner, header.empty()), key.effect, key.source}) {
            out += " | " + cell;
        }
        out += " |\n";
    }
}

// Adds each section once, in the order of the file; tables that occur in several places at the first.
void add_nested(std::string& out, const Section& section, const void* owner, const std::string& path,
                std::vector<const Section*>& done) {
    for (const Key& key : section.keys) {
        if (key.section == nullptr) continue;
        if (std::find(done.begin(), done.end(), key.section) != done.end()) continue;
        done.push_back(key.section);
        const bool many = key.kind == KeyKind::tables;
        const std::string here = key_path(path, key.name);
        const void* inner = many ? key.element_defaults : key.value(const_cast<void*>(owner));
        add_section(out, *key.section, inner,
                    enclosed((many ? "[[" : "[") + here + (many ? "]]" : "]"), '`'));
        add_nested(out, *key.section, inner, here, done);
    }
}

constexpr std::string_view kReferenceOpening = R"(# Scene reference

A scene is a TOML file; every key has a default unless it says "required", so a scene of ten lines is enough.
This page and the JSON Schema `scenes/nephos.schema.json` are generated from the description that the reader itself
follows (`scenes/format/schema.h`): the target `scene_descriptions` writes both anew. With `#:schema ./nephos.schema.json` as the first line of
a scene, editors complete and check while you type.

World space is in metres: x east, y north, z up. Colours are linear RGB. A key on the command line, as in
`--set sun.elevation_deg=12` or `--set wind[0].levels[1].height_m=900`, replaces the one in the file; file names in a scene are relative to the
scene's folder, on the command line to the current folder. Unknown keys are errors.

Sources: D = Dobashi, Kaneda, Yamashita, Okita, Nishita, "A Simple, Efficient Method for Realistic Animation of Clouds",
SIGGRAPH 2000; T = Torchelsen's dissertation on skies of seeds and roots, 2005; S = Sapronov's procedural atmosphere of a flight
simulator; P = Puig-Centelles, Ripolles, Chover on areas of rain, 2008. No source: nephos' own.

What the automaton and the density make of these numbers, exactly: [model.md](model.md).

## The top of the file

)";

}  // namespace

std::string scene_json_schema() {
    const Scene defaults;
    Json json{{"$schema", "http://json-schema.org/draft-04/schema#"},
              {"title", "nephos scene"},
              {"description", "Generated from scenes/format/schema.h; see docs/scene-reference.md."}};
    json.update(section_json(scene_section(), &defaults));
    return json.dump(2) + "\n";
}

std::string scene_reference() {
    const Scene defaults;
    std::string out(kReferenceOpening);
    add_section(out, scene_section(), &defaults, {});
    std::vector<const Section*> done;
    add_nested(out, scene_section(), &defaults, {}, done);
    return out;
}

}  // namespace nephos
