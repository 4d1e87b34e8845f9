// SPDX-License-Identifier: Apache-2.0
// The description of the keys is complete and its products are up to date: every field of every option struct
// has a key, every key reads and writes its field, and the JSON Schema and the reference in the tree are the
// generated ones.

#include <cmath>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "scenes/format/describe.h"
#include "scenes/format/reader.h"
#include "scenes/format/schema.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

std::string content(const std::string& path) {
    std::ifstream file(std::string(NEPHOS_SOURCE_DIR) + "/" + path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

TEST(Description, FilesInTheTreeAreTheGeneratedOnes) {
    const char* const advice = "the keys have changed: build the target scene_descriptions";
    EXPECT_TRUE(content("scenes/nephos.schema.json") == scene_json_schema()) << advice;
    EXPECT_TRUE(content("docs/scene-reference.md") == scene_reference()) << advice;
}

// Anything, for counting the members of an aggregate: T{Anything, Anything, ...} works for up to that many.
struct Anything {
    template <typename T>
    operator T() const;
};

template <typename T, typename... Members>
constexpr std::size_t member_count() {
    if constexpr (requires { T{Members{}..., Anything{}}; }) {
        return member_count<T, Members..., Anything>();
    } else {
        return sizeof...(Members);
    }
}

std::size_t keys_at(const std::vector<std::string>& path) {
    const Key* key = find_key(path);
    if (key == nullptr || key->section == nullptr) return 0;
    std::size_t count = 0;
    for (const Key& inner : key->section->keys) count += inner.value != nullptr;
    return count;
}

// A field that somebody adds to an option struct must become a key, too. Whoever comes here: add it to
// scenes/format/schema_automaton.cpp or scenes/format/schema_output.cpp and build the target scene_descriptions.
TEST(Description, EveryOptionHasAKey) {
    EXPECT_EQ(
        keys_at({"density"}),
        member_count<DensityOptions>() - 1 + member_count<DensityFileOptions>());  // the other is [detail]
    EXPECT_EQ(keys_at({"georeference"}),
              member_count<Georeference>() - 1);  // given: that the section is there
    EXPECT_EQ(keys_at({"detail"}), member_count<DetailOptions>());
    EXPECT_EQ(keys_at({"density", "smoothing"}), member_count<SmoothingOptions>());
    EXPECT_EQ(keys_at({"frames"}), member_count<FrameOptions>());
    EXPECT_EQ(keys_at({"camera"}), member_count<Camera>());
    // The phase function's keys stand among the light's.
    EXPECT_EQ(keys_at({"light"}), member_count<CloudLight>() - 1 + member_count<PhaseFunction>());
    EXPECT_EQ(keys_at({"light", "octaves"}), member_count<ScatteringOctaves>());
    EXPECT_EQ(keys_at({"air"}), member_count<Air>());
    EXPECT_EQ(keys_at({"atmosphere"}), member_count<AtmosphereOptions>());
    // [ground] also says where the heights of [terrain] come from.
    EXPECT_EQ(keys_at({"ground"}), member_count<Ground>() + 2);
    EXPECT_EQ(keys_at({"terrain"}), member_count<TerrainOptions>() - 2);
    EXPECT_EQ(keys_at({"water"}), member_count<WaterOptions>());
    EXPECT_EQ(keys_at({"wet_ground"}), member_count<GroundCoverOptions>() + member_count<WetGroundOptions>());
    EXPECT_EQ(keys_at({"shells"}), member_count<Shells>());
    EXPECT_EQ(keys_at({"light_shafts"}), member_count<LightShafts>());
    EXPECT_EQ(keys_at({"fog"}), member_count<Fog>());
    EXPECT_EQ(keys_at({"lightning"}), member_count<LightningFlash>());
    EXPECT_EQ(keys_at({"debug_view"}), member_count<DebugView>());
    // [sun] also holds the size of the shadow map, the one plain member of RenderOptions, and the key frames.
    EXPECT_EQ(keys_at({"sun"}), member_count<Sun>() + 2);
    EXPECT_EQ(keys_at({"sun", "path"}), member_count<SunKey>());
    EXPECT_EQ(keys_at({"precipitation"}), member_count<PrecipitationOptions>());
    EXPECT_EQ(keys_at({"level_of_detail"}), member_count<LevelOfDetailOptions>());
    EXPECT_EQ(keys_at({"camera", "path"}), member_count<CameraKey>());
    EXPECT_EQ(member_count<RenderOptions>(), 17u);
    EXPECT_EQ(keys_at({"field"}), member_count<FieldOptions>());
    EXPECT_EQ(keys_at({"field", "background"}), member_count<Probabilities>());
    EXPECT_EQ(keys_at({"field", "ellipsoids"}), member_count<Ellipsoid>());
    EXPECT_EQ(keys_at({"field", "scatters"}), member_count<EllipsoidScatter>());
    EXPECT_EQ(keys_at({"field", "scatters", "thermals"}), member_count<ThermalPlume>());
    EXPECT_EQ(keys_at({"field", "profile"}), member_count<BackgroundKeyframe>());
    // A level's background has three keys.
    EXPECT_EQ(keys_at({"field", "profile", "levels"}),
              member_count<BackgroundLevel>() - 1 + member_count<Probabilities>());
    EXPECT_EQ(keys_at({"field", "grids"}),
              member_count<ProbabilityGrid>() - 1);                     // the samples are the file's
    EXPECT_EQ(keys_at({"wind_field"}), member_count<WindField>() - 1);  // likewise
    EXPECT_EQ(keys_at({"wind"}), member_count<WindKeyframe>());
    // A level's velocity has two keys.
    EXPECT_EQ(keys_at({"wind", "levels"}), member_count<WindLevel>() - 1 + member_count<Velocity>());
    // [lattice]: extent, placement (two keys), boundaries, initial, and Scene::initial_state_file.
    EXPECT_EQ(keys_at({"lattice"}), member_count<Placement>() + 4);
    // The others of AutomatonOptions: time.step_s, seed, field, wind.
    EXPECT_EQ(member_count<AutomatonOptions>(), 8u);
    EXPECT_EQ(keys_at({"time"}), 2u);
    EXPECT_EQ(member_count<Scene>(),
              16u + 2);  // where files are named, and which keys were given, are no keys
}

TEST(Description, EveryOptionOfCloudsHasAKey) {
    EXPECT_EQ(keys_at({"model"}),
              member_count<BaseModel>() - 2);  // whether it has a centre and a rim of its own
    EXPECT_EQ(keys_at({"model", "seeds"}), member_count<Seed>());
    EXPECT_EQ(keys_at({"model", "seeds", "roots"}), member_count<Root>());
    EXPECT_EQ(keys_at({"sky"}), member_count<NamedSky>());
    EXPECT_EQ(keys_at({"climate"}), member_count<ClimateOptions>());
    EXPECT_EQ(keys_at({"climate", "schedule"}), member_count<StatePoint>());
    // [layer.lattice] holds extent, placement (two keys), boundaries and initial state, [layer.climate] the schedule.
    // Whether it is a veil is said by the table of that name, as is whether it is a slab or has detail of its own.
    EXPECT_EQ(keys_at({"layer"}), member_count<LayerOptions>() - 6);
    EXPECT_EQ(keys_at({"layer", "slab"}), member_count<VeilView>());
    EXPECT_EQ(keys_at({"layer", "slab", "two_samples"}), member_count<TwoSampleLight>());
    EXPECT_EQ(keys_at({"layer", "metamorphoses"}), member_count<NamedMetamorphosis>());
    EXPECT_EQ(keys_at({"layer", "coupling", "genera"}), member_count<GenusCoupling>());
    EXPECT_EQ(keys_at({"layer", "veil"}),
              member_count<VeilOptions>() - 2);  // the seed is the layer's, the period the tile's
    EXPECT_EQ(keys_at({"layer", "veil", "area"}), member_count<VeilArea>());
    EXPECT_EQ(keys_at({"layer", "veil", "octave"}), member_count<VeilOctave>());
    EXPECT_EQ(keys_at({"layer", "lattice"}), 5u);
    EXPECT_EQ(keys_at({"layer", "climate"}), 1u);
    EXPECT_EQ(keys_at({"layer", "coupling"}), member_count<CouplingOptions>());
    EXPECT_EQ(keys_at({"layer", "rain"}), member_count<LayerRain>());
    EXPECT_EQ(keys_at({"layer", "rain", "placed"}), member_count<PlacedRain>());
    EXPECT_EQ(keys_at({"layer", "rain", "attached"}), member_count<AttachedRainRule>());
    EXPECT_EQ(keys_at({"layer", "rain", "finder"}), member_count<RainFinderOptions>());
    EXPECT_EQ(keys_at({"layer", "rain", "column"}), member_count<HumidColumn>());
}

// A scene with one of everything.
Scene full_scene() {
    return read_scene_text(R"(
name = "full"
[[field.ellipsoids]]
centre_m = [1, 2, 3]
life_s = 500
[[field.scatters]]
count = 7
life_s = [400, 600]
x_m = [0, 5]
semi_axis_x_m = 300
[[wind]]
levels = [{ height_m = 100, east_m_per_s = 2 }, { height_m = 400, north_m_per_s = 3 }]
[[wind_field]]
kind = "vortex"
[[field.profile]]
levels = [{ height_m = 100, hum = 0.2 }, { height_m = 400, ext = 0.3 }]
[[field.grids]]
of = "act"
file = "p.vdb"
)",
                           "full.toml");
}

// The same for veils: octaves by powers, and one by one.
Scene full_veils() {
    return read_scene_text(R"(
name = "veils"
[[layer]]
name = "powers"
lattice = { cells = [64, 64, 64], cell_size_m = 10, origin_m = [0, 0, 0] }
wind = [{ levels = [{ height_m = 100, east_m_per_s = 2 }] }]
veil = { base_m = 50, top_m = 500 }
[[layer]]
name = "one-by-one"
lattice = { cells = [64, 64, 64], cell_size_m = 10, origin_m = [0, 0, 0] }
veil = { base_m = 50, top_m = 500, octave = [{ weight = 2 }, { displacement_m = [1, 2, 3] }] }
)",
                           "veils.toml");
}

