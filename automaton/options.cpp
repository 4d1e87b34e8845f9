// SPDX-License-Identifier: Apache-2.0
#include "automaton/options.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include <glm/common.hpp>

#include "automaton/air_parcels.h"
#include "automaton/grid_values.h"
#include "core/error.h"
#include "core/text.h"

namespace nephos {
namespace {

void require(bool good, const std::string& message) {
    if (!good) throw Error(ErrorCode::usage, message);
}

std::string number(double value) { return number_text(value, 6); }

// The name of a value, put together only for a message: thousands of ellipsoids may be checked in every step.
struct Name {
    std::string_view base, part;
    Name(std::string_view of, std::string_view its = {}) : base(of), part(its) {}
    Name(const std::string& whole) : base(whole) {}
    Name(const char* whole) : base(whole) {}
    std::string text() const { return std::string(base).append(part); }
};

[[noreturn]] void refuse(const Name& name, const std::string& why) {
    throw Error(ErrorCode::usage, name.text() + why);
}

void require_finite(double value, const Name& name) {
    if (!std::isfinite(value)) refuse(name, " = " + number(value) + ": expected a finite number");
}

void check(const Probabilities& p, const Name& name) {
    const auto one = [&](double value, const char* part) {
        if (value >= 0 && value <= 1) return;
        refuse(name, std::string(part) + " = " + number(value) + ": expected 0..1");
    };
    one(p.hum, ".hum");
    one(p.act, ".act");
    one(p.ext, ".ext");
}

void check(const Range& r, const std::string& name) {
    require(r.min <= r.max, name + " = " + number(r.min) + ".." + number(r.max) + ": expected min <= max");
    require(r.min == r.max || (std::isfinite(r.min) && std::isfinite(r.max)),
            name + ": expected finite numbers");
}

void check_life(double birth_s, double life_s, double fade_in_s, double fade_out_s, std::string_view name) {
    require_finite(birth_s, {name, ".birth_s"});
    if (!(life_s > 0)) refuse({name, ".life_s"}, " = " + number(life_s) + ": expected > 0 s");
    const auto fade = [&](double value, const char* part) {
        if (!(value >= 0 && std::isfinite(value))) refuse({name, part}, ": expected a finite number >= 0 s");
    };
    fade(fade_in_s, ".fade_in_s");
    fade(fade_out_s, ".fade_out_s");
}

void check_semi_axis(double semi_axis_m, const Name& name) {
    if (!(semi_axis_m > 0 && std::isfinite(semi_axis_m)))
        refuse(name, " = " + number(semi_axis_m) + ": expected a finite number > 0 m");
}

void check_periodic_reach(const Vec3& reach, const AutomatonOptions& o, const Name& name) {
    constexpr const char* kAxes[] = {"x", "y", "z"};
    const Vec3 largest = largest_reach_m(o.extent, o.placement.cell_size_m, o.boundaries);
    for (int axis = 0; axis < 3; ++axis) {
        if (reach[axis] <= largest[axis]) continue;
        refuse(name, " reaches " + number(reach[axis]) + " m from its centre along the periodic axis " +
                         kAxes[axis] + ": expected at most " + number(largest[axis]) + " m, " +
                         number(kMaxPeriodicReach) + " times that axis");
    }
}

void check(const ThermalPlume& p, const Range& life_s, const std::string& name) {
    const auto check_number = [&](double value, double low, double high, const char* part) {
        if (!(value >= low && value <= high))
            refuse({name, part}, " = " + number(value) + ": expected " + number(low) + " to " + number(high));
    };
    check_number(p.interval_s, 0.001, 1e9, ".interval_s");
    check_number(p.life_s, 0.001, life_s.min, ".life_s");
    check(p.rise_m, name + ".rise_m");
    check_number(p.rise_m.min, 0, 1e7, ".rise_m");
    check_number(p.width, 0.05, 1, ".width");
    check_number(p.spread, -1, 1, ".spread");
    check_number(p.variety, 0, 0.9, ".variety");
    check_number(p.wander, 0, 10, ".wander");
    check_number(thermals_at_once(p), 1, kMaxThermalsAtOnce, ": thermals at once");
}

void check(const EllipsoidScatter& s, const AutomatonOptions& o, const std::string& name) {
    constexpr int kMaxCount = 100000;
    require(s.count >= 0 && s.count <= kMaxCount,
            name + ".count = " + std::to_string(s.count) + ": expected 0..100000");
    check(s.x_m, name + ".x_m");
    check(s.y_m, name + ".y_m");
    check(s.z_m, name + ".z_m");
    check(s.semi_axis_x_m, name + ".semi_axis_x_m");
    check(s.semi_axis_y_m, name + ".semi_axis_y_m");
    check(s.semi_axis_z_m, name + ".semi_axis_z_m");
    check(s.yaw_deg, name + ".yaw_deg");
    check(s.birth_s, name + ".birth_s");
    check(s.life_s, name + ".life_s");
    for (bool largest : {false, true}) {  // both ends of every range make a valid ellipsoid
        const auto end = [&](const Range& r) { return largest ? r.max : r.min; };
        nephos::check(
            Ellipsoid{.centre_m = {end(s.x_m), end(s.y_m), end(s.z_m)},
                      .semi_axes_m = {end(s.semi_axis_x_m), end(s.semi_axis_y_m), end(s.semi_axis_z_m)},
                      .yaw_deg = end(s.yaw_deg),
                      .centre = s.centre,
                      .rim = s.rim,
                      .birth_s = end(s.birth_s),
                      .life_s = end(s.life_s),
                      .fade_in_s = s.fade_in_s,
                      .fade_out_s = s.fade_out_s},
            o, name);
    }
    if (is_plume(s)) check(s.thermals, s.life_s, name + ".thermals");
    check_periodic_reach(reach_m(s), o, name);
}

void check(const Wind& wind, const AutomatonOptions& o) {
    for (std::size_t i = 0; i < wind.keyframes.size(); ++i) {
        const WindKeyframe& key = wind.keyframes[i];
        const std::string name = "wind[" + std::to_string(i) + "]";
        require_finite(key.time_s, name + ".time_s");
        require(i == 0 || key.time_s > wind.keyframes[i - 1].time_s, name + ".time_s: expected rising times");
        require(!key.levels.empty(), name + ".levels: expected at least one level");
        for (std::size_t l = 0; l < key.levels.size(); ++l) {
            const WindLevel& level = key.levels[l];
            const std::string level_name = name + ".levels[" + std::to_string(l) + "]";
            require_finite(level.height_m, level_name + ".height_m");
            require_finite(level.velocity.east_m_per_s, level_name + ".east_m_per_s");
            require_finite(level.velocity.north_m_per_s, level_name + ".north_m_per_s");
            require(l == 0 || level.height_m > key.levels[l - 1].height_m,
                    level_name + ".height_m: expected rising heights");
            // Linear mixing never exceeds the values it mixes: this covers every height and time.
            const double fastest = std::max(std::abs(level.velocity.east_m_per_s),
                                            std::abs(level.velocity.north_m_per_s)),
                         cells = fastest * o.time_step_s / o.placement.cell_size_m;
            require(cells <= kMaxCellsOfStep, level_name + ": the wind moves the air by " + number(cells) +
                                                  " cells in one step; at most 2^24 are possible");
        }
    }
    check(wind.fields);
}

void check_profile(const std::vector<BackgroundKeyframe>& profile) {
    for (std::size_t i = 0; i < profile.size(); ++i) {
        const std::string name = "field.profile[" + std::to_string(i) + "]";
        require_finite(profile[i].time_s, name + ".time_s");
        require(i == 0 || profile[i].time_s > profile[i - 1].time_s, name + ".time_s: expected rising times");
        require(!profile[i].levels.empty(), name + ".levels: expected at least one level");
        for (std::size_t l = 0; l < profile[i].levels.size(); ++l) {
            const BackgroundLevel& level = profile[i].levels[l];
            const std::string level_name = name + ".levels[" + std::to_string(l) + "]";
            require_finite(level.height_m, level_name + ".height_m");
            require(l == 0 || level.height_m > profile[i].levels[l - 1].height_m,
                    level_name + ".height_m: expected rising heights");
            check(level.background, level_name);
        }
    }
}

void check_grids(const std::vector<ProbabilityGrid>& grids) {
    for (std::size_t n = 0; n < grids.size(); ++n) {
        const std::string name = "field.grids[" + std::to_string(n) + "]";
        for (std::size_t m = 0; m < n; ++m)
            require(grids[m].of != grids[n].of, name + ".of: there is a grid of this probability already");
        check(grids[n]);
    }
}

// Images of one ellipsoid around the periodic axes, itself included (BlockField visits as many).
double images_of(const Vec3& reach_m, const AutomatonOptions& o) {
    const double cell = o.placement.cell_size_m;
    const auto along = [](Boundary boundary, double half_size_cells, int extent) {
        return boundary == Boundary::periodic ? 2 * std::ceil(half_size_cells / extent) + 1 : 1;
    };
    return along(o.boundaries.x, reach_m.x / cell, o.extent.x) *
           along(o.boundaries.y, reach_m.y / cell, o.extent.y) *
           along(o.boundaries.z, reach_m.z / cell, o.extent.z);
}

}  // namespace

void check(const ProbabilityGrid& grid) {
    if (!grid.samples) return;
    for (const float value : grid.samples->values)
        require(value >= 0 && value <= 1, (grid.file ? grid.file->string() : std::string("the grid")) +
                                              ": has the value " + number(value) + ": expected probabilities 0..1");
}

Vec3 largest_reach_m(const Extent& extent, double cell_size_m, const Boundaries& boundaries) {
    const auto along = [&](Boundary boundary, int cells) {
        return boundary == Boundary::periodic ? kMaxPeriodicReach * cells * cell_size_m : kForever;
    };
    return {along(boundaries.x, extent.x), along(boundaries.y, extent.y), along(boundaries.z, extent.z)};
}

double thermals_at_once(const ThermalPlume& plume) { return std::floor(plume.life_s / plume.interval_s) + 1; }

Vec3 reach_m(const Ellipsoid& e) { return reach_of(e.semi_axes_m, sin_cos_deg(e.yaw_deg)); }

Vec3 reach_m(const EllipsoidScatter& s) {
    Vec3 largest{s.semi_axis_x_m.max, s.semi_axis_y_m.max, s.semi_axis_z_m.max};
    if (is_plume(s) && s.thermals.spread > 0) {
        // The smaller a thermal, the more a given rise adds to it.
        const double narrowest =
            0.5 * s.thermals.width * (1 - s.thermals.variety) * (s.semi_axis_x_m.min + s.semi_axis_y_m.min);
        largest *= 1 + s.thermals.spread * s.thermals.rise_m.max / narrowest;
    }
    Vec3 reach{};
    const auto turn_to = [&](double yaw_deg) {
        reach = glm::max(reach, reach_m(Ellipsoid{.semi_axes_m = largest, .yaw_deg = yaw_deg}));
    };
    turn_to(s.yaw_deg.min);
    turn_to(s.yaw_deg.max);
    // Between multiples of 90 degrees the reach along an axis only rises or only falls; two of them are all.
    const double quarter = std::ceil(s.yaw_deg.min / 90) * 90;
    for (const double yaw_deg : {quarter, quarter + 90})
        if (yaw_deg <= s.yaw_deg.max) turn_to(yaw_deg);
    return reach;
}

void check(const Ellipsoid& e, const AutomatonOptions& o, const std::string& name) {
    require_finite(e.centre_m.x, {name, ".centre_m.x"});
    require_finite(e.centre_m.y, {name, ".centre_m.y"});
    require_finite(e.centre_m.z, {name, ".centre_m.z"});
    check_semi_axis(e.semi_axes_m.x, {name, ".semi_axes_m.x"});
    check_semi_axis(e.semi_axes_m.y, {name, ".semi_axes_m.y"});
    check_semi_axis(e.semi_axes_m.z, {name, ".semi_axes_m.z"});
    require_finite(e.yaw_deg, {name, ".yaw_deg"});
    const Vec3 largest = largest_reach_m(o.extent, o.placement.cell_size_m, o.boundaries);
    const Vec3& axes = e.semi_axes_m;  // none reaches farther than its longest semi-axis
    if (std::max({axes.x, axes.y, axes.z}) > std::min({largest.x, largest.y, largest.z}))
        check_periodic_reach(reach_m(e), o, {name, ".semi_axes_m"});
    check(e.centre, {name, ".centre"});
    check(e.rim, {name, ".rim"});
    check_life(e.birth_s, e.life_s, e.fade_in_s, e.fade_out_s, name);
}

std::uint64_t ellipsoid_count(const AutomatonOptions& o) {
    double count = 0;
    for (const Ellipsoid& e : o.field.ellipsoids) count += images_of(reach_m(e), o);
    for (const EllipsoidScatter& s : o.field.scatters) {
        count += s.count * (is_plume(s) ? 1 + thermals_at_once(s.thermals) : 1) * images_of(reach_m(s), o);
    }
    return std::uint64_t(std::min(count, 1e18));
}

void check(const AutomatonOptions& o) {
    for (int n : {o.extent.x, o.extent.y, o.extent.z}) {
        require(n >= 1 && n <= kMaxExtent,
                "lattice extent " + std::to_string(n) + ": expected 1..65536 cells");
    }
    require(o.placement.cell_size_m > 0 && std::isfinite(o.placement.cell_size_m),
            "cell_size_m = " + number(o.placement.cell_size_m) + ": expected a finite number > 0 m");
    require_finite(o.placement.origin_m.x, "origin_m.x");
    require_finite(o.placement.origin_m.y, "origin_m.y");
    require_finite(o.placement.origin_m.z, "origin_m.z");
    require(o.time_step_s > 0 && std::isfinite(o.time_step_s),
            "time_step_s = " + number(o.time_step_s) + ": expected a finite number > 0 s");
    check(o.field.background, "field.background");
    check_profile(o.field.profile);
    check_grids(o.field.grids);
    for (std::size_t i = 0; i < o.field.ellipsoids.size(); ++i) {
        check(o.field.ellipsoids[i], o, "field.ellipsoids[" + std::to_string(i) + "]");
    }
    for (std::size_t i = 0; i < o.field.scatters.size(); ++i) {
        check(o.field.scatters[i], o, "field.scatters[" + std::to_string(i) + "]");
    }
    require(o.field.scatters.size() <= kMaxScatters,
            "field.scatters: " + std::to_string(o.field.scatters.size()) +
                " of them; at most 65536 are possible");
    const std::uint64_t ellipsoids = ellipsoid_count(o);
    require(ellipsoids <= kMaxEllipsoids, "the field has " + std::to_string(ellipsoids) +
                                              " ellipsoids, images around periodic axes included; at most " +
                                              std::to_string(kMaxEllipsoids) + " are possible");
    check(o.wind, o);
}

}  // namespace nephos
