// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/writer.h"

#include <algorithm>
#include <map>

#include <xxhash.h>

#include "scenes/format/schema.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

template <typename T>
const T& as(const void* value) {
    return *static_cast<const T*>(value);
}

// Key::value goes from a changeable owner to a changeable value; here nothing is changed.
const void* value_of(const Key& key, const void* owner) { return key.value(const_cast<void*>(owner)); }

std::string array_text(const std::vector<std::string>& items) {
    std::string out = "[";
    out += joined(items, ", ");
    return out += ']';
}

std::string seed_text(std::uint64_t seed) {
    constexpr std::uint64_t kLargestInteger = 0x7fffffffffffffff;  // of TOML
    if (seed <= kLargestInteger) return std::to_string(seed);
    constexpr char kHex[] = "0123456789abcdef";
    std::string digits;
    for (int shift = 60; shift >= 0; shift -= 4) digits += kHex[(seed >> shift) & 15];
    return "\"0x" + digits + "\"";
}

bool has_value(const Key& key, const void* owner) {
    if (key.value == nullptr || (key.written != nullptr && !key.written(owner))) return false;
    if (key.kind == KeyKind::tables) return key.size(value_of(key, owner)) > 0;
    return key.kind != KeyKind::path ||
           as<std::optional<std::filesystem::path>>(value_of(key, owner)).has_value();
}

bool is_written(const Section& section, const Key& key, const void* owner) {
    const Key* other = key.replaced_by.empty() ? nullptr : section.find(key.replaced_by);
    return has_value(key, owner) && (other == nullptr || !has_value(*other, owner));
}

std::string inline_table(const Section& section, const void* owner) {
    std::vector<std::string> entries;
    for (const Key& key : section.keys) {
        if (!is_written(section, key, owner)) continue;
        entries.push_back(key.name + " = " + value_text(key, value_of(key, owner)));
    }
    std::string out = "{";
    out += joined(entries, ", ");
    return out += '}';
}

std::string array_of_tables(const Key& key, const void* vector) {
    std::vector<std::string> items;
    for (std::size_t n = 0; n < key.size(vector); ++n) {
        items.push_back(inline_table(*key.section, key.element(vector, n)));
    }
    return array_text(items);
}

void write_plain_keys(std::string& out, const Section& section, const void* owner) {
    for (const Key& key : section.keys) {
        const bool nested = key.kind == KeyKind::table || key.kind == KeyKind::tables;
        if (nested || !is_written(section, key, owner)) continue;
        out += key.name + " = " + value_text(key, value_of(key, owner)) + "\n";
    }
}

bool has_plain_keys(const Section& section) {
    for (const Key& key : section.keys) {
        if (key.kind != KeyKind::table && key.kind != KeyKind::tables) return true;
    }
    return false;
}

// Tables of the file get a header each, the elements of an array of tables too; what lies in them stands
// inline.
void write_section(std::string& out, const Section& section, const void* owner, const std::string& path) {
    write_plain_keys(out, section, owner);
    for (const Key& key : section.keys) {
        if ((key.kind != KeyKind::table && key.kind != KeyKind::tables) || !is_written(section, key, owner))
            continue;
        const std::string here = key_path(path, key.name);
        const void* value = value_of(key, owner);
        if (key.kind == KeyKind::table) {
            if (has_plain_keys(*key.section)) out += "\n[" + here + "]\n";
            write_section(out, *key.section, value, here);
            continue;
        }
        for (std::size_t n = 0; n < key.size(value); ++n) {
            out += "\n[[" + here + "]]\n";
            const void* element = key.element(value, n);
            for (const Key& inner : key.section->keys) {
                if (!is_written(*key.section, inner, element)) continue;
                out += inner.name + " = " + value_text(inner, value_of(inner, element)) + "\n";
            }
        }
    }
}

using Parameters = std::vector<std::pair<std::string, std::string>>;

// The keys of a canonical text with their paths; items of arrays of tables by their number.
Parameters flattened(std::string_view text) {
    Parameters all;
    std::map<std::string, int> items;
    std::string path;
    while (!text.empty()) {
        const std::string_view line = text.substr(0, text.find('\n'));
        text.remove_prefix(std::min(text.size(), line.size() + 1));
        if (line.starts_with("[[")) {
            const std::string name(line.substr(2, line.size() - 4));
            path = indexed(name, std::size_t(items[name]++)) + ".";
        } else if (line.starts_with("[")) {
            path = std::string(line.substr(1, line.size() - 2)) + ".";
        } else if (const std::size_t equals = line.find(" = "); equals != line.npos) {
            all.emplace_back(path + std::string(line.substr(0, equals)), line.substr(equals + 3));
        }
    }
    return all;
}

std::string hash_of(std::string_view text) {
    const XXH128_hash_t hash = XXH3_128bits(text.data(), text.size());
    XXH128_canonical_t canonical;
    XXH128_canonicalFromHash(&canonical, hash);
    constexpr char kHex[] = "0123456789abcdef";
    std::string out;
    for (const unsigned char byte : canonical.digest) {
        out += kHex[byte >> 4];
        out += kHex[byte & 15];
    }
    return out;
}

}  // namespace

