// SPDX-License-Identifier: Apache-2.0
// The sections that decide the bits: lattice, time and field.

#include <algorithm>

#include "automaton/air_parcels.h"
#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {

using namespace schema_build;

// Parcels as large as those of fair-weather cumulus. Infinite ranges of the centre stand for the whole
// lattice until finish_scene() knows it.
template <>
const EllipsoidScatter& schema_build::default_element<EllipsoidScatter>() {
    static const EllipsoidScatter scatter = [] {
        EllipsoidScatter made;
        made.x_m = made.y_m = made.z_m = {-kForever, kForever};
        made.semi_axis_x_m = made.semi_axis_y_m = {400, 900};
        made.semi_axis_z_m = {200, 500};
        made.yaw_deg = {0, 180};
        return made;
    }();
    return scatter;
}

namespace {

const std::vector<std::string_view> kBoundaryWords{"open", "periodic"};

void check_fades(const SectionReader& reader, double fades_s, double life_s) {
    if (fades_s <= life_s) return;
    const char* at = reader.find("fade_out_s") != nullptr ? "fade_out_s" : "fade_in_s";
    reader.report(at,
                  "fading in and out takes " + number_text(fades_s) + " s, longer than the life of " +
                      number_text(life_s) + " s",
                  "expected `fade_in_s` + `fade_out_s` <= `life_s`");
}

void finish_ellipsoid(const SectionReader& reader, void* owner) {
    const auto& ellipsoid = *static_cast<const Ellipsoid*>(owner);
    check_fades(reader, ellipsoid.fade_in_s + ellipsoid.fade_out_s, ellipsoid.life_s);
}

void finish_scatter(const SectionReader& reader, void* owner) {
    const auto& scatter = *static_cast<const EllipsoidScatter*>(owner);
    const bool plume = scatter.thermals.interval_s > 0;
    check_fades(reader, scatter.fade_in_s + scatter.fade_out_s,
                plume ? scatter.thermals.life_s : scatter.life_s.min);
    if (plume && scatter.thermals.life_s > scatter.life_s.min)
        reader.report("thermals",
                      "thermals live " + number_text(scatter.thermals.life_s) +
                          " s, longer than the shortest plume with " + number_text(scatter.life_s.min) + " s",
                      "expected `thermals.life_s` <= `life_s`");
}

const char* const kCentreEffect =
    "Probabilities at the centre, as `[field.background]`; towards the rim they change smoothly.";
const char* const kRimEffect =
    "Probabilities at the rim, as `[field.background]`. They take effect where they exceed the background's "
    "`hum` "
    "and `act` or stay below its `ext`: with a higher `ext`, the background's holds from inside the rim on.";
const char* const kCarriedEffect =
    "Whether it moves with the wind at its centre's height; otherwise it stands still.";

// The effect of a size of ellipsoids, with the limit that periodic axes set.
std::string with_periodic_reach(const char* effect) {
    return effect + (" Along a periodic axis of the lattice an ellipsoid reaches at most " +
                     number_text(kMaxPeriodicReach) + " times the length of that axis from its centre.");
}

void finish_thermals(const SectionReader& reader, void* owner) {
    const auto& plume = *static_cast<const ThermalPlume*>(owner);
    if (!(plume.interval_s > 0) || thermals_at_once(plume) <= kMaxThermalsAtOnce) return;
    reader.report(
        "interval_s", "a plume has " + number_text(thermals_at_once(plume)) + " thermals at the same time",
        "expected at most " + number_text(kMaxThermalsAtOnce) + ": a longer interval or a shorter life");
}

const Section& thermals_section() {
    constexpr const char* kBubbles = "Scorer and Ludlam 1953";
    static const Section section{
        "Plumes of thermals",
        "Makes each ellipsoid the base of a plume: thermals as high as it leave it one after the other, "
        "rise, slow "
        "down, lean with the shear of the wind, and die. `fade_in_s` and `fade_out_s` are those of each of "
        "them (those of a plume that entered from upwind come at full strength, as it did), the "
        "scatter's `life_s` is the plume's. With its centre on the bottom of the lattice, the condensation "
        "level, the "
        "base is flat: nothing is born below it.",
        {required(key<&ThermalPlume::interval_s>("interval_s", "s", between(0.001, kLongest_s),
                                                 "Time from one release to the next.", kBubbles)),
         key<&ThermalPlume::life_s>(
             "life_s", "s", between(0.001, kLongest_s),
             "Life of a thermal; at most the shortest of the plume. The last one dies with it."),
         key<&ThermalPlume::rise_m>(
             "rise_m", "m", between(0, kFarthestPlace_m),
             "Height that a thermal gains in its life, drawn for each plume. It starts with twice "
             "its mean speed and comes to rest.",
             kBubbles),
         key<&ThermalPlume::width>("width", "", between(0.05, 1),
                                   "Width of a thermal at its release, in widths of the ellipsoid."),
         key<&ThermalPlume::spread>(
             "spread", "", between(-1, 1),
             "Growth of the radius per metre risen: 0.25 in air of neutral stability; below 0 "
             "towers taper, as in dry air, which evaporates their rims.",
             "Scorer 1957, Woodward 1959"),
         key<&ThermalPlume::variety>(
             "variety", "", between(0, 0.9),
             "Size and rise of a thermal are drawn between 1 less this and 1 of the plume's."),
         key<&ThermalPlume::wander>(
             "wander", "", between(0, 10),
             "How far from the plume's axis thermals are released, in its semi-axes: turrets "
             "beside each other.")},
        &finish_thermals};
    return section;
}

}  // namespace

