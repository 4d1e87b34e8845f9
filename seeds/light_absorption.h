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
    Vec3 position_m{};
    Light light;
};

// Keeps the absorption of many clouds up to date, and computes it only where the light moved: seen from the
// cloud; so a drifting cloud is recomputed for lightning, but never for the sun. What absorbed() returns is
// that of the light last given, whatever was before; LightSchedule bounds how many lights move in a frame.
// Not thread-safe.
class LightAbsorption {
  public:
    // Computes new clouds and those whose light moved; of a cloud that is named twice, the first counts.
    // Forgets clouds that are not in the list. Returns how many it computed.
    std::size_t update(std::span<const CloudToLight> clouds);

    // As computed last; empty for a cloud that was not in the last list.
    std::span<const double> absorbed(std::uint64_t id) const;

  private:
    struct Entry {
        Light seen;                // as it was, relative to the cloud
        std::uint64_t listed = 0;  // last call that named it, from 1
        std::vector<double> absorbed;
    };

    std::unordered_map<std::uint64_t, Entry> entries_;
    std::uint64_t calls_ = 0;
};

}  // namespace nephos
