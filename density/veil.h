// SPDX-License-Identifier: Apache-2.0
#pragma once

// Procedural veils: density as a function of position and time alone, a sum of octaves of noise (S,
// docs/sources.md, eq. 4 to 6), for high, thin, wide layers that need no automaton:
//
//     q(p, t) = sum_k w_k N_k
//     N_k     = X_k                      the plain form: stratus, cirrostratus
//     N_k     = r_k - |o_k - X_k|        the ridged form: cumulus and, as it makes fibres, cirrus
//     X_k     = b_k N((p_k - v_k t) / a_k) + c_k
//     p_0     = p,  p_k = p_{k-1} + N_{k-1} s_k        with displacement (cirrus, cirrostratus), else p_k = p
//
// N is the gradient noise of core/noise.h with a seed of its own for each octave. S multiplies by a
// frequency; here a_k is the wavelength, one per direction, so that cirrus has fibres along the wind.
//
// The frame of the noise. p is counted along and across the fibres and up, from a point that the wind at the
// veil's `top_m` carries; v_k are velocities relative to that wind. Ice that falls out of a cloud at a
// constant speed through air whose wind changes linearly with height falls behind by the square of the depth
// h below the top: its trail is a parabola, the hook of cirrus uncinus. So p is displaced along the fibres by
//
//     fallstreak_m * (h / (top_m - base_m))^2,   against the wind (streaks trail behind)
//
// From q to density. Two thresholds are quantiles of q: the veil covers the fraction `coverage` of the sky,
// and its density rises from 0 to 1, by a smoothstep, over the fraction `softness` of the covered part.
// `sheet` is a minimum: the pattern fills the range from it to 1. The result is multiplied by the profile in
// height (0 at base_m and top_m, 1 between the soft ends), by the fade towards the sides of the lattice and by that
// towards the rim of the area, smoothstep((1 - r) / softness), r = 1 being the rim.
// Densities below 2^-10 are 0.
//
// With a period the noise lattice of each octave is turned and stretched a little until both edges of the period are
// whole vectors of it, and lattice points that differ by such a vector have one gradient; the area's nearest image
// counts. So the density is periodic, whatever the direction of the fibres.
//
// The bits are the same on every machine, for any number of threads and any vector width: see core/noise.h.
// All functions are pure and thread-safe.

#include <cstdint>
#include <limits>
#include <vector>

#include "core/wind.h"
#include "density/density_grid.h"

namespace nephos {

enum class VeilForm { cumulus, stratus, cirrus, cirrostratus };

// One octave, with S's names in brackets. Vectors are along the fibres, across them, up.
struct VeilOctave {
    Vec3 wavelength_m{4000, 4000, 4000};  // size of a lattice cell of the noise [1/a], > 0
    double weight = 1;                    // [w]; in S it falls from octave to octave
    Vec3 velocity_m_per_s{};          // relative to the wind [v]: octaves that slide over each other evolve
    Vec3 displacement_m{};            // of this octave's point per value of the octave before [s]
    double gain = 1.5, offset = 0.5;  // [b], [c]: X lies about 0..1
    double ridge = 0.5, crest = 0.5;  // [r], [o]: of the ridged form alone
    bool operator==(const VeilOctave&) const = default;
};

// The ellipse of the ground above which there is a veil: an anvil, a patch. Outside it is clear.
struct VeilArea {
    double x_m = 0, y_m = 0;  // centre, world east and north, at time 0
    double semi_a_m = std::numeric_limits<double>::infinity(),
           semi_b_m = semi_a_m;  // > 0; infinite: no limit
    double yaw_deg = 0;          // of the first semi-axis, counter-clockwise from east
    double softness = 1;         // fraction of the radius over which the density falls to 0 at the rim; 0..1
    bool carried = false;        // by the wind at the veil's `top_m`, as the pattern is; otherwise it stands
    bool operator==(const VeilArea&) const = default;
};

struct VeilOptions {
    VeilForm form = VeilForm::cirrus;
    // Explicit octaves; if empty, `octave_count` octaves by powers (veil_octaves()).
    std::vector<VeilOctave> octaves;
    int octave_count = 4;          // 1..12
    double wavelength_m = 3000;    // of the first octave, across the fibres; > 0
    double lacunarity = 2.1;       // ratio of the wavelengths of an octave and the next, 1..8
    double persistence = 0.5;      // ratio of the weights of an octave and the one before, above 0, below 1
    double stretch = 1;            // ratio of the wavelengths along and across the fibres, 0.01..1000
    double stretch_up = 1;         // ratio of the wavelengths upwards and across the fibres, 0.01..1000
    double displacement = 0;       // [s] across the fibres, in wavelengths of the octave; 0..10
    double evolution_m_per_s = 1;  // speed of the first octave; times 0.8 per further octave
    double direction_deg = 0;      // of the fibres, counter-clockwise from east
    double coverage = 0.5;         // fraction of the sky that the veil covers, above 0, at most 1
    double softness = 1;           // fraction of the covered part over which density rises from 0 to 1; 0..1
    double sheet = 0;              // least density in the layer, 0..1: the pattern adds to it up to 1
    double base_m = 0, top_m = 1000;             // world z; base below top
    double soft_base_m = 200, soft_top_m = 200;  // heights over which density fades in from the ends, >= 0
    double fallstreak_m = 0;                     // displacement of streaks at the base, against the wind
    double margin_m = 0;  // width along the sides of the lattice over which density fades; >= 0
    VeilArea area;
    // Lengths after which the veil repeats towards east and north, both above 0; {0, 0}: it does not. Wavelengths and the
    // direction of the fibres are then rounded so that whole lattice cells of each octave's noise fit (veil_lattice.h).
    Vec2 period_m{0, 0};
    std::uint64_t seed = 1;
    bool operator==(const VeilOptions&) const = default;
};

// Returns options.octaves, or if there are none octaves by powers: wavelength_m / lacunarity^k, weights
// persistence^k, speeds evolution_m_per_s 0.8^k (eddies of half the size are slower by 2^(1/3): Kolmogorov)
// in six directions in turn, displacements from the second octave on; in the ridged form crests lie at X =
// 1/2.
std::vector<VeilOctave> veil_octaves(const VeilOptions& options);

// The sums q at which the density of the pattern rises above 0, and reaches 1; constant over time.
struct VeilThresholds {
    float low = 0, high = 1;
};
VeilThresholds veil_thresholds(const VeilOptions& options);

// Throws Error(usage) that names the first option out of range or too fine for the cells: a wavelength is at
// least two cells, and some cell's centre must lie between base and top. With a period: where an octave has no two
// lattice cells that differ in it, has more than 2^20, or where the area reaches beyond half of the period.
void check(const VeilOptions& options, const Extent& extent, const Placement& placement);

// Returns the integral of the wind at a height from time 0 to `time_s`: the displacement of the air in metres
// towards east and north. Exact for winds that are linear between keyframes.
Vec3 wind_displacement_m(const Wind& wind, double height_m, double time_s);

// Returns the density at a time as a sparse grid of extent.cells() voxels. Throws as check(), and
// Error(usage) when time_s is not finite or the pattern has moved more than 2^30 cells.
DensityGrid veil_density(const VeilOptions& options, const Wind& wind, const Extent& extent,
                         const Placement& placement, double time_s);

}  // namespace nephos
