// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's light absorption factor (CFA, chapter 3.3): how much of a light is lost on its way through a cloud to
// the centre of each box. A ray leaves the box's centre towards the light; the lengths that lie inside the
// cloud's boxes are summed up (Kay and Kajiya's slab test, each box by itself, its own from the centre
// outwards) and divided by the cloud's light distance:
//
//     absorbed = clamp(sum over boxes of weight * length inside / light distance, 0, 1)
//
// 1 = fully absorbed, only ambient light is left. (T's first sentence on the factor has it the other way
// round, its examples and its shader have it this way.) Where boxes overlap the length counts once for each:
// denser cloud. A ray that runs exactly in the face of a box counts as inside. Beyond a light at a finite
// place nothing counts.
//
// Cost: boxes^2 slab tests a cloud, one lane a ray. Each ray adds up the boxes in their order, so the bits do
// not depend on the width of the vectors.

#include <cstdint>
#include <limits>
#include <span>
#include <unordered_map>
#include <vector>

#include "seeds/cloud.h"

namespace nephos {

// The sun, or a flash of lightning: anywhere outside the clouds, above or below the horizon.
struct Light {
    Vec3 towards{0, 0,
                 1};  // at infinity: direction to the light, any length > 0; otherwise its world position
    bool at_infinity = true;
    bool operator==(const Light&) const = default;
};

// Absorbed light of each box of `cloud`, which stands at world position `position_m`, 0..1, in the order of
// the boxes. `weights` (one a box, 0..1, or none for all 1) thin a cloud that is forming. A light in the
// centre of a box gives 0 there. Throws Error(usage) when `out` or `weights` have another size than the
// boxes, or the light has no direction or is not finite.
void absorb_light(const Cloud& cloud, const Vec3& position_m, const Light& light, std::span<double> out,
                  std::span<const double> weights = {});

std::vector<double> absorbed_light(const Cloud& cloud, const Vec3& position_m, const Light& light);

// One cloud to keep lit.
struct CloudToLight {
    std::uint64_t id = 0;          // the same cloud has the same id in every call
    const Cloud* cloud = nullptr;  // not null; shape of an id never changes
    Vec3 position_m;
};

// Keeps the absorption of many clouds up to date, a bounded number a call (T: one cloud a frame, and only
// when the light moved). A moved light means: seen from the cloud; so a drifting cloud is recomputed for
// lightning, but never for the sun. Not thread-safe.
class LightAbsorption {
  public:
    // Recomputes at most `max_clouds` of the clouds whose light moved: those never computed first, in the
    // order given, then those computed longest ago. Forgets clouds that are not in the list. Returns how many
    // it did.
    std::size_t update(std::span<const CloudToLight> clouds, const Light& light,
                       std::size_t max_clouds = std::numeric_limits<std::size_t>::max());

    // As computed last; empty for a cloud that was never computed.
    std::span<const double> absorbed(std::uint64_t id) const;

  private:
    struct Entry {
        Light seen;                  // as it was, relative to the cloud
        std::uint64_t computed = 0;  // call in which it was computed, from 1
        std::uint64_t listed = 0;    // last call that named it
        std::vector<double> absorbed;
    };

    std::unordered_map<std::uint64_t, Entry> entries_;
    std::uint64_t calls_ = 0;
};

}  // namespace nephos