// The same for a scene with layers.
Scene full_layers() {
    return read_scene_text(R"(
name = "layers"
[climate]
schedule = [{ time_s = 0, state = 0 }, { time_s = 900, state = 1 }]
[[model]]
name = "billboard"
genus = "Cu"
centre = { hum = 0.3 }
rim = { ext = 0.2 }
[[model.seeds]]
roots = [{ reproductions = [1, 2], seeds_start = 3, seeds_end = 2 }]
[[model]]
name = "other"
seeds = [{}]
[[sky]]
name = "fair"
state = 0
clouds = 3
models = "billboard"
[[sky]]
name = "storm"
state = 1
clouds = 9
models = ["billboard"]
[[layer]]
name = "low"
skies = ["fair", "storm"]
base_height_m = [100, 150]
climate = { schedule = [{ time_s = 10, state = 0.5 }] }
entering = "horizon"
shear_s = 60
light_absorption = 0.5
coupling = { genera = [{ genus = "Cu", centre = { act = 0.2 } }] }
metamorphoses = [{ from = "billboard", to = "other", state = [0.3, 0.6] }]
ellipsoids = [{ centre_m = [5, 6, 120] }]
profile = [{ levels = [{ height_m = 10, hum = 0.1 }] }]
wind = [{ levels = [{ height_m = 100, east_m_per_s = 2 }] }]
[layer.rain]
placed = [{ x_m = 100, y_m = 200 }]
attached = [{ genus = "Cu" }]
)",
                           "layers.toml");
}

