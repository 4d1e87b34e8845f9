// SPDX-License-Identifier: Apache-2.0
#pragma once

// The vector part of density/veil.h: q of points that lie near each other (not installed).

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace nephos {

// One octave at one moment, as the kernel takes it.
struct VeilOctavePlan {
    std::array<double, 3> per_m{};  // lattice cells per metre along, across, up
    std::array<double, 3> phase{};  // lattice cells at the origin of p: a place of its own, less v t
    std::array<std::uint32_t, 3> seeds{};
    std::array<float, 3> displacement_m{};
    float weight = 1, gain = 1, offset = 0, ridge = 0, crest = 0;
    float most_after = 0;  // the largest sum that the octaves after this one may have
};

struct VeilPlan {
    std::vector<VeilOctavePlan> octaves;
    bool ridged = false, displaced = false;
    float low = 0, high = 1;  // q at density 0 and 1
};

inline constexpr std::size_t kVeilLanes = 64;  // points are padded to a multiple of this

// Points relative to a base in the frame of the noise, metres: differences as floats keep their precision
// wherever the base lies.
struct VeilPoints {
    std::array<double, 3> base_m{};
    std::array<const float*, 3> from_base_m{};
    std::size_t count = 0;  // multiple of kVeilLanes
};

// out[n] = q of point n; or anything below `threshold` where q is below it, the sooner found the better.
void veil_sums(const VeilPlan& plan, const VeilPoints& points, float threshold, float* out);

}  // namespace nephos
