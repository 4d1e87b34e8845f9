// SPDX-License-Identifier: Apache-2.0
#pragma once

// What one picture shows: voxel clouds as metaballs (D) and clouds drawn directly as billboards (T), in one
// set and in one picture, back to front among each other. Plain data in world metres; what spans refer to
// must stay as it is until the picture is finished (Renderer::finish(); draw_splats() finishes it itself).

#include <cstdint>
#include <optional>
#include <span>

#include "core/weather.h"
#include "density/metaballs.h"
#include "render/cloud/ground_cover_view.h"
#include "render/options/options.h"

namespace nephos {

// A cloud made of metaballs. Along a ray, extinction (per metre) is
//     extinction_per_m * normalisation * sum_i density_i f(|x - x_i| / radius_i),
//     f(a) = 1 - 22/9 a^2 + 17/9 a^4 - 4/9 a^6 for a < 1, else 0 (Wyvill)
struct MetaballCloud {
    std::span<const Metaball> metaballs;  // metres; metaballs of density <= 0 draw nothing
    double extinction_per_m = 0.02;       // at density 1; >= 0
    double normalisation = 1.0;           // such that a saturated lattice has density 1; >= 0
};

// One of T's billboards, facing the eye. Its light is that of T's vertex shader, for each corner:
//
//     diffuse  = clamp(dot(direction to the sun, direction from the cloud's centre to the corner) * sun's
//     colour
//                      - absorbed, 0, 1) + ambient
//     radiance = texture * albedo * diffuse
//
// with the ambient light by the corner's height between the cloud's base and top, and behind the veil of the
// air. A flash of lightning adds a second term of the same form, towards its place and times its irradiance.
struct CloudBillboard {
    Vec3 centre_m{};                  // world
    float width_m = 1, height_m = 1;  // > 0, at most 60000
    float sun_absorbed = 0;           // CFA: share of the sunlight that is absorbed on its way, 0..1
    float flash_absorbed = 0;         // the same of the lightning
    float opacity = 1;                // 0..1; below 1 while its cloud forms or dissolves
    BillboardTexture texture = BillboardTexture::soft;
    std::uint32_t variant = 0;  // any number: which of the texture's pictures, and how it is turned
    std::uint32_t cloud = 0;    // index in Splats::clouds
};

// What the billboards of one cloud share.
struct BillboardCloud {
    Vec3 centre_m{};               // world
    double base_m = 0, top_m = 1;  // world z; base_m < top_m
};

struct Splats {
    std::span<const BillboardCloud> clouds;
    std::span<const CloudBillboard> billboards;
    MetaballCloud metaballs;
    std::optional<Flash> flash;
    double time_s = 0;  // simulated time of the picture
    // False: nobody asks for Picture::depth_m, which is infinity then; billboards are drawn a sixth faster.
    bool depth = true;
    // False: nobody asks for Picture::light and Picture::shadow, which are empty then. On the processor light
    // is then computed only where the picture shows it; its pixels are the same.
    bool light = true;
    std::optional<GroundCoverView> ground_cover{};  // none: the ground is dry
};

}  // namespace nephos