double changed(double value, const Limits& limits) {
    const auto allowed = [&](double v) {
        return v != value && v >= limits.min && v <= limits.max && (v != limits.min || !limits.above_min) &&
               (v != limits.max || !limits.below_max);
    };
    for (const double candidate : {value * 1.001, value * 0.999, 0.25, -0.25, 300.0}) {
        if (std::isfinite(candidate) && allowed(candidate)) return candidate;
    }
    ADD_FAILURE() << "no other value than " << value;
    return value;
}

int changed_integer(int value, const Limits& limits) {
    return value + 1 <= limits.max ? value + 1 : value - 1;
}

template <typename T>
T& as(void* value) {
    return *static_cast<T*>(value);
}

// Gives a key's value another one that is allowed.
void change(const Key& key, void* value) {
    switch (key.kind) {
        case KeyKind::boolean:
            as<bool>(value) = !as<bool>(value);
            break;
        case KeyKind::integer:
            as<int>(value) = changed_integer(as<int>(value), key.limits);
            break;
        case KeyKind::count:
            as<std::uint64_t>(value) += 3;
            break;
        case KeyKind::seed:
            as<std::uint64_t>(value) = 0x8000000000000005;
            break;
        case KeyKind::number:
            as<double>(value) = changed(as<double>(value), key.limits);
            break;
        case KeyKind::text:
            as<std::string>(value) += "-other";
            break;
        case KeyKind::path:
            as<std::optional<std::filesystem::path>>(value) = "/a folder/\"state\"\t\xE9\x9B\xB2.png";
            break;
        case KeyKind::word:
            key.set_word(value, key.word_index(value) == 0 ? 1 : 0);
            break;
        case KeyKind::extent:
            as<Extent>(value).y += 1;
            break;
        case KeyKind::vector:
            as<Vec3>(value).z = changed(as<Vec3>(value).z, key.limits);
            break;
        case KeyKind::colour:
            as<Rgb>(value)[1] = changed(as<Rgb>(value)[1], key.limits);
            break;
        case KeyKind::range:
            as<Range>(value).min = changed(std::min(as<Range>(value).min, 400.0), key.limits);
            as<Range>(value).max = std::max(as<Range>(value).min, std::min(as<Range>(value).max, 1e6));
            break;
        case KeyKind::counts:
            as<CountRange>(value).max += 1;
            break;
        case KeyKind::texts:
            as<std::vector<std::string>>(value).push_back("other");
            break;
        case KeyKind::boundaries:
            as<Boundaries>(value).z = Boundary::periodic;
            break;
        case KeyKind::table:
        case KeyKind::tables:
            break;
    }
}

