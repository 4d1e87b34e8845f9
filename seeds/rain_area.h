// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain areas (P): ellipses on the ground, (x-x0)^2/a^2 + (y-y0)^2/b^2 = 1 in their own axes. It rains where
// the left side is below 1. They are placed by hand, attached to clouds of a kind, or found in the automaton
// (rain_finder.h); each makes the column of air above it more humid, and its cloud longer-lived.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "automaton/automaton.h"
#include "seeds/sky_simulation.h"

namespace nephos {

struct RainArea {
    std::uint64_t id = 0;           // the same area has the same id in every frame; sources never share ids
    double x_m = 0, y_m = 0;        // centre, world
    double semi_a_m = 1000;         // > 0, along the axis
    double semi_b_m = 1000;         // > 0, across it
    double axis_x = 1, axis_y = 0;  // unit vector of the axis a
    double intensity_mm_per_h = 5;  // in the middle, >= 0
    bool operator==(const RainArea&) const = default;
};

// The left side of the ellipse's equation: 0 at the centre, 1 on the rim.
double ellipse_value(const RainArea& area, double x_m, double y_m);

// Rain at a place: the full intensity in the middle, falling smoothly (3 s^2 - 2 s^3) to 0 at the rim over
// the outer `edge` (0..1) of the way from centre to rim; with edge = 0 it stops at the rim.
double rain_at(const RainArea& area, double x_m, double y_m, double edge);

// The strongest rain of all areas at a place.
double rain_at(std::span<const RainArea> areas, double x_m, double y_m, double edge);

// An area that the scene sets.
struct PlacedRain {
    double x_m = 0, y_m = 0;  // centre at time 0
    double semi_a_m = 1000, semi_b_m = 1000;
    double yaw_deg = 0;             // of the axis a, counter-clockwise from east, -360..360
    double intensity_mm_per_h = 5;  // 0..500
    double start_s = 0;             // it rains from here
    double end_s = kForever;        // to here, > start_s
    double fade_s = 0;              // of which at both ends the intensity rises or falls linearly, >= 0
    bool carried = false;           // has drifted with the wind since time 0
    bool operator==(const PlacedRain&) const = default;
};

// An area below every cloud of a kind: the ellipse in its bounding box.
struct AttachedRain {
    std::optional<std::size_t> model{};  // only clouds of this base model
    std::optional<Genus> genus{};        // only clouds of this genus
    Range state{0, 1};                   // only clouds whose sky has its state in here
    double size_scale = 1;               // of the ellipse, > 0
    double intensity_mm_per_h = 5;  // of a whole cloud, 0..500; times its phase while it forms or dissolves
    bool operator==(const AttachedRain&) const = default;
};

// Throws Error(usage) on values outside the ranges above.
void check(const PlacedRain& rain);
void check(const AttachedRain& rain);

// Those that rain at a time, in order; throws Error(usage) on bad ones. `carried`: how far the air has moved
// since time 0 (SkySimulation::carried()). `layer` makes ids unique among several layers.
std::vector<RainArea> placed_areas(std::span<const PlacedRain> rains, double time_s,
                                   const Displacement& carried, std::uint32_t layer = 0);

// Those below the clouds of a layer, rule by rule, oldest cloud first, without those of intensity 0.
// Throws Error(usage) on bad rules and on more than kMaxRainRules of them.
std::vector<RainArea> attached_areas(std::span<const AttachedRain> rains, const SkySimulation& sky);

// The areas at `fraction` of the way from those of one moment to those of a later one, matched by their ids:
// centre, axes and intensity change linearly; what is only in one list fades in or out where it is. Areas
// that are not where they could have moved (they went through a periodic side) stand as in the first list.
std::vector<RainArea> mix(std::span<const RainArea> from, std::span<const RainArea> to, double fraction);

// The humid column above an area.
struct HumidColumn {
    double bottom_m = 0, top_m = 3000;   // world z, bottom < top
    double strength = 1;                 // weight at full intensity and above, 0..1
    double full_intensity_mm_per_h = 5;  // > 0; less rain, proportionately less weight
    // No activation: rain keeps clouds alive and lets them spread, but starts none.
    Probabilities centre{0.01, 0, 0.05};
    Probabilities rim{0, 0, 0.1};
    bool operator==(const HumidColumn&) const = default;
};

void check(const HumidColumn& column);

// One upright ellipsoid an area, for Automaton::set_external_ellipsoids (coupling.h).
void append_columns(std::vector<ActiveEllipsoid>& out, std::span<const RainArea> areas,
                    const HumidColumn& column);

// Where an id comes from: bits 62-63 source, 46-61 layer, 32-45 rule, 0-31 number within it.
enum class RainSource : std::uint32_t { placed = 0, attached = 1, found = 2 };
inline constexpr std::size_t kMaxRainRules = 1 << 14;
constexpr std::uint64_t rain_id(RainSource source, std::uint32_t layer, std::uint32_t rule,
                                std::uint32_t number) {
    return std::uint64_t(source) << 62 | std::uint64_t(layer & 0xffffu) << 46 |
           std::uint64_t(rule & 0x3fffu) << 32 | number;
}

}  // namespace nephos
