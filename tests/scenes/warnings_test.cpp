// SPDX-License-Identifier: Apache-2.0
// Notes about valid scenes: each that there is appears where it should, and not beside it. And what a scene's place on
// Earth makes of its sun.

#include "scenes/format/warnings.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/reader.h"

namespace nephos {
namespace {

using Notes = std::vector<std::string>;

Scene scene_of(const std::string& text) { return read_scene_text(text, "notes.toml"); }

// How many notes have this text.
std::ptrdiff_t count(const Notes& notes, const std::string& text) {
    return std::ranges::count_if(notes, [&](const std::string& note) { return note.find(text) != note.npos; });
}

// A lattice of 1,000 x 1,000 x 500 m whose clouds do not thin out towards its sides.
const std::string kBox =
    "[lattice]\ncells = [20, 20, 10]\ncell_size_m = 50\nboundaries = \"open\"\n"
    "[detail]\napron_cells = 0\n";

std::string ellipsoid(const std::string& centre) {
    return kBox + "[[field.ellipsoids]]\ncentre_m = " + centre + "\nsemi_axes_m = [100, 100, 100]\ncentre = { act = 0.1 }\n";
}

TEST(Warnings, NameEachSideThatCutsAnEllipsoid) {
    EXPECT_EQ(warnings(scene_of(ellipsoid("[500, 500, 250]"))), Notes{});
    const struct {
        const char* centre;
        const char* note;
    } kCuts[] = {{"[90, 500, 250]", "up to 10 m beyond the lattice's west side"},
                 {"[930, 500, 250]", "up to 30 m beyond the lattice's east side"},
                 {"[500, 95, 250]", "up to 5 m beyond the lattice's south side"},
                 {"[500, 999, 250]", "up to 99 m beyond the lattice's north side"},
                 {"[500, 500, 420]", "up to 20 m above the lattice's top at 500 m"}};
    for (const auto& cut : kCuts) {
        const Notes notes = warnings(scene_of(ellipsoid(cut.centre)));
        EXPECT_EQ(count(notes, cut.note), 1) << cut.centre;
        EXPECT_EQ(notes.size(), 1u) << cut.centre;
        EXPECT_EQ(count(notes, "[[field.ellipsoids]] number 1"), 1) << cut.centre;
    }
}

TEST(Warnings, DoNotConcernPeriodicSidesOrThoseWithAnApron) {
    std::string text = ellipsoid("[90, 500, 420]");
    EXPECT_EQ(warnings(scene_of(text)).size(), 2u);
    const std::size_t apron = text.find("apron_cells = 0");
    text.replace(apron, 15, "apron_cells = 2");
    EXPECT_EQ(count(warnings(scene_of(text)), "west"), 0);
    EXPECT_EQ(warnings(scene_of(text)).size(), 1u);
    const std::size_t open = text.find("\"open\"");
    text.replace(open, 6, "\"periodic\"");
    EXPECT_EQ(warnings(scene_of(text)), Notes{});
}

TEST(Warnings, CountTheHighestAndWidestParcelsOfScatters) {
    const std::string scatter =
        kBox +
        "[[field.scatters]]\ncount = 3\nx_m = [300, 700]\ny_m = [300, 700]\nz_m = [100, 200]\n"
        "semi_axis_x_m = [100, 150]\nsemi_axis_y_m = [100, 150]\nsemi_axis_z_m = [50, 100]\ncentre = { act = 0.1 }\n";
    EXPECT_EQ(warnings(scene_of(scatter)), Notes{});
    const Notes plumes = warnings(scene_of(scatter + "thermals = { interval_s = 10, rise_m = 300, wander = 0.5 }\n"));
    EXPECT_EQ(count(plumes, "[[field.scatters]] number 1 reaches up to"), std::ptrdiff_t(plumes.size()));
    EXPECT_EQ(count(plumes, "above the lattice's top"), 1);
}

TEST(Warnings, NameBaseModelsThatNothingUses) {
    EXPECT_EQ(count(warnings(scene_of("[[model]]\nname = \"Cu\"\nseeds = [{}]\n")), "no [[layer]] whose skies use them"), 1);
}

// A layer of clouds, with `keys` of its own and of its base model.
Scene layer_scene(const std::string& keys, const std::string& model = "seeds = [{ size_m = [200, 200, 200] }]\n") {
    return scene_of("[[model]]\nname = \"Cu\"\n" + model +
                    "[[sky]]\nname = \"fair\"\nstate = 0.5\nclouds = 1\nmodels = \"Cu\"\n"
                    "[[layer]]\nname = \"low\"\nskies = \"fair\"\nbase_height_m = 100\n"
                    "lattice = { cells = [40, 40, 20], cell_size_m = 50 }\n" +
                    keys);
}

TEST(Warnings, NameTheLayerOfItsParcels) {
    const std::string parcel =
        "automaton = true\n[[layer.ellipsoids]]\ncentre_m = [1000, 1000, 950]\nsemi_axes_m = [100, 100, 100]\n"
        "centre = { act = 0.1 }\n";
    EXPECT_EQ(count(warnings(layer_scene(parcel)), "[[layer.ellipsoids]] of layer 'low', number 1 reaches up to 50 m above"), 1);
    EXPECT_EQ(warnings(layer_scene("automaton = true\n")), Notes{});
}

TEST(KeysWithoutEffect, OfLayersThatAreDrawnDirectly) {
    const Notes none = keys_without_effect(layer_scene("automaton = false\n"));
    EXPECT_EQ(none, Notes{});
    const Notes notes = keys_without_effect(layer_scene("automaton = false\nlight_absorption = 0.5\nellipsoids = [{ centre_m = [1000, 1000, 500] }]\n"));
    EXPECT_EQ(count(notes, "`light_absorption` has no effect without `automaton`"), 1);
    EXPECT_EQ(count(notes, "profile and coupling have no effect without `automaton`"), 1);
    EXPECT_EQ(notes.size(), 2u);
}

// Each key alone: one note where no automaton reads it, and none where one does.
TEST(KeysWithoutEffect, OfAutomataWhereAllLayersAreDrawnDirectly) {
    const struct {
        const char *layer, *model, *scene, *note;
    } kKeys[] = {{"background = { act = 0.2 }\n", "", "", "layer 'low' is drawn directly: `background` has no effect"},
                 {"[layer.detail]\nsize_m = 90\n", "", "", "layer 'low' is drawn directly: [layer.detail] has no effect"},
                 {"", "centre = { hum = 0.2 }\n", "", "base model 'Cu': `centre` has no effect"},
                 {"", "rim = { hum = 0.2 }\n", "", "base model 'Cu': `rim` has no effect"},
                 {"", "seeds = [{ strength = 0.5 }]\n", "", "base model 'Cu': `seeds.strength` has no effect"},
                 {"", "", "[field.background]\next = 0.3\n", "[field] has no effect"},
                 {"", "", "[[field.profile]]\nlevels = [{ height_m = 0, hum = 0.1 }]\n", "[field] has no effect"},
                 {"", "", "[density]\nrefine = 2\n", "[density] has no effect"},
                 {"", "", "[density]\nper_layer = false\n", "[density] has no effect"},
                 {"", "", "[detail]\nsize_m = 90\n", "[detail] has no effect"}};
    for (const auto& key : kKeys) {
        const std::string model = std::string(key.model).starts_with("seeds")
                                      ? key.model
                                      : std::string(key.model) + "seeds = [{ size_m = [200, 200, 200] }]\n";
        const auto notes = [&](const std::string& automaton) {
            return keys_without_effect(layer_scene(automaton + key.layer + key.scene, model));
        };
        EXPECT_EQ(notes("automaton = true\n"), Notes{}) << key.note;
        EXPECT_EQ(count(notes("automaton = false\n"), key.note), 1) << key.note;
        EXPECT_EQ(notes("automaton = false\n").size(), 1u) << key.note;
    }
}

TEST(KeysWithoutEffect, OfSeedsWhoseModelHasPictures) {
    const auto notes = [](const std::string& keys, const std::string& automaton) {
        return keys_without_effect(layer_scene(automaton, keys));
    };
    const std::string seeds = "seeds = [{ texture = \"wispy\" }]\n", textures = "textures = [\"a.png\"]\n";
    EXPECT_EQ(notes(seeds, "automaton = false\n"), Notes{});
    EXPECT_EQ(notes(textures + "seeds = [{}]\n", "automaton = false\n"), Notes{});
    EXPECT_EQ(count(notes(textures + seeds, "automaton = false\n"), "`seeds.texture` has no effect: its `textures`"), 1);
    EXPECT_EQ(count(notes(textures + seeds, "automaton = true\n"), "`seeds.texture`"), 0) << "all of billboards is noted";
}

TEST(KeysWithoutEffect, OfCloudsThatCannotComeOverTheHorizon) {
    const std::string horizon = "automaton = true\nentering = \"horizon\"\n",
                      profile = "[[wind]]\nlevels = [{ height_m = 0, east_m_per_s = 5 }]\n",
                      field = "[[wind_field]]\nkind = \"vortex\"\n";
    EXPECT_EQ(keys_without_effect(layer_scene(horizon + profile)), Notes{});
    EXPECT_EQ(keys_without_effect(layer_scene(horizon + profile + field)), Notes{});
    EXPECT_EQ(count(keys_without_effect(layer_scene(horizon)), "no cloud will ever enter or leave"), 1);
    const Notes carried = keys_without_effect(layer_scene(horizon + field));
    EXPECT_EQ(count(carried, "no cloud will ever enter: `entering` is \"horizon\", and only the profile"), 1);
    EXPECT_EQ(carried.size(), 1u);
    EXPECT_EQ(keys_without_effect(layer_scene("automaton = true\n" + field)), Notes{});
}

TEST(KeysWithoutEffect, OfClimateAndTile) {
    const std::string text =
        "[lattice]\ncells = [40, 40, 100]\ncell_size_m = 100\n[[wind]]\nlevels = [{ height_m = 0, east_m_per_s = 5 }]\n"
        "[[sky]]\nname = \"s\"\nstate = 0\n[[layer]]\nname = \"a\"\nskies = \"s\"\ngenus = \"Cu\"\n";
    const auto notes = [&](std::vector<std::string> overrides, const std::string& bases = "genus = \"Cu\"") {
        std::string of = text;
        of.replace(of.find("genus = \"Cu\""), 12, bases);
        return keys_without_effect(read_scene_text(of, "notes.toml", {}, overrides));
    };
    const std::string polar = "climate.region=polar", height = "base_height_m = 1200";
    EXPECT_EQ(notes({polar}), Notes{});
    EXPECT_EQ(notes({polar, "layer[0].automaton=false", "ground.height_m=300"}), Notes{});
    EXPECT_EQ(notes({}, height), Notes{});
    EXPECT_EQ(count(notes({polar}, height), "`climate.region` has no effect"), 1);

    const std::string horizon = "layer[0].entering=horizon";
    EXPECT_EQ(notes({"tile=true"}), Notes{});
    EXPECT_EQ(notes({horizon}), Notes{});
    EXPECT_EQ(count(notes({"tile=true", horizon}), "layer 'a': `entering` has no effect: in a `tile`"), 1);
    EXPECT_EQ(notes({"tile=true", horizon, "wind=[]"}).size(), 1u);
}

TEST(KeysWithoutEffect, OfLayersWithAnAutomaton) {
    EXPECT_EQ(keys_without_effect(layer_scene("automaton = true\n")), Notes{});
    const Notes notes = keys_without_effect(layer_scene(
        "automaton = true\nshear_s = 60\nlight_absorption = 0.5\n",
        "textures = [\"a.png\"]\nseeds = [{ size_m = [200, 200, 200], billboards = 7 }]\n"));
    EXPECT_EQ(count(notes, "`shear_s` has no effect"), 1);
    EXPECT_EQ(count(notes, "`light_absorption` has no effect: no base model"), 1);
    EXPECT_EQ(count(notes, "base model 'Cu': the numbers, sizes and textures of billboards"), 1);
    EXPECT_EQ(notes.size(), 3u);
}

Scene slab_scene(const std::string& slab, const std::string& more = "") {
    return scene_of("[[layer]]\nname = \"Ci\"\nlattice = { cells = [40, 40, 20] }\nveil = { form = \"cirrus\" }\n" + more +
                    "[layer.slab]\n" + slab);
}

TEST(KeysWithoutEffect, OfTheOtherLightOfASlab) {
    EXPECT_EQ(count(keys_without_effect(slab_scene("light = \"two_samples\"\ng = 0.1\n")), "`g` and `halo`"), 1);
    EXPECT_EQ(count(keys_without_effect(slab_scene("light = \"physical\"\ng = 0.1\n")), "`g` and `halo`"), 0);
    EXPECT_EQ(count(keys_without_effect(slab_scene("light = \"physical\"\n", "[layer.detail]\nenabled = true\n")),
                    "layer 'Ci': [layer.detail] has no effect"),
              1);
}

TEST(KeysWithoutEffect, OfTheGroundAndTheLight) {
    const auto alone = [](const std::string& text, const std::string& note) {
        const Notes notes = keys_without_effect(scene_of(text));
        return notes.size() == 1 && count(notes, note) == 1;
    };
    EXPECT_TRUE(alone("[water]\nwind_m_per_s = 3\n", "[water] has no effect"));
    EXPECT_TRUE(alone("[light]\ndroplet_variance = 0.2\nbows = 0\n", "`light.droplet_variance` has no effect"));
    EXPECT_TRUE(alone("[light]\nlight_distance_m = 300\n", "`light.light_distance_m` has no effect"));
    EXPECT_EQ(keys_without_effect(scene_of("[light]\nlight_distance_m = 300\nlighting = \"cfa\"\n")), Notes{});
    EXPECT_EQ(keys_without_effect(scene_of("[light]\nlight_distance_m = 300\n[[lightning]]\ntime_s = 5\nposition_m = [0, 0, 900]\n")), Notes{});
    EXPECT_TRUE(alone("[precipitation]\nsplashes = 1\nenabled = false\n", "`precipitation.splashes` has no effect"));
    EXPECT_TRUE(alone("[ground]\npattern = \"water\"\n[wet_ground]\nenabled = true\n", "[wet_ground] has no effect"));
}

// With a place and a start, the sun is where it stands there; a height or a place that the scene gives comes first.
TEST(Place, IsWhereTheSunIsSeenFrom) {
    const std::string place =
        "[georeference]\nlatitude_deg = 48\nlongitude_deg = 11\nheading_deg = 30\nstart_utc = \"2024-06-21T11:16:00Z\"\n";
    const Scene scene = scene_of(place);
    EXPECT_EQ(scene.render.sun.date, "2024-06-21");
    EXPECT_TRUE(scene.render.sun.moves);
    const Sun noon = scene_sun_at(scene, 0);
    EXPECT_NEAR(noon.elevation_deg, 90 - 48 + 23.44, 0.1);
    EXPECT_NEAR(noon.azimuth_deg, 180 - 30, 2) << "relative to the scene's y axis";

    EXPECT_TRUE(scene_of(place + "[sun]\nelevation_deg = 20\n").render.sun.date.empty());
    EXPECT_EQ(scene_sun_at(scene_of(place + "[sun]\nelevation_deg = 20\n"), 0).elevation_deg, 20);
    const Scene other = scene_of(place + "[sun]\nlatitude_deg = -48\nlongitude_deg = 11\ndate = \"2024-06-21\"\ntime = \"11:16\"\n");
    EXPECT_EQ(other.render.sun.latitude_deg, -48);
    EXPECT_TRUE(scene_of("[georeference]\nlatitude_deg = 48\nlongitude_deg = 11\n").render.sun.date.empty());
}

}  // namespace
}  // namespace nephos
