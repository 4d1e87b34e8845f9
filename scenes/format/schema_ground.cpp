// SPDX-License-Identifier: Apache-2.0
// The sections of water, terrain, and of wet and snowy ground: how much lies there over time, and how it looks.

#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"

namespace nephos {

using namespace schema_build;

namespace {

template <auto... Members>
Key cover_key(std::string name, std::string unit, Limits limits, std::string effect,
              std::string source = {}) {
    return key<&Scene::ground_cover, Members...>(std::move(name), std::move(unit), limits, std::move(effect),
                                                 std::move(source));
}

template <auto... Members>
Key look_key(std::string name, std::string unit, Limits limits, std::string effect, std::string source = {}) {
    return key<&Scene::render, &RenderOptions::wet_ground, Members...>(
        std::move(name), std::move(unit), limits, std::move(effect), std::move(source));
}

template <auto... Members>
Key terrain_key(std::string name, std::string unit, Limits limits, std::string effect, std::string source = {}) {
    return key<&Scene::render, &RenderOptions::terrain, Members...>(std::move(name), std::move(unit), limits,
                                                                    std::move(effect), std::move(source));
}

using Cover = GroundCoverOptions;
using Look = WetGroundOptions;

// Keys of the balance of water and snow.
std::vector<Key> cover_keys() {
    return {
        cover_key<&Cover::enabled>("enabled", "", kAny,
                                   "Whether rain areas wet the ground; false: it is dry for ever.",
                                   "S, wetness"),
        cover_key<&Cover::initial_water_mm>("initial_water_mm", "mm", between(0, 100),
                                            "Film of water everywhere at the start."),
        cover_key<&Cover::initial_snow_mm>("initial_snow_mm", "mm", between(0, 1000),
                                           "Snow everywhere at the start, as the water that it holds."),
        cover_key<&Cover::capacity_mm>(
            "capacity_mm", "mm", between(0.01, 100),
            "Film that hollows can hold: the nearer to it, the more of what falls runs off.",
            "Linsley, Kohler and Paulhus 1949"),
        cover_key<&Cover::drying_s>("drying_s", "s", or_infinite(above(0, 0)),
                                    "Time in which a film dries to 1/e."),
        cover_key<&Cover::melting_mm_per_h>("melting_mm_per_h", "mm/h", between(0, 100),
                                            "Rate at which snow melts, as water; 0: it is freezing."),
        cover_key<&Cover::edge>("edge", "", between(0, 1),
                                "Outer share of a rain area over which its rain falls off to nothing.", "P"),
        cover_key<&Cover::fall_speed_m_per_s>(
            "fall_speed_m_per_s", "m/s", or_infinite(above(0, 0)),
            "Speed of drops on their way down from the clouds' base, during which the wind carries them: "
            "about 6.5 for rain, 1 for snow; inf: straight down.",
            "Atlas, Srivastava and Sekhon 1973 (drops of 2 mm)"),
        cover_key<&Cover::texels>("texels", "texels", between(2, 1024),
                                  "Side of the map of water and snow; larger is sharper."),
        cover_key<&Cover::margin>("margin", "", between(0, 10),
                                  "By how much of the world's size the map reaches beyond it on each side.")};
}

std::vector<Key> look_keys() {
    return {
        look_key<&Look::soaking_mm>(
            "soaking_mm", "mm", between(1e-3, 100),
            "Film at which the ground has gone 1 - 1/e of the way from dry to soaked, which is darker.",
            "Lekner and Dorf 1988"),
        look_key<&Look::puddle_film_mm>("puddle_film_mm", "mm", between(1e-3, 100),
                                        "Film at which half of the ground is under water."),
        look_key<&Look::puddle_size_m>("puddle_size_m", "m", between(0.1, 1000),
                                       "Size of the largest puddles."),
        look_key<&Look::reflection>(
            "reflection", "", between(0, 1),
            "Strength of the reflection of sky and clouds; 0: none, and no second view is drawn.",
            "S, wetness"),
        look_key<&Look::reflection_scale>("reflection_scale", "", between(0.1, 1),
                                          "Resolution of the mirrored view relative to the picture."),
        look_key<&Look::sheen>("sheen", "", between(0, 1),
                               "How much wet ground that is not under water reflects, relative to water."),
        look_key<&Look::ripples>("ripples", "", between(0, 10),
                                 "Height of the rings that drops make in puddles; 0: still water.",
                                 "S, ripples"),
        look_key<&Look::snow_cover_mm>("snow_cover_mm", "mm", between(1e-3, 1000),
                                       "Snow, as water, that covers half of the ground."),
        look_key<&Look::snow_albedo>("snow_albedo", "", between(0, 1),
                                     "Fraction of the light that snow reflects: red, green, blue.",
                                     "Wiscombe and Warren 1980")};
}

}  // namespace

const Section& water_section() {
    static const Section section{
        "Water",
        "Waves of a ground of water (`ground.pattern = \"water\"`): they tilt what it mirrors and draw the sun's glint "
        "out. `wet_ground.reflection` and `reflection_scale` are those of the mirrored sky and clouds.",
        {key<&Scene::render, &RenderOptions::water, &WaterOptions::wind_m_per_s>(
             "wind_m_per_s", "m/s", between(0, 25),
             "Wind 10 m above the water, for so long that waves have grown as far as they do; 0: a still mirror.",
             "Cox and Munk 1954; Pierson and Moskowitz 1964"),
         key<&Scene::render, &RenderOptions::water, &WaterOptions::from_deg>(
             "from_deg", "deg", between(0, 360), "Whence it blows, clockwise from north."),
         key<&Scene::render, &RenderOptions::water, &WaterOptions::whitecaps>(
             "whitecaps", "", between(0, 10), "Foam, as a multiple of what belongs to the wind; 0: none.",
             "Monahan and O'Muircheartaigh 1980; Koepke 1984")},
        nullptr};
    return section;
}

const Section& terrain_section() {
    using T = TerrainOptions;
    static const Section section{
        "Terrain",
        "Ground that is not level (`ground.height_map`, `ground.relief`): where it lies, how high it is, and what covers it. It "
        "stands on the plane of `ground`, which is seen where it is higher. See docs/ground.md.",
        {terrain_key<&T::x_m>("x_m", "m", between(-1e7, 1e7), "World position of its middle."),
         terrain_key<&T::y_m>("y_m", "m", between(-1e7, 1e7), "Likewise."),
         terrain_key<&T::width_m>("width_m", "m", between(10, 1e6), "Its size from west to east."),
         terrain_key<&T::length_m>("length_m", "m", between(10, 1e6), "Its size from south to north."),
         terrain_key<&T::height_scale_m>(
             "height_scale_m", "m", between(0, 20000),
             "Height of the number 65535 of a PNG or raw file above that of 0; of relief: of its highest summit above its "
             "deepest valley. Without effect on EXR, whose numbers are metres."),
         terrain_key<&T::offset_m>("offset_m", "m", between(-1e5, 1e5),
                                   "World height of the number 0; added to the metres of EXR."),
         terrain_key<&T::edge>("edge", "", between(0, 0.5),
                               "Outer share of its sides over which it goes down to `ground.height_m`; 0: it ends as it is."),
         terrain_key<&T::raw_columns>("raw_columns", "", between(0, 4096),
                                      "Numbers in a row of a raw file, which does not say it."),
         terrain_key<&T::raw_rows>("raw_rows", "", between(0, 4096), "Rows of a raw file."),
         terrain_key<&T::cells>("cells", "", between(16, 4096), "Heights of relief along its longer side; more is finer."),
         terrain_key<&T::feature_m>("feature_m", "m", between(100, 1e5), "Distance between large summits of relief.",
                                    "Ebert et al. 2003, chapter 16"),
         seed_key<&Scene::render, &RenderOptions::terrain, &T::seed>("seed", "Of relief: another number, another country."),
         terrain_key<&T::rock_slope_deg>("rock_slope_deg", "deg", between(0, 90),
                                         "Slope from about which on rock is bare; 90: nowhere."),
         terrain_key<&T::rock_albedo>("rock_albedo", "", between(0, 1),
                                      "Fraction of the light that rock reflects: red, green, blue."),
         terrain_key<&T::snow_line_m>(
             "snow_line_m", "m", or_infinite(between(-1e5, 1e5)),
             "World height from about which on snow lies all year: lower in hollows and towards the north, higher on crests, "
             "never on walls; inf: none.")},
        nullptr};
    return section;
}

const Section& wet_ground_section() {
    static const Section section = [] {
        std::vector<Key> keys = cover_keys();
        for (Key& key : look_keys()) keys.push_back(std::move(key));
        return Section{
            "Wet and snowy ground",
            "Water and snow on the ground: rain areas wet it over time, it dries, darkens, mirrors "
            "sky and clouds, and turns white.",
            std::move(keys),
            nullptr,
            {{"precipitation", "precipitation.kind"}, {"kind", "precipitation.kind"}}};
    }();
    return section;
}

}  // namespace nephos
