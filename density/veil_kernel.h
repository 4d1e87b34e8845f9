// SPDX-License-Identifier: Apache-2.0
#pragma once

// The SIMD kernel of density/veil.h: evaluates q at points that are close together (not installed).

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "density/veil_lattice.h"

namespace nephos {

// One octave at one time, in the form that the kernel reads.
struct VeilOctavePlan {
    std::array<double, 3> per_m{};  // lattice cells per metre along, across, up
    VeilLattice lattice;            // of a veil that repeats, instead of the first two of per_m
    std::array<double, 3> phase{};  // origin of p in lattice cells of the noise: random, minus v t
    std::array<std::uint32_t, 3> seeds{};
    std::array<float, 3> displacement_m{};
    float weight = 1, gain = 1, offset = 0, ridge = 0, crest = 0;
    float most_after = 0;  // upper bound of the summed octaves after this one, for early termination
    // For sums at the resolution of a picture: mean and variance of N, and its shortest wavelength.
    float mean = 0, variance = 0, shortest_m = 1;
};

struct VeilPlan {
    std::vector<VeilOctavePlan> octaves;
    bool ridged = false, displaced = false, repeats = false;
    float low = 0, high = 1;  // q at density 0 and 1
};

inline constexpr std::size_t kMostVeilOctaves = 24;  // of a plan: those of the options, and finer ones
inline constexpr std::size_t kVeilLanes = 64;  // points are padded to a multiple of this

// Points in the frame of the noise, in metres, as float offsets from a double base, so that precision does
// not depend on the position.
struct VeilPoints {
    std::array<double, 3> base_m{};
    std::array<const float*, 3> from_base_m{};
    std::size_t count = 0;  // multiple of kVeilLanes
};

// Computes out[n] = q of point n. Where q is below `threshold`, out[n] is any value below it: octaves that
// cannot reach it any more are skipped. Precondition: at most kMostVeilOctaves octaves.
void veil_sums(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out);

// Computes sum[n] = q of point n, without what is finer than footprint_m[n]: octaves fade into their mean while the
// footprint grows from a quarter to three quarters of their shortest wavelength. variance[n] is the variance of what is
// left out. Precondition: as above.
void resolved_veil_sums(const VeilPlan& plan, const VeilPoints& points, const float* footprint_m, float* sum,
                        float* variance);

}  // namespace nephos