const Section& ellipsoid_section() {
    static const Section section{
        "An ellipsoid placed by hand",
        "Parcels of humid air, placed by hand: inside, clouds are born and live longer. Of all that "
        "overlap, and of the background, the larger `hum` and `act` and the smaller `ext` count.",
        {required(key<&Ellipsoid::centre_m>("centre_m", "m", between(-kFarthestPlace_m, kFarthestPlace_m),
                                            "Centre at its birth, or at time 0 if `birth_s` is below 0: "
                                            "east, north, height.",
                                            "D, control of motion")),
         key<&Ellipsoid::semi_axes_m>("semi_axes_m", "m", above(0, kFarthestPlace_m),
                                      with_periodic_reach("Half of its length, width and height, before the "
                                                          "turn by `yaw_deg`.")),
         key<&Ellipsoid::yaw_deg>("yaw_deg", "deg", between(-360, 360),
                                  "Turn about the vertical, counter-clockwise seen from above."),
         table<&Ellipsoid::centre>("centre", probabilities_section(), kCentreEffect),
         table<&Ellipsoid::rim>("rim", probabilities_section(), kRimEffect),
         key<&Ellipsoid::birth_s>(
             "birth_s", "s", between(-kLongest_s, kLongest_s),
             "Simulated time at which it appears; before 0: it is there from the start."),
         key<&Ellipsoid::life_s>("life_s", "s", or_infinite(above(0, 0)),
                                 "Time until it is gone, fades included."),
         key<&Ellipsoid::fade_in_s>("fade_in_s", "s", between(0, kLongest_s),
                                    "Time in which it comes to full strength."),
         key<&Ellipsoid::fade_out_s>("fade_out_s", "s", between(0, kLongest_s),
                                     "Time in which it vanishes at the end of its life."),
         key<&Ellipsoid::carried>("carried", "", kAny, kCarriedEffect, "D, control of motion")},
        &finish_ellipsoid};
    return section;
}

