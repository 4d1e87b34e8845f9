// SPDX-License-Identifier: Apache-2.0
// The sections of the wind: its profile and its fields.

#include <algorithm>

#include "core/wind.h"
#include "scenes/format/named_files.h"
#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {

using namespace schema_build;

// Infinite heights stand for those of the lattice until finish_scene() knows it.
template <>
const WindField& schema_build::default_element<WindField>() {
    static const WindField field = [] {
        WindField made;
        made.bottom_m = -kForever;
        made.top_m = kForever;
        return made;
    }();
    return field;
}

namespace {

constexpr double kFastest_m_per_s = 1000;

}  // namespace

namespace {

void finish_level(const SectionReader& reader, void* owner) {
    auto& level = *static_cast<WindLevel*>(owner);
    const bool components = reader.find("east_m_per_s") != nullptr || reader.find("north_m_per_s") != nullptr;
    const bool direction = reader.find("from_deg") != nullptr && reader.find("speed_m_per_s") != nullptr;
    if (components && direction) {
        reader.report(
            "from_deg", "the wind of this level is given twice",
            "expected either `east_m_per_s` and `north_m_per_s`, or `from_deg` and `speed_m_per_s`");
    } else if (direction) {
        level.velocity = velocity_from(reader.number("from_deg", 0), reader.number("speed_m_per_s", 0));
    } else if (!components) {
        reader.report("", "this level has no wind",
                      "expected `east_m_per_s` and `north_m_per_s`, or `from_deg` and `speed_m_per_s`");
    }
}

const Section& level_section() {
    constexpr Limits kSpeed = between(-kFastest_m_per_s, kFastest_m_per_s);
    static const Section section{
        "A level of the wind",
        "The wind at a height, by its components or as pilots say it; between levels it is linear, below the "
        "first "
        "and above the last constant.",
        {required(key<&WindLevel::height_m>("height_m", "m", between(-kFarthestPlace_m, kFarthestPlace_m),
                                            "Height of the world, as `ground.height_m` is; levels rise.",
                                            "D, advection")),
         key<&WindLevel::velocity, &Velocity::east_m_per_s>("east_m_per_s", "m/s", kSpeed,
                                                            "Velocity towards east."),
         key<&WindLevel::velocity, &Velocity::north_m_per_s>("north_m_per_s", "m/s", kSpeed,
                                                             "Velocity towards north."),
         together(
             derived_number("from_deg", "deg", between(-360, 360),
                            "Where the wind comes from, clockwise from north: 270 is a west wind. Instead of "
                            "`east_m_per_s` and `north_m_per_s`."),
             {"speed_m_per_s"}),
         together(derived_number("speed_m_per_s", "m/s", between(0, kFastest_m_per_s), "Its speed."),
                  {"from_deg"})},
        &finish_level};
    return section;
}

void finish_wind(const SectionReader& reader, void* owner) {
    const auto& levels = static_cast<const WindKeyframe*>(owner)->levels;
    const Entry* entry = reader.find("levels");
    for (std::size_t n = 1; entry != nullptr && n < levels.size(); ++n) {
        if (levels[n].height_m > levels[n - 1].height_m) continue;
        const Node& item = entry->value.items[n];
        const SectionReader level{reader.document, item, indexed(reader.path + ".levels", n), {}};
        level.report("height_m",
                     level.quoted("height_m") + " is " + number_text(levels[n].height_m) +
                         ", not above the level before it at " + number_text(levels[n - 1].height_m),
                     "expected heights that rise from level to level, in metres");
    }
}

}  // namespace

const Section& wind_section() {
    static const Section section{
        "Wind",
        "The wind, at one or several times: each `[[wind]]` is a profile over height. Between their times "
        "profiles "
        "are mixed linearly. Without any, the air is calm. Cells move by whole cells: after n steps of a "
        "constant wind a layer has moved floor(n * d) cells, d = velocity * `time.step_s` / "
        "`lattice.cell_size_m` (0.3 cells a step: 2 after 9 steps, 3 after 10; -0.3: -3 after 9 and after "
        "10). "
        "d is rounded up to a multiple of 2^-32 cells, so that decimal fractions arrive in time.",
        {key<&WindKeyframe::time_s>("time_s", "s", between(-kLongest_s, kLongest_s),
                                    "Simulated time of this profile; times rise."),
         required(tables<&WindKeyframe::levels>("levels", level_section(), 1, 1000))},
        &finish_wind};
    return section;
}

