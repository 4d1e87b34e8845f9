// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/schema.h"

#include <algorithm>
#include <cmath>

#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

std::string quoted_words(const Key& key) {
    std::vector<std::string> words;
    for (const std::string_view word : key.words) words.push_back(enclosed(word, '"'));
    return joined(words);
}

// "... from 1 to 170, in degrees"
std::string numbers_text(const Key& key, std::string_view what) {
    const std::string limits = limits_text(key.limits);
    std::string out(what);
    if (!limits.empty()) out += " " + limits;
    if (key.limits.infinite) out += " or inf";
    if (key.unit == "per step") {
        out += ", a probability per step";
    } else if (!key.unit.empty()) {
        out += ", in " + unit_text(key.unit);
    }
    return out;
}

}  // namespace

std::string key_path(std::string_view section, std::string_view key) {
    std::string path(section);
    if (!section.empty() && !key.empty()) path += '.';
    path += key;
    return path;
}

std::string SectionReader::quoted(std::string_view key) const { return enclosed(key_path(path, key), '`'); }

bool SectionReader::sound(std::initializer_list<std::string_view> names) const {
    return std::none_of(names.begin(), names.end(), [this](std::string_view name) {
        return std::find(failed.begin(), failed.end(), name) != failed.end();
    });
}

Place SectionReader::place(std::string_view key) const {
    const Entry* entry = find(key);
    return entry != nullptr ? entry->value.place : table.place;
}

double SectionReader::number(std::string_view key, double otherwise) const {
    const Entry* entry = find(key);
    if (entry == nullptr) return otherwise;
    if (entry->value.kind == Node::Kind::integer) return double(entry->value.integer);
    if (entry->value.kind != Node::Kind::number) return otherwise;
    return entry->value.number == 0 ? 0.0 : entry->value.number;  // one zero only, as all other keys
}

void SectionReader::report(std::string_view key, std::string message, std::string expected) const {
    document.report(place(key), std::move(message), std::move(expected));
}

SectionReader SectionReader::below(std::string_view key) const {
    static const Node empty;
    const Entry* entry = find(key);
    const bool there = entry != nullptr && entry->value.kind == Node::Kind::table;
    return {document, there ? entry->value : empty, key_path(path, key), {}};
}

SectionReader SectionReader::item(std::string_view array, std::size_t index) const {
    return {document, find(array)->value.items[index], indexed(key_path(path, array), index), {}};
}

const Key* Section::find(std::string_view name) const {
    for (const Key& key : keys) {
        if (key.name == name) return &key;
    }
    return nullptr;
}

bool takes_text(const Key& key) {
    return key.kind == KeyKind::text || key.kind == KeyKind::path || key.kind == KeyKind::word ||
           key.kind == KeyKind::texts || key.kind == KeyKind::boundaries;
}

const Key* find_key(const std::vector<std::string>& path) {
    const Section* section = &scene_section();
    const Key* key = nullptr;
    for (const std::string& name : path) {
        if (section == nullptr) return nullptr;
        key = section->find(name);
        if (key == nullptr) return nullptr;
        section = key->section;
    }
    return key;
}

std::string limits_text(const Limits& limits) {
    const bool low = std::isfinite(limits.min), high = std::isfinite(limits.max);
    if (!low && !high) return {};
    if (low && high && !limits.above_min && !limits.below_max) {
        return "from " + number_text(limits.min) + " to " + number_text(limits.max);
    }
    std::string out;
    if (low) out = (limits.above_min ? "above " : "at least ") + number_text(limits.min);
    if (low && high) out += " and ";
    if (high) out += (limits.below_max ? "below " : "at most ") + number_text(limits.max);
    return out;
}

std::string unit_text(std::string_view unit) {
    if (unit == "m") return "metres";
    if (unit == "s") return "seconds";
    if (unit == "deg") return "degrees";
    if (unit == "1/m") return "1/metre";
    if (unit == "1/s") return "1/second";
    if (unit == "m/s") return "metres per second";
    if (unit == "s/s") return "simulated seconds per second of film";
    return std::string(unit);
}

std::string expected_text(const Key& key) {
    switch (key.kind) {
        case KeyKind::boolean:
            return "true or false";
        case KeyKind::integer:
        case KeyKind::count:
            return numbers_text(key, "an integer");
        case KeyKind::seed:
            return "an integer from 0 to 9223372036854775807, or a text such as \"0xffffffffffffffff\"";
        case KeyKind::number:
            return numbers_text(key, "a number");
        case KeyKind::text:
            return "a text";
        case KeyKind::path:
            return "the name of a file";
        case KeyKind::word:
            return quoted_words(key);
        case KeyKind::extent:
            return "[x, y, z], each " + numbers_text(key, "an integer");
        case KeyKind::vector:
            return "[x, y, z], each " + numbers_text(key, "a number");
        case KeyKind::colour:
            return "[red, green, blue], each " + numbers_text(key, "a number");
        case KeyKind::range:
            return "[min, max] or one number for both, each " + numbers_text(key, "a number");
        case KeyKind::counts:
            return "[min, max] or one integer for both, each " + numbers_text(key, "an integer");
        case KeyKind::texts:
            return "a text or an array of texts";
        case KeyKind::boundaries:
            return "[x, y, z] or one word for all, each " + quoted_words(key);
        case KeyKind::table:
            return "a table of keys";
        case KeyKind::tables: {
            std::string out = "an array of tables";
            if (key.min_items > 0) out += ", at least " + std::to_string(key.min_items);
            return out;
        }
    }
    return {};
}

