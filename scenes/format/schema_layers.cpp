// SPDX-License-Identifier: Apache-2.0
// The sections of climate and layers.

#include <algorithm>

#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"
#include "seeds/climate.h"

namespace nephos {

using namespace schema_build;

namespace {

constexpr Limits kIntensity = between(0, 500);

const char* const kCentreEffect = "Probabilities at the centre, as `[field.background]`.";
const char* const kRimEffect =
    "Probabilities at the rim, as `[field.background]`. They take effect where they exceed the background's "
    "`hum` "
    "and `act` or stay below its `ext`: with a higher `ext`, the background's holds from inside the rim on.";

const Section& point_section() {
    static const Section section{
        "Points of a schedule",
        "States at times; between them it changes linearly, before the first and after the last it is "
        "constant.",
        {required(key<&StatePoint::time_s>("time_s", "s", between(-kLongest_s, kLongest_s),
                                           "Simulated time; times rise.")),
         required(
             key<&StatePoint::state>("state", "", between(0, 1), "The state: 0 clear, 1 storm.", "T, 3.4"))},
        nullptr};
    return section;
}

// The keys that give a schedule, and how they are put together.
template <auto Schedule>
std::vector<Key> schedule_keys() {
    return {replaced(derived_number("initial_state", "", between(0, 1),
                                    "State at the start: 0 clear, 1 storm. Alone: the state never changes."),
                     "schedule"),
            together(derived_number("final_state", "", between(0, 1), "State at the end of `duration_s`."),
                     {"duration_s"}),
            together(derived_number("duration_s", "s", between(0, kLongest_s),
                                    "Time in which the state goes from `initial_state` to `final_state`."),
                     {"final_state"}),
            tables<Schedule>("schedule", point_section(), 0, 10'000)};
}

template <auto Schedule>
void finish_schedule(const SectionReader& reader, void* owner) {
    using Owner = typename MemberOf<decltype(Schedule)>::owner_type;
    std::vector<StatePoint>& schedule = static_cast<Owner*>(owner)->*Schedule;
    const bool straight = reader.find("initial_state") != nullptr || reader.find("final_state") != nullptr;
    if (straight && !schedule.empty()) {
        reader.report("schedule", "the states are given twice",
                      "expected either `initial_state`, `final_state` and `duration_s`, or `schedule`");
    } else if (straight) {
        const double initial = reader.number("initial_state", 0);
        schedule =
            straight_schedule(initial, reader.number("final_state", initial), reader.number("duration_s", 0));
    }
    for (std::size_t n = 1; n < schedule.size(); ++n) {
        if (schedule[n].time_s > schedule[n - 1].time_s) continue;
        const SectionReader point{reader.document,
                                  reader.find("schedule")->value.items[n],
                                  indexed(reader.path + ".schedule", n),
                                  {}};
        point.report("time_s",
                     point.quoted("time_s") + " is " + number_text(schedule[n].time_s) +
                         ", not after the point before it at " + number_text(schedule[n - 1].time_s),
                     "expected times that rise from point to point, in seconds");
    }
}

const Section& layer_climate_section() {
    static const Section section{
        "Climate of a layer", "States of this layer alone, instead of those of `[climate]`.",
        schedule_keys<&LayerOptions::schedule>(), &finish_schedule<&LayerOptions::schedule>};
    return section;
}

bool of_clouds(const void* owner) { return !static_cast<const LayerOptions*>(owner)->is_veil; }
bool of_veils(const void* owner) { return static_cast<const LayerOptions*>(owner)->is_veil; }

// A key that means something only in a layer of clouds, or only in a veil.
Key written_if(bool (*condition)(const void*), Key key) {
    key.written = condition;
    return key;
}

const Section& layer_lattice_section() {
    const std::string same = "that of `[lattice]`";
    Key boundaries = key<&LayerOptions::boundaries>(
        "boundaries", "", kAny, "What lies beyond the box: nothing (open), or the box again (periodic).",
        "D, advection");
    boundaries.words = {"open", "periodic"};
    static const Section section{
        "Lattice of a layer",
        "The box of cells of this layer; the rectangle that it covers is the world in which the layer's "
        "clouds live. "
        "Keys that are missing are those of `[lattice]`.",
        {default_is(key<&LayerOptions::extent>("cells", "cells", between(1, kMaxExtent),
                                               "Number of cells towards east, north and up.", "D"),
                    same),
         default_is(key<&LayerOptions::placement, &Placement::cell_size_m>(
                        "cell_size_m", "m", between(0.01, 1e5), "Edge of a cubic cell."),
                    same),
         default_is(key<&LayerOptions::placement, &Placement::origin_m>(
                        "origin_m", "m", between(-kFarthestPlace_m, kFarthestPlace_m),
                        "Where the lower south-west corner of the box stands."),
                    same),
         written_if(&of_clouds, default_is(boundaries, same)),
         default_is(
             key<&LayerOptions::initial_state_file>(
                 "initial_state", "", kAny,
                 "A VDB file whose bool grids `hum`, `act` and `cld` are the start of this layer (`nephos "
                 "state --layer` writes one); relative to the scene's folder. Its cells, their size and its "
                 "place are those of the layer's lattice."),
             "none: by `lattice.initial`")},
        nullptr};
    return section;
}

const Section& genus_coupling_section() {
    static const Section section{
        "Coupling of a genus",
        "Other probabilities for the clouds of one genus, so that dark Ns and bright Cu of one layer obey rules of their "
        "own; `model.centre` and `model.rim` come before them.",
        {required(genus_word<&GenusCoupling::genus>("genus", "Whose clouds; \"none\": of base models without genus.")),
         table<&GenusCoupling::centre>("centre", probabilities_section(), kCentreEffect),
         table<&GenusCoupling::rim>("rim", probabilities_section(), kRimEffect)},
        nullptr};
    return section;
}

void finish_coupling(const SectionReader& reader, void* owner) {
    const std::vector<GenusCoupling>& genera = static_cast<const CouplingOptions*>(owner)->genera;
    for (std::size_t n = 0; n < genera.size(); ++n) {
        const auto first = std::ranges::find(genera, genera[n].genus, &GenusCoupling::genus);
        if (first == genera.begin() + std::ptrdiff_t(n)) continue;
        const SectionReader item{reader.document, reader.find("genera")->value.items[n],
                                 indexed(reader.path + ".genera", n), {}};
        item.report("genus", item.quoted("genus") + " has a table already", "expected one table for a genus");
    }
}

const Section& coupling_section() {
    static const Section section{
        "Coupling",
        "How strongly the layer's clouds drive its automaton: every box of a cloud becomes an ellipsoid of "
        "the "
        "probability field, as strong as its seed and as far as the cloud has formed.",
        {key<&CouplingOptions::strength>("strength", "", between(0, 1),
                                         "Weight of whole boxes; 0: clouds do not touch the automaton."),
         key<&CouplingOptions::size_scale>(
             "size_scale", "", between(1e-3, 1e3),
             "Semi-axes per half of a box's edges: 1 fits the ellipsoid into the box, "
             "1.24 gives it the box's volume, 1.73 puts the box's corners on its rim."),
         default_is(key<&CouplingOptions::min_semi_axis_m>(
                        "min_semi_axis_m", "m", between(0, 1e6),
                        "Semi-axes are at least this: boxes smaller than a cell would fall between cells."),
                    "the layer's cell size"),
         key<&CouplingOptions::size_at_birth>(
             "size_at_birth", "", between(0, 1),
             "Size of an ellipsoid when its box begins to form, as a fraction."),
         table<&CouplingOptions::centre>("centre", probabilities_section(), kCentreEffect),
         table<&CouplingOptions::rim>("rim", probabilities_section(), kRimEffect),
         tables<&CouplingOptions::genera>("genera", genus_coupling_section(), 0, kGenusCount + 1)},
        &finish_coupling};
    return section;
}

void finish_placed(const SectionReader& reader, void* owner) {
    const auto& rain = *static_cast<const PlacedRain*>(owner);
    if (rain.end_s > rain.start_s) return;
    reader.report("end_s",
                  reader.quoted("end_s") + " is " + number_text(rain.end_s) + ", not after the start at " +
                      number_text(rain.start_s),
                  "expected an end after `start_s`");
}

const Section& placed_section() {
    constexpr Limits kPlace = between(-kFarthestPlace_m, kFarthestPlace_m);
    static const Section section{
        "Rain placed by hand",
        "Ellipses on the ground in which it rains.",
        {required(key<&PlacedRain::x_m>("x_m", "m", kPlace, "Centre at time 0, east.", "P")),
         required(key<&PlacedRain::y_m>("y_m", "m", kPlace, "Centre at time 0, north.", "P")),
         key<&PlacedRain::semi_a_m>("semi_a_m", "m", above(0, kFarthestPlace_m), "Semi-axis along `yaw_deg`.",
                                    "P"),
         key<&PlacedRain::semi_b_m>("semi_b_m", "m", above(0, kFarthestPlace_m), "Semi-axis across it.", "P"),
         key<&PlacedRain::yaw_deg>("yaw_deg", "deg", between(-360, 360),
                                   "Direction of the first axis, counter-clockwise from east."),
         key<&PlacedRain::intensity_mm_per_h>("intensity_mm_per_h", "mm/h", kIntensity,
                                              "Rain in the middle."),
         key<&PlacedRain::start_s>("start_s", "s", between(-kLongest_s, kLongest_s), "It rains from here."),
         key<&PlacedRain::end_s>("end_s", "s", or_infinite(between(-kLongest_s, kLongest_s)),
                                 "It rains to here."),
         key<&PlacedRain::fade_s>("fade_s", "s", between(0, kLongest_s),
                                  "Time in which it sets in after the start and stops before the end."),
         key<&PlacedRain::carried>("carried", "", kAny,
                                   "Whether it drifts with the wind at the clouds' bases.")},
        &finish_placed};
    return section;
}

const Section& attached_section() {
    static const Section section{
        "Rain below clouds",
        "Rain below every cloud of a kind, in the ellipse that fits its bounding box; all conditions must "
        "hold.",
        {default_is(key<&AttachedRainRule::model>("model", "", kAny, "Only below clouds of this base model."),
                    "any"),
         default_is(genus_word<&AttachedRainRule::genus>("genus", "Only below clouds of this genus."), "any"),
         key<&AttachedRainRule::state>("state", "", between(0, 1),
                                       "Only below clouds of skies whose state lies in here."),
         key<&AttachedRainRule::size_scale>("size_scale", "", above(0, 1000), "Size of the ellipse."),
         key<&AttachedRainRule::intensity_mm_per_h>(
             "intensity_mm_per_h", "mm/h", kIntensity,
             "Rain of a whole cloud; less while it forms or dissolves.")},
        nullptr};
    return section;
}

void finish_finder(const SectionReader& reader, void* owner) {
    const auto& finder = *static_cast<const RainFinderOptions*>(owner);
    const auto below = [&](const char* lower, double low, const char* higher, double high) {
        if (low <= high) return;
        reader.report(lower,
                      reader.quoted(lower) + " is " + number_text(low) + ", above " + reader.quoted(higher) +
                          " = " + number_text(high),
                      "expected the lower one to be at most the higher");
    };
    below("keep_water_m", finder.keep_water_m, "start_water_m", finder.start_water_m);
    below("report_until_mm_per_h", finder.report_until_mm_per_h, "report_from_mm_per_h",
          finder.report_from_mm_per_h);
}

const Section& finder_section() {
    constexpr Limits kWater = above(0, 1e6);
    constexpr Limits kTime = between(0, kLongest_s);
    static const Section section{
        "Rain found in the automaton",
        "Columns with much water, joined to patches and fitted by ellipses. Two thresholds at each decision "
        "keep "
        "areas from flickering.",
        {key<&RainFinderOptions::start_water_m>("start_water_m", "m", kWater,
                                                "Height of cloud in a column from which it rains."),
         key<&RainFinderOptions::keep_water_m>(
             "keep_water_m", "m", kWater, "Height above which it goes on raining; at most `start_water_m`."),
         key<&RainFinderOptions::smooth_columns>("smooth_columns", "cells", between(0, 64),
                                                 "Reach of the square over which columns are averaged."),
         key<&RainFinderOptions::min_area_m2>("min_area_m2", "m2", between(0, 1e15),
                                              "Smaller patches do not count."),
         key<&RainFinderOptions::max_areas>("max_areas", "", between(1, 4096),
                                            "Only this many of the largest count."),
         key<&RainFinderOptions::mm_per_h_per_m>("mm_per_h_per_m", "mm/h per m", above(0, 1000),
                                                 "Rain per metre of cloud in the columns of a patch."),
         key<&RainFinderOptions::max_mm_per_h>("max_mm_per_h", "mm/h", above(0, 500), "The strongest rain."),
         key<&RainFinderOptions::respond_s>("respond_s", "s", kTime,
                                            "Time constant with which an area follows its patch."),
         key<&RainFinderOptions::fade_s>("fade_s", "s", kTime,
                                         "Time constant with which an area without patch fades."),
         key<&RainFinderOptions::report_from_mm_per_h>("report_from_mm_per_h", "mm/h", above(0, 500),
                                                       "An area is listed once it reaches this."),
         key<&RainFinderOptions::report_until_mm_per_h>("report_until_mm_per_h", "mm/h", above(0, 500),
                                                        "And until it falls below this.")},
        &finish_finder};
    return section;
}

const Section& presence_section() {
    static const Section section{
        "Presence of a veil",
        "How much of a veil there is by the state of the atmosphere (`[climate]`), linear between these states and "
        "constant beyond them: sheets that come and go with the weather.",
        {required(key<&VeilPresence::state>("state", "", between(0, 1), "The state; states rise.")),
         required(key<&VeilPresence::fraction>("fraction", "", between(0, 1),
                                               "Of the layer's `opacity`: 0 there is none, 1 the whole veil."))},
        nullptr};
    return section;
}

const Section& column_section() {
    constexpr Limits kHeight = between(-kFarthestPlace_m, kFarthestPlace_m);
    static const Section section{
        "Humid column",
        "The air above a rain area: humid, so that its cloud lives longer.",
        {default_is(key<&HumidColumn::bottom_m>("bottom_m", "m", kHeight, "Its lower end."),
                    "the bottom of the layer's lattice"),
         default_is(key<&HumidColumn::top_m>("top_m", "m", kHeight, "Its upper end."),
                    "the top of the layer's lattice"),
         key<&HumidColumn::strength>("strength", "", between(0, 1),
                                     "Its weight at full intensity; 0: rain does not touch the automaton."),
         key<&HumidColumn::full_intensity_mm_per_h>(
             "full_intensity_mm_per_h", "mm/h", above(0, 500),
             "Intensity of full strength; less rain has proportionately less."),
         table<&HumidColumn::centre>("centre", probabilities_section(), kCentreEffect),
         table<&HumidColumn::rim>("rim", probabilities_section(), kRimEffect)},
        nullptr};
    return section;
}

const Section& rain_section() {
    static const Section section{
        "Rain",
        "Rain areas of this layer: placed by hand, attached to clouds, or found in the automaton. Every "
        "frame lists "
        "them in manifest.json.",
        {tables<&LayerRain::placed>("placed", placed_section(), 0, 10'000),
         tables<&LayerRain::attached>("attached", attached_section(), 0, int(kMaxRainRules)),
         key<&LayerRain::find>("find", "", kAny, "Whether rain is also found in the automaton."),
         table<&LayerRain::finder>("finder", finder_section(), "How it is found."),
         table<&LayerRain::column>("column", column_section(), "Humid air above every rain area.")},
        nullptr};
    return section;
}

void finish_metamorphosis(const SectionReader& reader, void* owner) {
    const auto& change = *static_cast<const NamedMetamorphosis*>(owner);
    if (change.state.min < change.state.max) return;
    reader.report("state", reader.quoted("state") + " is " + number_text(change.state.min) + " alone",
                  "expected a range of states in which clouds change, such as [0.4, 0.8]");
}

const Section& metamorphosis_section() {
    static const Section section{
        "Change of genus",
        "Clouds of one base model turn into those of another while the state of the atmosphere crosses a range, and back "
        "when it falls: the boxes of the first go from the edges inwards, those of the second come from the centre "
        "outwards, each with its model's probabilities. Each cloud changes over half of the range, at a state of its own.",
        {required(key<&NamedMetamorphosis::from>("from", "", kAny, "Base model that changes; each at most once.", "T, 5")),
         required(key<&NamedMetamorphosis::to>("to", "", kAny, "Base model that it becomes; this one may change on.",
                                               "T, 5")),
         key<&NamedMetamorphosis::state>("state", "", between(0, 1), "States between which it happens.")},
        &finish_metamorphosis};
    return section;
}

void finish_layer(const SectionReader& reader, void* owner) {
    auto& layer = *static_cast<LayerOptions*>(owner);
    layer.is_veil = reader.find("veil") != nullptr;
    if (layer.is_veil) layer.automaton = false;
    layer.own_detail = reader.find("detail") != nullptr;
    layer.is_slab = reader.find("slab") != nullptr;
}

}  // namespace

const Section& climate_section() {
    static const Section section = [] {
        std::vector<Key> keys = schedule_keys<&ClimateOptions::schedule>();
        keys.insert(keys.begin(),
                    word<&ClimateOptions::region>("region", {"tropical", "temperate", "polar"},
                                                  "Where on Earth: the heights of `layer.genus`.", "T, 2"));
        return Section{
            "Climate",
            "The state of the atmosphere over time, for all layers that say nothing else. Without it the "
            "state is 0.",
            std::move(keys), &finish_schedule<&ClimateOptions::schedule>};
    }();
    return section;
}

const Section& layer_section() {
    static const Section section = [] {
        Key genus = plain_key(
            KeyKind::word, "genus", {}, {},
            "Instead of `base_height_m`: the heights of this genus in `climate.region` above "
            "`ground.height_m`, as far as they lie in the lattice. The base of a veil is their middle if "
            "it has no `base_m`, and so is the bottom of its lattice if that has no `origin_m`. "
            "Exports of weather call the layer so.",
            "T, 2");
        for (const GenusFacts& facts : genera()) genus.words.push_back(facts.abbreviation);
        Section layers{
            "Layers",
            "Layers of clouds, simulated together: each has its own lattice, skies and wind, or is a veil. "
            "The field of each comes from its clouds, its own ellipsoids and those of `[field]`.",
            {required(key<&LayerOptions::name>("name", "", kAny,
                                               "Part of its files' names: letters, digits, `-` and `_`.")),
             default_is(key<&LayerOptions::skies>("skies", "", kAny, "Names of its skies.", "T, 3.4"),
                        "required without `veil`"),
             key<&LayerOptions::automaton>(
                 "automaton", "", kAny,
                 "Whether its clouds drive an automaton; otherwise they are drawn directly, "
                 "as billboards, and there is no density.",
                 "T"),
             key<&LayerOptions::opacity>("opacity", "", above(0, 1),
                                         "Factor of its density: below 1 for thin, translucent clouds."),
             group("lattice", layer_lattice_section()),
             default_is(table<&LayerOptions::background>(
                            "background", probabilities_section(),
                            "Probabilities everywhere, inside clouds' ellipsoids as well; keys that "
                            "are missing are those of `[field.background]`."),
                        "that of `[field.background]`"),
             default_is(tables<&LayerOptions::profile>("profile", background_profile_section(), 0, 10'000),
                        "that of `[field]`, in a layer without `background`"),
             tables<&LayerOptions::ellipsoids>("ellipsoids", ellipsoid_section(), 0, 100'000),
             tables<&LayerOptions::scatters>("scatters", scatter_section(), 0, 1000),
             default_is(key<&LayerOptions::base_height_m>("base_height_m", "m", between(-1e5, 1e5),
                                                          "Height of clouds' bases, drawn for each.", "T, 2"),
                        "by `genus`"),
             replaced(std::move(genus), "base_height_m"),
             tables<&LayerOptions::wind, &Wind::keyframes>("wind", wind_section(), 0, 10'000),
             group("climate", layer_climate_section()),
             key<&LayerOptions::formation_s>("formation_s", "s", between(0, kLongest_s),
                                             "Time in which a cloud forms, from its centre outwards.",
                                             "T, formation (Wang)"),
             key<&LayerOptions::dissolution_s>("dissolution_s", "s", between(0, kLongest_s),
                                               "Time in which it dissolves, from its edges inwards.",
                                               "T, formation (Wang)"),
             key<&LayerOptions::formation_softness>(
                 "formation_softness", "", between(1e-3, 1e3),
                 "How gently one box appears: small, one after the other; large, "
                 "all together."),
             default_is(key<&LayerOptions::cross_edges_whole>(
                            "cross_edges_whole", "", kAny,
                            "Whether clouds cross the world's edge whole; otherwise they form "
                            "while they enter and dissolve once they have left."),
                        "that of `automaton`: clouds that are drawn directly can be seen beyond the edge"),
             word<&LayerOptions::entering>(
                 "entering", {"anywhere", "horizon"},
                 "How the number of clouds follows the state. \"anywhere\": in every step, so that missing "
                 "clouds form and surplus ones dissolve inside. \"horizon\": new clouds enter upwind, as "
                 "densely as the state asks for, and those that are there stay until they leave; in calm "
                 "air nothing changes.",
                 "T, 3.4"),
             tables<&LayerOptions::metamorphoses>("metamorphoses", metamorphosis_section(), 0, 1000),
             key<&LayerOptions::shear_s>("shear_s", "s", between(0, 1e6),
                                         "Time over which billboards of clouds that are drawn directly lean "
                                         "with the wind's shear: at another "
                                         "height than the cloud's centre by the difference of the winds "
                                         "times this. Clouds of an automaton are "
                                         "sheared by its wind.",
                                         "T, 5"),
             table<&LayerOptions::coupling>("coupling", coupling_section(), coupling_section().effect),
             key<&LayerOptions::light_absorption>(
                 "light_absorption", "", between(0, 1),
                 "How much of the absorption of light that `model.light_distance_m` means the voxels of its "
                 "automaton "
                 "have; 0: none.",
                 "T, CFA"),
             table<&LayerOptions::rain>("rain", rain_section(), rain_section().effect),
             default_is(table<&LayerOptions::detail>("detail", detail_section(), detail_section().effect),
                        "that of `[detail]`; a veil has none"),
             written_if(&of_veils,
                        tables<&LayerOptions::presence>("presence", presence_section(), 0, 10'000)),
             written_if(&of_veils, table<&LayerOptions::veil>("veil", veil_section(), veil_section().effect)),
             default_is(
                 written_if(
                     [](const void* owner) { return static_cast<const LayerOptions*>(owner)->is_slab; },
                     table<&LayerOptions::slab>("slab", slab_section(), slab_section().effect)),
                 "none: the lattice is drawn")},
            &finish_layer};
        for (Key& key : layers.keys) {
            if (std::ranges::find(keys_of_clouds(), key.name) != keys_of_clouds().end()) {
                key.written = &of_clouds;
            }
            if (key.name == "entering")
                key.written = [](const void* owner) {
                    const auto& layer = *static_cast<const LayerOptions*>(owner);
                    return !layer.is_veil && layer.entering != Entering::anywhere;
                };
            if (key.name == "shear_s")
                key.written = [](const void* owner) {
                    const auto& layer = *static_cast<const LayerOptions*>(owner);
                    return !layer.is_veil && layer.shear_s != 0;
                };
            if (key.name == "light_absorption")
                key.written = [](const void* owner) {
                    const auto& layer = *static_cast<const LayerOptions*>(owner);
                    return !layer.is_veil && layer.light_absorption != 1;
                };
            if (key.name == "detail")
                key.written = [](const void* owner) { return static_cast<const LayerOptions*>(owner)->own_detail; };
        }
        return layers;
    }();
    return section;
}

std::span<const std::string_view> keys_of_clouds() {
    static constexpr std::string_view kKeys[] = {
        "skies",    "automaton",     "background",    "base_height_m",
        "climate",  "formation_s",   "dissolution_s", "formation_softness", "cross_edges_whole",
        "coupling", "rain",          "scatters",      "ellipsoids",         "profile",
        "entering", "metamorphoses", "shear_s",       "light_absorption"};
    return kKeys;
}

Key model_files_key() {
    return default_is(
        plain_key(KeyKind::texts, "models", {}, {},
                  "Other scene files whose `[[model]]` tables are taken, before those of this scene; "
                  "relative to the scene's folder.",
                  {}),
        "none");
}

}  // namespace nephos
