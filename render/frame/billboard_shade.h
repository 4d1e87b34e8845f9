// SPDX-License-Identifier: Apache-2.0
#pragma once

// The shade of clouds that are drawn directly as billboards (T): the one definition that all back-ends use. T has no
// shadows; these follow from what a billboard hides.
//
// For the light a billboard is the body that it stands for: an ellipsoid of its width, level, and its height. Seen from
// the sun at elevation e it is an ellipse with the semi-axes
//
//     width / 2  level,    sqrt((height / 2)^2 cos^2 e + (width / 2)^2 sin^2 e)  upwards
//
// over which its texture lies as the eye sees it, u to the right and v up. What is behind it has 1 - opacity of the
// sunlight, with the texture's opacity there times the billboard's; so the shadow of a cloud is what it hides when it is
// looked at from the sun. A place within the ellipsoid's extent along the light has a part of the shade, linearly.
//
//     sunlight = product over all billboards of 1 - opacity(u, v) * clamp(1/2 + (s - s_billboard) / chord, 0, 1)
//
// with s along the light and the chord through the ellipsoid's middle. Billboards whose ellipse is narrower than 1.25
// texels of the map are widened to that, with the same product of opacity and area.
//
// The result depends neither on the order of the billboards nor on the number of threads. Private to the module.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/vec.h"
#include "render/cloud/cloud_preparation.h"
#include "render/cloud/splats.h"
#include "render/image/picture.h"

namespace nephos {

class BillboardShade {
  public:
    static constexpr std::uint32_t kNoCloud = 0xffffffffu;

    BillboardShade() = default;  // without billboards
    // `pictures` as Splats::pictures; `to_sun`: a unit vector. Billboards that splats.h does not allow are left out.
    BillboardShade(std::span<const CloudBillboard> seen, std::span<const CloudBillboard> unseen,
                   std::shared_ptr<const BillboardPictures> pictures, const Vec3& to_sun);

    bool empty() const { return casters_.empty(); }

    // Returns the fraction of sunlight that billboards leave at a place of the world, but for those of one cloud. Details
    // below a sixteenth of a billboard are left out.
    float sunlight_at(const Vec3& place_m, std::uint32_t but_for_cloud = kNoCloud) const;

    // Multiplies the texels of a shadow map by what all billboards leave.
    void cast(const ShadowFrame& frame, int size, std::span<float> shadow) const;

    // Spheres where the billboards are, in which shadow_frame() and the shells of air see what casts shadows.
    std::span<const ShadowCaster> casters() const { return spheres_; }

  private:
    // A billboard as the sun sees it.
    struct Caster {
        double u = 0, v = 0, s = 0;         // metres: right, up, along the light
        float half_u = 1, half_v = 1;       // metres
        float half_chord = 1;               // along the light
        float half_height = 1;              // of the ellipsoid
        float opacity = 1;                  // 0..1
        std::uint16_t layer = 0, turn = 0;  // of BillboardPicture
        std::uint32_t cloud = 0;
    };
    // The texels that a caster has on a map.
    struct Footprint;

    void add(std::span<const CloudBillboard> billboards);
    void bin();
    Footprint footprint(const Caster& caster, const ShadowFrame& frame, int size) const;

    Vec3 to_sun_{0, 0, 1}, right_{1, 0, 0}, up_{0, 1, 0};
    std::shared_ptr<const BillboardPictures> pictures_;
    std::vector<Caster> casters_;  // from the sun
    std::vector<ShadowCaster> spheres_;
    // Casters by the cells of a grid across the light: of each cell those from first_[cell] to first_[cell + 1], from the
    // sun.
    std::array<double, 2> low_{}, per_m_{};
    std::array<int, 2> cells_{0, 0};
    std::vector<std::uint32_t> first_, listed_;
    float longest_half_chord_ = 0;
};

}  // namespace nephos