namespace {

// Keys that say nothing of a field of some kind are errors, not decoration.
void finish_wind_field(const SectionReader& reader, void* owner) {
    const auto& field = *static_cast<const WindField*>(owner);
    const bool grid = field.kind == WindFieldKind::grid;
    const auto refuse = [&](std::initializer_list<const char*> keys, const char* expected) {
        for (const char* key : keys)
            if (reader.find(key) != nullptr)
                reader.report(key, reader.quoted(key) + " has no effect on a wind field of this `kind`", expected);
    };
    if (grid) {
        refuse({"x_m", "y_m", "radius_m", "speed_m_per_s", "direction_deg", "bottom_m", "top_m"},
               "expected `files`, `grid`, `start_s` and `interval_s` alone with kind = \"grid\"");
        if (field.files.empty())
            reader.report("files", reader.quoted("files") + " is missing", "expected the VDB files of kind = \"grid\"");
        if (std::ranges::any_of(field.files, names_no_file))
            reader.report("files", reader.quoted("files") + " has a text that names no file",
                          "expected names of VDB files");
        return;
    }
    refuse({"files", "grid", "start_s", "interval_s"}, "expected these keys with kind = \"grid\" alone");
    if (field.kind == WindFieldKind::thermal || field.kind == WindFieldKind::vortex)
        refuse({"direction_deg"}, "expected a direction of rolls and shear lines alone");
    if (field.bottom_m >= field.top_m)
        reader.report(reader.find("bottom_m") != nullptr ? "bottom_m" : "top_m",
                      reader.quoted("bottom_m") + " = " + number_text(field.bottom_m) + " is not below `top_m` = " +
                          number_text(field.top_m),
                      "expected a field that has a height");
}

}  // namespace

const Section& wind_field_section() {
    constexpr const char* kFields = "D, vector fields";
    constexpr Limits kPlace = between(-kFarthestPlace_m, kFarthestPlace_m);
    constexpr auto of_grid = [](const void* field) {
        return static_cast<const WindField*>(field)->kind == WindFieldKind::grid;
    };
    constexpr auto analytic = [](const void* field) {
        return static_cast<const WindField*>(field)->kind != WindFieldKind::grid;
    };
    constexpr auto directed = [](const void* field) {
        const WindFieldKind kind = static_cast<const WindField*>(field)->kind;
        return kind == WindFieldKind::roll || kind == WindFieldKind::shear_line;
    };
    static const Section section{
        "Wind fields",
        "Wind that differs from place to place, added to the profile of `[[wind]]` in every layer: "
        "circulations in a "
        "formula, none of which has divergence, or velocities from VDB files. Cells, ellipsoids and the "
        "clouds of skies "
        "move with it; the velocity grid of files has it.",
        {required(word<&WindField::kind>("kind", {"thermal", "roll", "shear_line", "vortex", "grid"},
                                         "\"thermal\": a rising core in a ring of sinking air. \"roll\": "
                                         "rolls side by side, alternately rising "
                                         "and sinking. \"shear_line\": two streams of opposite directions "
                                         "beside each other. \"vortex\": a solid "
                                         "turning core, and outside of it 1/r. \"grid\": from `files`.",
                                         kFields)),
         written_if(key<&WindField::x_m>("x_m", "m", kPlace, "A place on its axis or line, east.", kFields),
                    analytic),
         written_if(key<&WindField::y_m>("y_m", "m", kPlace, "The same, north.", kFields), analytic),
         written_if(key<&WindField::radius_m>(
                        "radius_m", "m", above(0, kFarthestPlace_m),
                        "Of a thermal with its ring; of a vortex' core; half the width of a shear "
                        "line; from rising to sinking air of rolls."),
                    analytic),
         written_if(key<&WindField::speed_m_per_s>("speed_m_per_s", "m/s",
                                                   between(-kFastest_m_per_s, kFastest_m_per_s),
                                                   "The largest: upwards in a thermal or roll, at the core's "
                                                   "edge of a vortex, counter-clockwise, "
                                                   "along the left side of a shear line."),
                    analytic),
         written_if(key<&WindField::direction_deg>(
                        "direction_deg", "deg", between(-360, 360),
                        "Of rolls and shear lines: along them, counter-clockwise from east."),
                    directed),
         written_if(default_is(key<&WindField::bottom_m>("bottom_m", "m", kPlace,
                                                         "Height below which there is none of it."),
                               "the bottom of `[lattice]`"),
                    analytic),
         written_if(default_is(key<&WindField::top_m>("top_m", "m", kPlace,
                                                      "Height above which there is none of it."),
                               "the top of `[lattice]`"),
                    analytic),
         written_if(
             default_is(key<&WindField::files>(
                            "files", "", kAny,
                            "VDB files with the velocity in m/s of world space, one after the other in time; "
                            "relative to the scene's folder. Between points and between times it is linear, "
                            "beyond them constant.",
                            kFields),
                        "required with kind = \"grid\""),
             of_grid),
         written_if(
             default_is(key<&WindField::grid>("grid", "", kAny, "Name of their vec3s grid."), "the only one"),
             of_grid),
         written_if(key<&WindField::start_s>("start_s", "s", between(-kLongest_s, kLongest_s),
                                             "Simulated time of the first file."),
                    of_grid),
         written_if(key<&WindField::interval_s>("interval_s", "s", above(0, kLongest_s),
                                                "Simulated time from one file to the next."),
                    of_grid)},
        &finish_wind_field};
    return section;
}

}  // namespace nephos