const Section& scene_section() {
    using namespace schema_build;
    static const Section section = [] {
        Key name = default_is(
            key<&Scene::name>("name", "", kAny,
                              "Base name of the files that are written: letters, digits, `-`, `_` and `.`."),
            "the name of the scene's file");
        Key seed = seed_key<&Scene::automaton, &AutomatonOptions::seed>(
            "seed",
            "Start of all randomness: the same seed gives the same clouds, bit for bit, on every machine.");
        Key climate = table<&Scene::climate>("climate", climate_section(), climate_section().effect);
        climate.written = [](const void* scene) {
            return !(static_cast<const Scene*>(scene)->climate == ClimateOptions{});
        };
        Key water = group("water", water_section());
        water.written = [](const void* owner) {
            return !(static_cast<const Scene*>(owner)->render.water == WaterOptions{});
        };
        Key terrain = group("terrain", terrain_section());
        terrain.written = [](const void* owner) {
            TerrainOptions options = static_cast<const Scene*>(owner)->render.terrain;
            options.height_map.reset();  // these two are keys of [ground]
            options.relief = Relief::none;
            return !(options == TerrainOptions{});
        };
        Key wet_ground = group("wet_ground", wet_ground_section());
        wet_ground.written = [](const void* owner) {
            const auto& scene = *static_cast<const Scene*>(owner);
            return !(scene.ground_cover == GroundCoverOptions{} &&
                     scene.render.wet_ground == WetGroundOptions{});
        };
        Key precipitation = group("precipitation", precipitation_section());
        precipitation.written = [](const void* scene) {
            return !(static_cast<const Scene*>(scene)->render.precipitation == PrecipitationOptions{});
        };
        Key detail = table<&Scene::density, &DensityOptions::detail>("detail", detail_section(), detail_section().effect);
        detail.written = [](const void* scene) {
            return !(static_cast<const Scene*>(scene)->density.detail == DetailOptions{});
        };
        Key georeference = group("georeference", georeference_section());
        georeference.written = [](const void* scene) {
            return static_cast<const Scene*>(scene)->georeference.given;
        };
        Key level_of_detail = group("level_of_detail", level_of_detail_section());
        level_of_detail.written = [](const void* scene) {
            return !(static_cast<const Scene*>(scene)->render.level_of_detail == LevelOfDetailOptions{});
        };
        return Section{
            "Scene",
            "",
            {name,
             seed,
             written_if(
                 key<&Scene::tile>(
                     "tile", "", kAny,
                     "Make density that repeats towards east and north, so that copies of it fit side by side: all "
                     "lattices cover one rectangle and are periodic there, clouds that leave it enter on the other side, "
                     "and veils repeat (their `margin_m` does not count)."),
                 [](const void* scene) { return static_cast<const Scene*>(scene)->tile; }),
             model_files_key(),
             group("lattice", lattice_section()),
             group("time", time_section()),
             std::move(georeference),
             group("field", field_section()),
             tables<&Scene::automaton, &AutomatonOptions::wind, &Wind::keyframes>("wind", wind_section(), 0,
                                                                                  10'000),
             tables<&Scene::automaton, &AutomatonOptions::wind, &Wind::fields>("wind_field", wind_field_section(), 0,
                                                                               1000),
             tables<&Scene::models>("model", model_section(), 0, kMaxModels),
             tables<&Scene::skies>("sky", sky_section(), 0, 10'000),
             std::move(climate),
             tables<&Scene::layers>("layer", layer_section(), 0, int(kMaxLayers)),
             group("density", density_section()),
             std::move(detail),
             group("frames", frames_section()),
             group("camera", camera_section()),
             group("sun", sun_section()),
             group("light", light_section()),
             tables<&Scene::render, &RenderOptions::lightning>("lightning", lightning_section(), 0, 10'000),
             group("air", air_section()),
             group("atmosphere", atmosphere_section()),
             group("ground", ground_section()),
             std::move(terrain),
             std::move(water),
             std::move(wet_ground),
             std::move(precipitation),
             group("shells", shells_section()),
             group("light_shafts", light_shafts_section()),
             group("fog", fog_section()),
             std::move(level_of_detail),
             group("debug_view", debug_view_section())},
            &finish_scene};
    }();
    return section;
}

}  // namespace nephos
