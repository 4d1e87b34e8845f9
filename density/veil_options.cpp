// SPDX-License-Identifier: Apache-2.0

// Derived octaves and validation of a veil's options.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/text.h"
#include "density/veil.h"
#include "density/veil_lattice.h"

namespace nephos {
namespace {

void require(bool good, const std::string& key, double value, const std::string& expected) {
    if (good) return;
    throw Error(ErrorCode::usage,
                "`" + key + "` of a veil is " + number_text(value, 9) + ", expected " + expected);
}

void require_range(const std::string& key, double value, double low, double high) {
    require(value >= low && value <= high, key, value, number_text(low, 9) + " to " + number_text(high, 9));
}

// Directions of the octaves' own velocities in turn: vectors of length 1, no two alike and none level.
constexpr std::array<Vec3, 6> kDirections{{{0.48, 0.6, 0.64},
                                           {-0.48, 0.6, -0.64},
                                           {0.6, -0.64, 0.48},
                                           {-0.64, -0.48, 0.6},
                                           {0.64, 0.48, -0.6},
                                           {-0.6, -0.64, -0.48}}};

std::array<double, 3> components(const Vec3& v) { return {v.x, v.y, v.z}; }

void check_octave(const VeilOctave& octave, const std::string& name, double cell_m) {
    for (const double wavelength : components(octave.wavelength_m)) {
        require(wavelength >= 2 * cell_m && wavelength <= 1e7, name + "wavelength_m", wavelength,
                "two cells (" + number_text(2 * cell_m, 9) + " m) to 1e7 m, in every direction");
    }
    for (const double velocity : components(octave.velocity_m_per_s)) {
        require_range(name + "velocity_m_per_s", velocity, -1000, 1000);
    }
    for (const double way : components(octave.displacement_m)) {
        require_range(name + "displacement_m", way, -1e6, 1e6);
    }
    require_range(name + "weight", octave.weight, -1000, 1000);
    require_range(name + "gain", octave.gain, -100, 100);
    require_range(name + "offset", octave.offset, -100, 100);
    require_range(name + "ridge", octave.ridge, -100, 100);
    require_range(name + "crest", octave.crest, -100, 100);
}

// Points that are displaced beyond what a float resolves would make grains instead of noise.
void check_displacements(const std::vector<VeilOctave>& octaves) {
    std::array<double, 3> way{};
    for (std::size_t k = 1; k < octaves.size(); ++k) {
        const VeilOctave& before = octaves[k - 1];
        const double most = std::abs(before.gain) + std::abs(before.offset);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            way[axis] += std::abs(components(octaves[k].displacement_m)[axis]) * most;
            const double cells = way[axis] / components(octaves[k].wavelength_m)[axis];
            require(
                cells <= 1000, "displacement_m", components(octaves[k].displacement_m)[axis],
                "points that are displaced by at most 1000 wavelengths of octave " + std::to_string(k + 1));
        }
    }
}

void check_heights(const VeilOptions& o, const Extent& extent, const Placement& placement) {
    require_range("base_m", o.base_m, -1e6, 1e6);
    require_range("top_m", o.top_m, -1e6, 1e6);
    require_range("soft_base_m", o.soft_base_m, 0, 1e6);
    require_range("soft_top_m", o.soft_top_m, 0, 1e6);
    require(o.top_m > o.base_m, "top_m", o.top_m, "a height above `base_m` = " + number_text(o.base_m, 9));
    const double size = placement.cell_size_m, bottom = placement.origin_m.z;
    for (int k = 0; k < extent.z; ++k) {
        const double z = bottom + (k + 0.5) * size;
        if (z > o.base_m && z < o.top_m) return;
    }
    throw Error(ErrorCode::usage, "no cell's centre lies between `base_m` = " + number_text(o.base_m, 9) +
                                      " and `top_m` = " + number_text(o.top_m, 9) +
                                      " of the veil: its lattice has cells of " + number_text(size, 9) +
                                      " m from " + number_text(bottom, 9) + " to " +
                                      number_text(bottom + extent.z * size, 9) + " m");
}

// A veil that repeats: lattice cells that fit into the period, and an area that does not meet its own image.
void check_period(const VeilOptions& o, const std::vector<VeilOctave>& octaves) {
    if (o.period_m == Vec2(0, 0)) return;
    for (const double period : {o.period_m.x, o.period_m.y}) require(period > 0, "period_m", period, "above 0");
    const Rotation fibres = rotation_of_degrees(o.direction_deg);
    for (std::size_t k = 0; k < octaves.size(); ++k) {
        const Vec3& wavelength = octaves[k].wavelength_m;
        if (veil_lattice({wavelength.x, wavelength.y}, fibres, o.period_m).wide > 0) continue;
        throw Error(ErrorCode::usage,
                    "octave " + std::to_string(k + 1) + " of the veil, " + number_text(wavelength.x, 9) + " m along and " +
                        number_text(wavelength.y, 9) + " m across the fibres, does not fit into a tile of " +
                        number_text(o.period_m.x, 9) + " x " + number_text(o.period_m.y, 9) +
                        " m: expected wavelengths of at most the tile's edges, and at most " +
                        std::to_string(kMostVeilCells) + " cells of the noise in it");
    }
    const Rotation yaw = rotation_of_degrees(o.area.yaw_deg);
    const double east = std::hypot(o.area.semi_a_m * yaw.cos, o.area.semi_b_m * yaw.sin),
                 north = std::hypot(o.area.semi_a_m * yaw.sin, o.area.semi_b_m * yaw.cos);
    if (std::isinf(o.area.semi_a_m) && std::isinf(o.area.semi_b_m)) return;
    require(east <= o.period_m.x / 2 && north <= o.period_m.y / 2, "area", std::max(east, north),
            "an ellipse that reaches at most half of the tile from its centre, " + number_text(o.period_m.x / 2, 9) + " and " +
                number_text(o.period_m.y / 2, 9) + " m");
}

}  // namespace