// Calls `visit` for every key that holds a value, with the place of the value in the scene.
void for_every_value(const Section& section, void* owner, const std::string& path,
                     const std::function<void(const Key&, void*, const std::string&)>& visit) {
    for (const Key& key : section.keys) {
        if (key.value == nullptr || (key.written != nullptr && !key.written(owner))) continue;
        void* value = key.value(owner);
        const std::string here = path + "/" + key.name;
        if (key.kind == KeyKind::table) {
            for_every_value(*key.section, value, here, visit);
        } else if (key.kind == KeyKind::tables) {
            for (std::size_t n = 0; n < key.size(value); ++n) {
                void* element = const_cast<void*>(key.element(value, n));
                for_every_value(*key.section, element, here + "/" + std::to_string(n), visit);
            }
        } else {
            visit(key, value, here);
        }
    }
}

// What names something else: changed alone, the scene is no longer valid, but its hash is another one.
bool is_reference(const std::string& path) {
    return path.ends_with("/name") || path.ends_with("/models") || path.ends_with("/skies") ||
           path.ends_with("/model") || path.ends_with("/from") || path.ends_with("/to") ||
           path.ends_with("/initial_state");
}

// What must fit its neighbours.
bool is_moment(const std::string& path) {
    return path == "/sun/date" || path == "/sun/time" || path == "/sun/moves";
}

// Every value, changed alone, is written, read back as it was, and seen by the hash; and no two keys share a
// value.
void expect_own_values(Scene (*make)(), std::size_t at_least) {
    std::set<std::string> hashes{scene_hash(make())};
    std::set<const void*> values;
    Scene layout = make();
    std::vector<std::string> paths;
    for_every_value(scene_section(), &layout, "", [&](const Key&, void* value, const std::string& path) {
        EXPECT_TRUE(values.insert(value).second) << path << " shares its value with another key";
        paths.push_back(path);
    });
    EXPECT_GT(paths.size(), at_least);
    for (const std::string& wanted : paths) {
        SCOPED_TRACE(wanted);
        Scene scene = make();
        for_every_value(scene_section(), &scene, "",
                        [&](const Key& key, void* value, const std::string& path) {
                            if (path == wanted) change(key, value);
                        });
        const std::string text = to_toml(scene);
        EXPECT_TRUE(hashes.insert(scene_hash(scene)).second) << "the hash does not see it";
        if (is_moment(wanted) || (make != &full_scene && is_reference(wanted))) continue;
        EXPECT_EQ(read_scene_text(text, "again.toml"), scene) << text;
        EXPECT_EQ(to_toml(read_scene_text(text, "again.toml")), text);
    }
}

TEST(Description, EveryKeyReadsAndWritesItsOwnValue) { expect_own_values(&full_scene, 80); }

TEST(Description, EveryKeyOfLayersReadsAndWritesItsOwnValue) { expect_own_values(&full_layers, 130); }

TEST(Description, EveryKeyOfVeilsReadsAndWritesItsOwnValue) { expect_own_values(&full_veils, 100); }

// What a user is told must be there: each key has its effect, each number with a dimension its unit.
TEST(Description, EveryKeyIsExplained) {
    std::function<void(const Section&, const std::string&)> visit = [&](const Section& section,
                                                                        const std::string& path) {
        for (const Key& key : section.keys) {
            const std::string here = path + "/" + key.name;
            EXPECT_FALSE(key.effect.empty()) << here;
            EXPECT_FALSE(expected_text(key).empty()) << here;
            if (key.kind == KeyKind::count) {
                EXPECT_GE(key.limits.min, 0) << here << " has no sign";
            }
            for (const auto& [suffix, unit] : {std::pair{"_m", "m"},
                                               {"_s", "s"},
                                               {"_deg", "deg"},
                                               {"_per_m", "1/m"},
                                               {"_m_per_s", "m/s"},
                                               {"_cells", "cells"}}) {
                const std::string end = suffix;
                const bool ends = key.name.ends_with(end);
                const bool longer = key.name.ends_with("_h_per_m") || key.name.ends_with("_per" + end) ||
                                    key.name.ends_with("_m_per_s");
                if (ends && (!longer || (end.size() > 2 && !key.name.ends_with("_h_per_m")))) {
                    EXPECT_EQ(key.unit, unit) << here;
                }
            }
            if (key.section != nullptr) visit(*key.section, here);
        }
    };
    visit(scene_section(), "");
}

}  // namespace
}  // namespace nephos
