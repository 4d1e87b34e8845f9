// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain areas (P, docs/sources.md): ellipses on the ground, (x-x0)^2/a^2 + (y-y0)^2/b^2 = 1 in their own axes,
// with rain where the left side is below 1. They are placed by hand, attached to clouds of a kind, or found
// in the automaton (rain_finder.h); each humidifies the column of air above it and so prolongs the life of
// its cloud.

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "automaton/automaton.h"
#include "seeds/sky_simulation.h"

namespace nephos {

struct RainArea {
    std::uint64_t id = 0;           // of the area in every frame; sources never share ids
    double x_m = 0, y_m = 0;        // centre, world
    double semi_a_m = 1000;         // > 0, along the axis
    double semi_b_m = 1000;         // > 0, across it
    double axis_x = 1, axis_y = 0;  // unit vector of the axis a
    double intensity_mm_per_h = 5;  // in the middle, >= 0
    bool operator==(const RainArea&) const = default;
};

// Returns the left side of the ellipse's equation: 0 at the centre, 1 on the rim. Pure.
double ellipse_value(const RainArea& area, double x_m, double y_m);

// Returns the rain in mm/h at a point: the full intensity in the middle, falling smoothly (3 s^2 - 2 s^3) to
// 0 at the rim over the outer fraction `edge` (0..1) of the radius; with edge = 0 it stops at the rim. Pure.
double rain_at(const RainArea& area, double x_m, double y_m, double edge);

// Returns the strongest rain of all areas at a point.
double rain_at(std::span<const RainArea> areas, double x_m, double y_m, double edge);

// An area placed by the scene.
struct PlacedRain {
    double x_m = 0, y_m = 0;  // centre at time 0
    double semi_a_m = 1000, semi_b_m = 1000;
    double yaw_deg = 0;             // of the axis a, counter-clockwise from east, -360..360
    double intensity_mm_per_h = 5;  // 0..500
    double start_s = 0;             // time at which rain begins
    double end_s = kForever;        // time at which it ends, > start_s
    double fade_s = 0;              // duration of the linear rise and fall of intensity at both ends, >= 0
    bool carried = false;           // drifts with the wind from time 0 on
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

// Returns the areas that rain at a time, in order. `carried`: displacement of the air since time 0
// (SkySimulation::carried()). `layer` makes ids unique among several layers. Throws Error(usage) on areas
// that check() refuses.
std::vector<RainArea> placed_areas(std::span<const PlacedRain> rains, double time_s,
                                   const Displacement& carried, std::uint32_t layer = 0);

// Returns the areas below the clouds of a layer, rule by rule, oldest cloud first, without those of intensity
// 0. Throws Error(usage) on rules that check() refuses and on more than kMaxRainRules of them.
std::vector<RainArea> attached_areas(std::span<const AttachedRain> rains, const SkySimulation& sky);

// Interpolates linearly in time between two lists, matched by id: centre, axes and intensity. An area in only
// one list fades in or out at its place. An area that has wrapped around a periodic side stays as in `from`.
std::vector<RainArea> mix(std::span<const RainArea> from, std::span<const RainArea> to, double fraction);

// The humid column of air above an area.
struct HumidColumn {
    double bottom_m = 0, top_m = 3000;   // world z, bottom < top
    double strength = 1;                 // weight at full intensity and above, 0..1
    double full_intensity_mm_per_h = 5;  // > 0; the weight of weaker rain is proportional to its intensity
    // Without activation: rain lets clouds survive and spread, but starts none.
    Probabilities centre{0.01, 0, 0.05};
    Probabilities rim{0, 0, 0.1};
    bool operator==(const HumidColumn&) const = default;
};

void check(const HumidColumn& column);

// Appends one upright ellipsoid per area, for Automaton::set_external_ellipsoids (coupling.h).
void append_columns(std::vector<ActiveEllipsoid>& out, std::span<const RainArea> areas,
                    const HumidColumn& column);

// The source of a rain area. Bits of its id: 62-63 source, 46-61 layer, 32-45 rule, 0-31 number within it.
enum class RainSource : std::uint32_t { placed = 0, attached = 1, found = 2 };
inline constexpr std::size_t kMaxRainRules = 1 << 14;
constexpr std::uint64_t rain_id(RainSource source, std::uint32_t layer, std::uint32_t rule,
                                std::uint32_t number) {
    return std::uint64_t(source) << 62 | std::uint64_t(layer & 0xffffu) << 46 |
           std::uint64_t(rule & 0x3fffu) << 32 | number;
}

}  // namespace nephos