std::vector<VeilOctave> veil_octaves(const VeilOptions& options) {
    if (!options.octaves.empty()) return options.octaves;
    const bool displaced = options.form == VeilForm::cirrus || options.form == VeilForm::cirrostratus;
    std::vector<VeilOctave> octaves;
    double wavelength = options.wavelength_m, weight = 1, speed = options.evolution_m_per_s;
    for (int k = 0; k < options.octave_count; ++k) {
        VeilOctave& octave = octaves.emplace_back();
        octave.wavelength_m = {wavelength * options.stretch, wavelength, wavelength * options.stretch_up};
        octave.weight = weight;
        const Vec3& direction = kDirections[std::size_t(k) % kDirections.size()];
        octave.velocity_m_per_s = {speed * direction.x, speed * direction.y, speed * direction.z};
        if (displaced && k > 0) octave.displacement_m = {0, options.displacement * wavelength, 0};
        wavelength /= options.lacunarity;
        weight *= options.persistence;
        speed *= 0.8;
    }
    return octaves;
}

void check(const VeilOptions& o, const Extent& extent, const Placement& placement) {
    require_range("octaves", o.octave_count, 1, 12);
    require_range("octave", double(o.octaves.size()), 0, 12);
    require_range("lacunarity", o.lacunarity, 1, 8);
    require_range("stretch", o.stretch, 0.01, 1000);
    require_range("stretch_up", o.stretch_up, 0.01, 1000);
    require_range("displacement", o.displacement, 0, 10);
    require_range("evolution_m_per_s", o.evolution_m_per_s, 0, 1000);
    require_range("direction_deg", o.direction_deg, -360, 360);
    require_range("softness", o.softness, 0, 1);
    require_range("sheet", o.sheet, 0, 1);
    require_range("fallstreak_m", o.fallstreak_m, -1e6, 1e6);
    require_range("margin_m", o.margin_m, 0, 1e7);
    require_range("area.x_m", o.area.x_m, -1e7, 1e7);
    require_range("area.y_m", o.area.y_m, -1e7, 1e7);
    require(o.area.semi_a_m > 0, "area.semi_a_m", o.area.semi_a_m, "above 0");
    require(o.area.semi_b_m > 0, "area.semi_b_m", o.area.semi_b_m, "above 0");
    require_range("area.yaw_deg", o.area.yaw_deg, -360, 360);
    require_range("area.softness", o.area.softness, 0, 1);
    require(o.wavelength_m > 0 && o.wavelength_m <= 1e7, "wavelength_m", o.wavelength_m,
            "above 0, at most 1e7");
    require(o.persistence > 0 && o.persistence < 1, "persistence", o.persistence, "above 0, below 1");
    require(o.coverage > 0 && o.coverage <= 1, "coverage", o.coverage, "above 0, at most 1");
    check_heights(o, extent, placement);
    const std::vector<VeilOctave> octaves = veil_octaves(o);
    for (std::size_t k = 0; k < octaves.size(); ++k) {
        const std::string number = std::to_string(k + 1);
        const std::string name =
            o.octaves.empty() ? "octave " + number + ": " : "octave[" + std::to_string(k) + "].";
        check_octave(octaves[k], name, placement.cell_size_m);
    }
    check_displacements(octaves);
    check_period(o, octaves);
}

}  // namespace nephos