std::string value_text(const Key& key, const void* value) {
    const auto words = [&key](std::initializer_list<Boundary> list) {
        std::vector<std::string> items;
        for (const Boundary word : list) items.push_back(toml_string(key.words[std::size_t(word)]));
        return array_text(items);
    };
    switch (key.kind) {
        case KeyKind::boolean:
            return as<bool>(value) ? "true" : "false";
        case KeyKind::integer:
            return std::to_string(as<int>(value));
        case KeyKind::count:
            return std::to_string(as<std::uint64_t>(value));
        case KeyKind::seed:
            return seed_text(as<std::uint64_t>(value));
        case KeyKind::number:
            return toml_number(as<double>(value));
        case KeyKind::text:
            return toml_string(as<std::string>(value));
        case KeyKind::word:
            return toml_string(key.words[std::size_t(key.word_index(value))]);
        case KeyKind::path: {
            const auto& path = as<std::optional<std::filesystem::path>>(value);
            return path ? toml_string(path->generic_string()) : std::string();
        }
        case KeyKind::extent: {
            const auto& extent = as<Extent>(value);
            return array_text({std::to_string(extent.x), std::to_string(extent.y), std::to_string(extent.z)});
        }
        case KeyKind::vector: {
            const auto& vector = as<Vec3>(value);
            return array_text({toml_number(vector.x), toml_number(vector.y), toml_number(vector.z)});
        }
        case KeyKind::colour: {
            const auto& colour = as<Rgb>(value);
            return array_text({toml_number(colour[0]), toml_number(colour[1]), toml_number(colour[2])});
        }
        case KeyKind::range: {
            const auto& range = as<Range>(value);
            if (range.min == range.max) return toml_number(range.min);
            return array_text({toml_number(range.min), toml_number(range.max)});
        }
        case KeyKind::counts: {
            const auto& counts = as<CountRange>(value);
            if (counts.min == counts.max) return std::to_string(counts.min);
            return array_text({std::to_string(counts.min), std::to_string(counts.max)});
        }
        case KeyKind::texts: {
            std::vector<std::string> items;
            for (const std::string& text : as<std::vector<std::string>>(value))
                items.push_back(toml_string(text));
            return array_text(items);
        }
        case KeyKind::boundaries: {
            const auto& boundaries = as<Boundaries>(value);
            return words({boundaries.x, boundaries.y, boundaries.z});
        }
        case KeyKind::table:
            return inline_table(*key.section, value);
        case KeyKind::tables:
            return array_of_tables(key, value);
    }
    return {};
}

std::string to_toml(const Scene& scene) {
    std::string out;
    write_section(out, scene_section(), &scene, {});
    return out;
}

std::vector<std::pair<std::string, std::string>> parameters(const Scene& scene) {
    return flattened(to_toml(scene));
}

std::string scene_hash(const Scene& scene) {
    Scene named = scene;  // the folder that a state's file was found in does not make another scene
    const auto shorten = [](std::optional<std::filesystem::path>& file) {
        if (file) file = file->filename();
    };
    shorten(named.initial_state_file);
    shorten(named.render.terrain.height_map);
    for (LayerOptions& layer : named.layers) shorten(layer.initial_state_file);
    for (ProbabilityGrid& grid : named.automaton.field.grids) shorten(grid.file);
    for (WindField& field : named.automaton.wind.fields)
        for (std::string& file : field.files) file = std::filesystem::path(file).filename().string();
    for (BaseModel& model : named.models)
        for (std::string& file : model.textures) file = std::filesystem::path(file).filename().string();
    return hash_of(to_toml(named));
}

std::string frames_hash(const Scene& scene) {
    Scene endless = scene;
    endless.steps = 0;
    return scene_hash(endless);
}

std::string simulation_hash(const Scene& scene, std::string_view initial_state_hash) {
    Scene simulation;
    simulation.automaton = scene.automaton;
    simulation.models = scene.models;
    simulation.skies = scene.skies;
    simulation.climate = scene.climate;
    simulation.layers = scene.layers;
    simulation.density = scene.density;
    if (scene.ground_cover.enabled) {
        simulation.ground_cover = scene.ground_cover;
        simulation.render.ground.height_m = scene.render.ground.height_m;  // how far drops drift
        simulation.render.precipitation.kind = scene.render.precipitation.kind;
    }
    simulation.steps = 0;
    if (scene.initial_state_file) simulation.initial_state_file = "state";
    for (LayerOptions& layer : simulation.layers) {
        if (layer.initial_state_file) layer.initial_state_file = "state";
        layer.is_slab = false;  // only how it is drawn
        layer.light_absorption = 1;
    }
    for (ProbabilityGrid& grid : simulation.automaton.field.grids) grid.file = "probabilities";
    for (WindField& field : simulation.automaton.wind.fields)
        for (std::string& file : field.files) file = "wind";
    for (BaseModel& model : simulation.models) model.textures.clear();  // pictures alone have them
    std::string text = to_toml(simulation);
    text += initial_state_hash;
    return hash_of(text);
}

}  // namespace nephos