const Section& scatter_section() {
    Key thermals = default_is(
        table<&EllipsoidScatter::thermals>("thermals", thermals_section(), thermals_section().effect),
        "none: ellipsoids that stay at their height");
    thermals.written = [](const void* scatter) {
        return is_plume(*static_cast<const EllipsoidScatter*>(scatter));
    };
    static const Section section{
        "Ellipsoids at random",
        "Parcels of humid air, drawn at random from the scene's seed. Each value is drawn uniformly from its "
        "range.",
        {required(key<&EllipsoidScatter::count>(
             "count", "", between(0, 100'000),
             "Their number: at any time with `replace`, otherwise in total.", "D, control of motion")),
         default_is(key<&EllipsoidScatter::x_m>("x_m", "m", between(-kFarthestPlace_m, kFarthestPlace_m),
                                                "Where centres are drawn, east."),
                    "the whole lattice"),
         default_is(key<&EllipsoidScatter::y_m>("y_m", "m", between(-kFarthestPlace_m, kFarthestPlace_m),
                                                "Where centres are drawn, north."),
                    "the whole lattice"),
         default_is(key<&EllipsoidScatter::z_m>("z_m", "m", between(-kFarthestPlace_m, kFarthestPlace_m),
                                                "Where centres are drawn, height."),
                    "the whole lattice"),
         key<&EllipsoidScatter::semi_axis_x_m>(
             "semi_axis_x_m", "m", above(0, kFarthestPlace_m),
             with_periodic_reach("Half of the length, before the turn by `yaw_deg`.")),
         key<&EllipsoidScatter::semi_axis_y_m>("semi_axis_y_m", "m", above(0, kFarthestPlace_m),
                                               with_periodic_reach("Half of the width.")),
         key<&EllipsoidScatter::semi_axis_z_m>("semi_axis_z_m", "m", above(0, kFarthestPlace_m),
                                               with_periodic_reach("Half of the height.")),
         key<&EllipsoidScatter::yaw_deg>("yaw_deg", "deg", between(-360, 360),
                                         "Turn about the vertical, counter-clockwise seen from above."),
         table<&EllipsoidScatter::centre>("centre", probabilities_section(), kCentreEffect),
         table<&EllipsoidScatter::rim>("rim", probabilities_section(), kRimEffect),
         key<&EllipsoidScatter::birth_s>(
             "birth_s", "s", between(-kLongest_s, kLongest_s),
             "Simulated time at which each appears; before 0: it is there from the start."),
         key<&EllipsoidScatter::life_s>("life_s", "s", or_infinite(above(0, 0)),
                                        "Time until each is gone, fades included."),
         key<&EllipsoidScatter::fade_in_s>("fade_in_s", "s", between(0, kLongest_s),
                                           "Time in which each comes to full strength."),
         key<&EllipsoidScatter::fade_out_s>("fade_out_s", "s", between(0, kLongest_s),
                                            "Time in which each vanishes at the end of its life."),
         key<&EllipsoidScatter::carried>("carried", "", kAny, kCarriedEffect, "D, control of motion"),
         key<&EllipsoidScatter::replace>(
             "replace", "", kAny,
             "Whether a new one is drawn for each that left the lattice (upwind) or died "
             "(anywhere), so that their number stays the same."),
         std::move(thermals)},
        &finish_scatter};
    return section;
}

const Section& probabilities_section() {
    static const Section section{
        "Probabilities",
        "How likely vapour, activation and extinction are in a cell and step.",
        {key<&Probabilities::hum>("hum", "per step", between(0, 1),
                                  "Probability that a cell without vapour gets some.",
                                  "D, extinction and birth"),
         key<&Probabilities::act>("act", "per step", between(0, 1),
                                  "Probability that a cell is activated, the start of a cloud.",
                                  "D, extinction and birth"),
         key<&Probabilities::ext>("ext", "per step", between(0, 1), "Probability that a cloud cell dies.",
                                  "D, extinction and birth")},
        nullptr};
    return section;
}

namespace {

const Section& background_level_section() {
    static const Section section{"A level of the background",
                                 "The background at a height; between levels it is linear, below the first "
                                 "and above the last constant.",
                                 {required(key<&BackgroundLevel::height_m>(
                                      "height_m", "m", between(-kFarthestPlace_m, kFarthestPlace_m),
                                      "Height of the world; levels rise.")),
                                  key<&BackgroundLevel::background, &Probabilities::hum>(
                                      "hum", "per step", between(0, 1), "As `field.background.hum`, there."),
                                  key<&BackgroundLevel::background, &Probabilities::act>(
                                      "act", "per step", between(0, 1), "As `field.background.act`, there."),
                                  key<&BackgroundLevel::background, &Probabilities::ext>(
                                      "ext", "per step", between(0, 1), "As `field.background.ext`, there.")},
                                 nullptr};
    return section;
}

void finish_background_keyframe(const SectionReader& reader, void* owner) {
    const auto& levels = static_cast<const BackgroundKeyframe*>(owner)->levels;
    const Entry* entry = reader.find("levels");
    for (std::size_t n = 1; entry != nullptr && n < levels.size(); ++n) {
        if (levels[n].height_m > levels[n - 1].height_m) continue;
        const SectionReader level = reader.item("levels", n);
        level.report("height_m",
                     level.quoted("height_m") + " is " + number_text(levels[n].height_m) +
                         ", not above the level before it at " + number_text(levels[n - 1].height_m),
                     "expected heights that rise from level to level, in metres");
    }
}

const Section& probability_grid_section() {
    static const Section section{
        "Probabilities from files",
        "One probability of the background in each cell, from a VDB file: linear between its points, beyond them constant. "
        "It comes before the profile and the constant background.",
        {required(word<&ProbabilityGrid::of>("of", {"hum", "act", "ext"}, "Which probability; each at most once.")),
         required(key<&ProbabilityGrid::file>("file", "", kAny,
                                              "The VDB file; its values are probabilities, 0 to 1. Relative to the scene's "
                                              "folder.")),
         default_is(key<&ProbabilityGrid::grid>("grid", "", kAny, "Name of its float grid."), "the only one")},
        nullptr};
    return section;
}

void finish_field(const SectionReader& reader, void* owner) {
    const FieldOptions& field = static_cast<const Scene*>(owner)->automaton.field;
    check_profile_times(reader, field.profile);
    for (std::size_t n = 0; n < field.grids.size(); ++n) {
        const auto first = std::ranges::find(field.grids, field.grids[n].of, &ProbabilityGrid::of);
        if (first == field.grids.begin() + std::ptrdiff_t(n)) continue;
        const SectionReader item = reader.item("grids", n);
        item.report("of", item.quoted("of") + " has a file already", "expected one file for a probability");
    }
}

}  // namespace

const Section& background_profile_section() {
    static const Section section{
        "Background by height and time",
        "The background at one or several times, each a profile over height: mixed linearly between their times, constant "
        "before the first and after the last. Instead of the constant background; ellipsoids that fade in or out then come "
        "from no effect instead of from it.",
        {key<&BackgroundKeyframe::time_s>("time_s", "s", between(-kLongest_s, kLongest_s),
                                          "Simulated time of this profile; times rise."),
         required(tables<&BackgroundKeyframe::levels>("levels", background_level_section(), 1, 1000))},
        &finish_background_keyframe};
    return section;
}

void check_profile_times(const SectionReader& owner, const std::vector<BackgroundKeyframe>& profile) {
    for (std::size_t n = 1; n < profile.size(); ++n) {
        if (profile[n].time_s > profile[n - 1].time_s) continue;
        const SectionReader item{owner.document, owner.find("profile")->value.items[n],
                                 indexed(owner.path + ".profile", n), {}};
        item.report("time_s",
                    item.quoted("time_s") + " is " + number_text(profile[n].time_s) +
                        ", not after the profile before it at " + number_text(profile[n - 1].time_s),
                    "expected times that rise from profile to profile, in seconds");
    }
}

const Section& field_section() {
    static const Section section{
        "Probability field",
        "How likely vapour, activation and extinction are: the same everywhere, plus ellipsoids of humid "
        "air. In a scene with layers these ellipsoids act in the lattice of every layer, beside its own.",
        {table<&Scene::automaton, &AutomatonOptions::field, &FieldOptions::background>(
             "background", probabilities_section(),
             "Probabilities everywhere. Inside ellipsoids the background counts as well: the larger `hum` "
             "and "
             "`act` and the smaller `ext` of both."),
         tables<&Scene::automaton, &AutomatonOptions::field, &FieldOptions::profile>(
             "profile", background_profile_section(), 0, 10'000),
         tables<&Scene::automaton, &AutomatonOptions::field, &FieldOptions::grids>("grids", probability_grid_section(),
                                                                                   0, 3),
         tables<&Scene::automaton, &AutomatonOptions::field, &FieldOptions::ellipsoids>(
             "ellipsoids", ellipsoid_section(), 0, 100'000),
         tables<&Scene::automaton, &AutomatonOptions::field, &FieldOptions::scatters>(
             "scatters", scatter_section(), 0, 1000)},
        &finish_field};
    return section;
}

const Section& lattice_section() {
    Key boundaries = key<&Scene::automaton, &AutomatonOptions::boundaries>(
        "boundaries", "", kAny,
        "What lies beyond the box along east, north and up: nothing (open), or the box again (periodic).",
        "D, advection");
    boundaries.words = kBoundaryWords;
    static const Section section{
        "Lattice",
        "The box of cells.",
        {key<&Scene::automaton, &AutomatonOptions::extent>(
             "cells", "cells", between(1, kMaxExtent),
             "Number of cells towards east, north and up. Memory and time grow with their product.", "D"),
         key<&Scene::automaton, &AutomatonOptions::placement, &Placement::cell_size_m>(
             "cell_size_m", "m", between(0.01, 1e5), "Edge of a cubic cell."),
         key<&Scene::automaton, &AutomatonOptions::placement, &Placement::origin_m>(
             "origin_m", "m", between(-kFarthestPlace_m, kFarthestPlace_m),
             "Where the lower south-west corner of the box stands; its third number is the height of the "
             "lowest clouds."),
         boundaries,
         replaced(word<&Scene::automaton, &AutomatonOptions::initial>(
                      "initial", {"empty", "field"},
                      "How the box starts: without any vapour or cloud, or with vapour and activation drawn "
                      "from the field at time 0; in a layer that field is its background and its clouds and "
                      "rain.",
                      "D"),
                  "initial_state"),
         default_is(
             key<&Scene::initial_state_file>(
                 "initial_state", "", kAny,
                 "A VDB file whose bool grids `hum`, `act` and `cld` are the start, instead of `initial`; "
                 "relative to the scene's folder. Its cells, their size and its place are those of the "
                 "lattice."),
             "none")},
        nullptr};
    return section;
}

const Section& time_section() {
    static const Section section{"Time",
                                 "The simulation's length.",
                                 {key<&Scene::automaton, &AutomatonOptions::time_step_s>(
                                      "step_s", "s", above(0, 86'400),
                                      "Simulated time of one step: a larger one makes clouds change faster."),
                                  key<&Scene::steps>("steps", "", between(0, 1e9), "Number of steps.")},
                                 nullptr};
    return section;
}

}  // namespace nephos
