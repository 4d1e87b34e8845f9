// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's light absorption factor (CFA, chapter 3.3): the fraction of a light that is absorbed between the light
// and the centre of each box of a cloud. Along a ray from the box's centre towards the light, the lengths
// inside the cloud's boxes are summed (Kay and Kajiya's slab test for each box, its own from the centre
// outwards) and divided by the cloud's light distance:
//
//     absorbed = clamp(sum over boxes of weight * length inside / light distance, 0, 1)
//
// 1 = fully absorbed, only ambient light is left. (T's first sentence on the factor inverts it, its examples
// and its shader have it this way.) Where boxes overlap, the length counts once for each: denser cloud. A ray
// exactly in the face of a box counts as inside. With a light at a finite distance the ray ends there.
//
// Cost: boxes^2 slab tests a cloud, one SIMD lane a ray. Each ray sums the boxes in their order, so the bits
// do not depend on the vector width.

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "seeds/cloud.h"

namespace nephos {

// The sun, or a flash of lightning: outside the clouds, above or below the horizon.
struct Light {
    // At infinity: direction to the light, any length > 0; otherwise its world position.
    Vec3 towards{0, 0, 1};
    bool at_infinity = true;
    bool operator==(const Light&) const = default;
};

// Computes the absorbed fraction, 0..1, of each box of `cloud` at world position `position_m`, in the order
// of the boxes. `weights` (one a box, 0..1, or none for all 1) scale the boxes of a cloud that is forming. A
// light in the centre of a box gives 0 there. Throws Error(usage) when `out` or `weights` have another size
// than the boxes, or the light has no direction or is not finite. Thread-safe.
void absorb_light(const Cloud& cloud, const Vec3& position_m, const Light& light, std::span<double> out,
                  std::span<const double> weights = {});

std::vector<double> absorbed_light(const Cloud& cloud, const Vec3& position_m, const Light& light);

// One cloud for LightAbsorption::update().
struct CloudToLight {
    std::uint64_t id = 0;          // constant over all calls
    const Cloud* cloud = nullptr;  // not null; an id always has the same shape
    Vec3 position_m{};
    Light light;
    // Only boxes that are there take light away: each counts by its phase_weight(). At phase 1 all are whole.
    double phase = 1, softness = 0.5;
};

// Caches the absorption of many clouds, and recomputes it where the light moved relative to the cloud, or the cloud forms or
// dissolves: a whole drifting cloud is recomputed for lightning, but never for the sun. absorbed() depends on the last light
// and phase alone; LightSchedule bounds the number of lights that move in a frame. Not thread-safe.
class LightAbsorption {
  public:
    // Computes new clouds and those whose light moved; of a repeated id the first counts. Drops clouds that
    // are not in the list. Returns the number of computed clouds.
    std::size_t update(std::span<const CloudToLight> clouds);

    // Returns the absorbed fractions of a cloud; empty if it was not in the last list.
    std::span<const double> absorbed(std::uint64_t id) const;

  private:
    struct Entry {
        Light seen;                // as it was, relative to the cloud
        double phase = 1;          // of the cloud then
        std::uint64_t listed = 0;  // last call that named it, from 1
        std::vector<double> absorbed;
    };

    std::unordered_map<std::uint64_t, Entry> entries_;
    std::uint64_t calls_ = 0;
};

}  // namespace nephos
