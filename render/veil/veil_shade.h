// SPDX-License-Identifier: Apache-2.0
#pragma once

// The shade of veils that are drawn per pixel on what lies below them: clouds, rain and snow. (The ground is darkened in
// the pass that draws them, veil_pass.h.)
//
// The optical depth of the slab along lines towards the sun, by Simpson's rule, at the nodes of a level grid in the middle
// of each slab, over the places whose light may be asked for; between nodes bilinear, beyond the grid that of its edge. A
// place within the slab has the part of the depth that lies above it. With physical light the depth is (1 - g) of the
// slab's: what is scattered forwards still travels nearly along the sun's light (as in diffusion.h). With S's two samples,
// which have no g, it is all of it. The Earth's curvature is left out. Private to the module.

#include <memory>
#include <span>
#include <vector>

#include "core/vec.h"
#include "render/veil/drawn_veil.h"

namespace nephos {

// A box of the world.
struct PlaceBox {
    Vec3 low_m{1e300, 1e300, 1e300}, high_m{-1e300, -1e300, -1e300};
    bool any() const { return low_m.x <= high_m.x; }
    void add(const Vec3& place_m, double reach_m = 0) {
        low_m = glm::min(low_m, place_m - reach_m);
        high_m = glm::max(high_m, place_m + reach_m);
    }
};

class VeilShade {
  public:
    // `places`: where light is asked for; `to_sun`: a unit vector. Parallel; the same for any number of threads.
    VeilShade(std::span<const DrawnVeil> veils, const PlaceBox& places, const Vec3& to_sun);

    // Returns the optical depth between a place of the world and the sun. Thread-safe.
    float depth_at(const Vec3& place_m) const;

    // All numbers that depth_at() depends on, for keys of caches.
    std::vector<float> content() const;

  private:
    static constexpr int kNodes = 192;  // on a side

    struct Map {
        double base_m = 0, top_m = 0;
        Vec2 corner_m{0, 0}, node_m{1, 1};
        std::vector<float> depth;  // x fastest
        float at(const Vec2& place_m) const;
    };
    Map map_of(const DrawnVeil& veil, const PlaceBox& places) const;

    Vec2 per_rise_{0, 0};  // metres across for each metre up towards the sun
    double slant_ = 1;     // metres along the light for each metre up
    std::vector<Map> maps_;
};

}  // namespace nephos
