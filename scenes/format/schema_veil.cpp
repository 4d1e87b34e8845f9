// SPDX-License-Identifier: Apache-2.0
// The section of procedural veils (density/veil.h).

#include <array>

#include "density/veil.h"
#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"

namespace nephos {

using namespace schema_build;

namespace {

constexpr double kLargest_m = 1e7;
const char* const kSource = "S, eq. 4-6";

const Section& octave_section() {
    constexpr Limits kFactor = between(-100, 100);
    static const Section section{
        "Octaves of a veil",
        "Octaves of noise one by one, instead of by powers. Vectors are along the fibres, across them, up.",
        {key<&VeilOctave::wavelength_m>("wavelength_m", "m", above(0, kLargest_m),
                                        "Size of its features, at least two cells.", kSource),
         key<&VeilOctave::weight>("weight", "", between(-1000, 1000), "Its share of the sum.", kSource),
         key<&VeilOctave::velocity_m_per_s>("velocity_m_per_s", "m/s", between(-1000, 1000),
                                            "Its velocity relative to the wind: octaves that slide over "
                                            "each other make the veil change its form.",
                                            kSource),
         key<&VeilOctave::displacement_m>(
             "displacement_m", "m", between(-1e6, 1e6),
             "How far its points are displaced, per value of the octave before; of `cirrus` and "
             "`cirrostratus`.",
             "S, eq. 6"),
         key<&VeilOctave::gain>("gain", "", kFactor, "Factor of its noise, which lies about -0.4..0.4.",
                                kSource),
         key<&VeilOctave::offset>("offset", "", kFactor, "What is added to that.", kSource),
         key<&VeilOctave::ridge>("ridge", "", kFactor, "Its value on the ridges of the form `cumulus`.",
                                 kSource),
         key<&VeilOctave::crest>("crest", "", kFactor, "The value of the noise where these ridges lie.",
                                 kSource)},
        nullptr};
    return section;
}

const Section& area_section() {
    static const Section section{
        "Area of a veil",
        "The ellipse above which there is a veil: an anvil, a patch of cirrocumulus. Without it the veil "
        "covers its "
        "lattice.",
        {key<&VeilArea::x_m>("x_m", "m", between(-kLargest_m, kLargest_m), "Centre, east, at the start."),
         key<&VeilArea::y_m>("y_m", "m", between(-kLargest_m, kLargest_m), "Centre, north, at the start."),
         key<&VeilArea::semi_a_m>("semi_a_m", "m", or_infinite(above(0, 0)), "Semi-axis along `yaw_deg`."),
         key<&VeilArea::semi_b_m>("semi_b_m", "m", or_infinite(above(0, 0)), "Semi-axis across it."),
         key<&VeilArea::yaw_deg>("yaw_deg", "deg", between(-360, 360),
                                 "Direction of the first semi-axis, counter-clockwise from east."),
         key<&VeilArea::softness>(
             "softness", "", between(0, 1),
             "Fraction of the radius over which the density falls to 0 at the rim: 1 begins "
             "at the centre, 0 cuts."),
         key<&VeilArea::carried>(
             "carried", "", kAny,
             "Whether it moves with the wind at `top_m`; otherwise it stands, as an anvil does "
             "above the tower that feeds it.")},
        nullptr};
    return section;
}

bool by_powers(const void* owner) { return static_cast<const VeilOptions*>(owner)->octaves.empty(); }

// A key that octaves given one by one replace.
Key of_powers(Key key) {
    key.written = &by_powers;
    return key;
}

constexpr std::array kPowers{"octaves", "wavelength_m", "lacunarity",   "persistence",
                             "stretch", "stretch_up",   "displacement", "evolution_m_per_s"};

void finish_veil(const SectionReader& reader, void* owner) {
    const auto& veil = *static_cast<const VeilOptions*>(owner);
    if (!veil.octaves.empty()) {
        for (const char* const name : kPowers) {
            if (reader.find(name) == nullptr) continue;
            reader.report(name,
                          reader.quoted(name) + " and " + reader.quoted("octave") + " exclude each other",
                          "expected octaves by powers, or one by one");
        }
    }
}

std::vector<Key> pattern_keys() {
    return {word<&VeilOptions::form>("form", {"cumulus", "stratus", "cirrus", "cirrostratus"},
                                     "Which noise: `stratus` plain, `cumulus` ridged, `cirrostratus` plain "
                                     "and displaced by itself, `cirrus` ridged "
                                     "and displaced.",
                                     kSource),
            of_powers(key<&VeilOptions::octave_count>("octaves", "", between(1, 12), "Number of octaves.",
                                                      kSource)),
            of_powers(key<&VeilOptions::wavelength_m>("wavelength_m", "m", above(0, kLargest_m),
                                                      "Size of the largest features, across the fibres.",
                                                      kSource)),
            of_powers(key<&VeilOptions::lacunarity>(
                "lacunarity", "", between(1, 8),
                "How many times smaller the features of the next octave are.", kSource)),
            of_powers(key<&VeilOptions::persistence>(
                "persistence", "", Limits{.min = 0, .max = 1, .above_min = true, .below_max = true},
                "Weight of an octave per weight of the one before.", kSource)),
            of_powers(key<&VeilOptions::stretch>("stretch", "", between(0.01, 1000),
                                                 "Length of features along the fibres per width.")),
            of_powers(key<&VeilOptions::stretch_up>("stretch_up", "", between(0.01, 1000),
                                                    "Height of features per width.")),
            of_powers(key<&VeilOptions::displacement>(
                "displacement", "", between(0, 10),
                "How far points are displaced across the fibres, in wavelengths per value of the octave "
                "before: bends fibres.",
                "S, eq. 6")),
            of_powers(key<&VeilOptions::evolution_m_per_s>(
                "evolution_m_per_s", "m/s", between(0, 1000),
                "Speed of the first octave relative to the wind; each further one has 0.8 of it, in another "
                "direction.",
                kSource)),
            tables<&VeilOptions::octaves>("octave", octave_section(), 0, 12)};
}

}  // namespace

const Section& veil_section() {
    static const Section section = [] {
        std::vector<Key> keys = pattern_keys();
        constexpr Limits kHeight = between(-1e6, 1e6);
        const auto add = [&](Key key) { keys.push_back(std::move(key)); };
        add(default_is(
            key<&VeilOptions::direction_deg>("direction_deg", "deg", between(-360, 360),
                                             "Where the fibres point, counter-clockwise from east."),
            "downwind at `top_m` at the start"));
        add(key<&VeilOptions::coverage>("coverage", "", above(0, 1),
                                        "Fraction of a level of the sky where there is a veil."));
        add(key<&VeilOptions::softness>(
            "softness", "", between(0, 1),
            "Fraction of what is covered over which the density rises from 0 to 1: small, hard edges."));
        add(key<&VeilOptions::sheet>("sheet", "", between(0, 1),
                                     "Density everywhere in the layer, below that of the pattern."));
        add(default_is(
            key<&VeilOptions::base_m>("base_m", "m", kHeight, "Height above which there is a veil."),
            "the middle of the heights of the layer's `genus`, without it the bottom of the layer's lattice"));
        add(default_is(key<&VeilOptions::top_m>("top_m", "m", kHeight,
                                                "Height below which there is a veil; the wind at this height "
                                                "carries it."),
                       "the top of the layer's lattice"));
        add(key<&VeilOptions::soft_base_m>("soft_base_m", "m", between(0, 1e6),
                                           "Height over which density fades in above `base_m`."));
        add(key<&VeilOptions::soft_top_m>("soft_top_m", "m", between(0, 1e6),
                                          "Height over which it fades out below `top_m`."));
        add(key<&VeilOptions::fallstreak_m>(
            "fallstreak_m", "m", between(-1e6, 1e6),
            "How far falling ice trails behind at `base_m`: the hooks of cirrus, parabolas."));
        add(key<&VeilOptions::margin_m>(
            "margin_m", "m", between(0, kLargest_m),
            "Width along the sides of the lattice over which the veil fades, lest it end like a carpet."));
        add(table<&VeilOptions::area>("area", area_section(), area_section().effect));
        return Section{
            "Veil of a layer",
            "A layer whose density is octave noise instead of an automaton's: for high, thin, wide "
            "sheets. Such a layer has no skies and no clouds; its lattice says where it is written "
            "and drawn (docs/veils.md).",
            std::move(keys), &finish_veil};
    }();
    return section;
}

}  // namespace nephos
