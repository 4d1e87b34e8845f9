// SPDX-License-Identifier: Apache-2.0
#pragma once

// The input of a frame: voxel clouds as metaballs (D) and clouds drawn directly as billboards (T;
// docs/sources.md), which are sorted and composited together. Plain data in world metres; the memory behind
// spans must not change until the frame is finished (Renderer::finish(); draw_splats() finishes it itself).

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "core/weather.h"
#include "density/density_grid.h"
#include "density/detail.h"
#include "density/metaballs.h"
#include "render/image/alpha_image.h"
#include "render/options/options.h"

namespace nephos {

struct HeightMap;

// The renderer's view of the map of water and snow on the ground (seeds/ground_cover.h) at the time of a
// frame; each span has columns * rows values >= 0. Towards its edge the map fades to the outside values.
struct GroundCoverView : GroundTexels {
    std::span<const float> water_mm;       // film of water
    std::span<const float> snow_mm;        // likewise, of water in the snow
    std::span<const float> rain_mm_per_h;  // rain that falls into the water
};

// Voxels of a cloud that are drawn with detail (density/detail.h): near the eye rays march through them, and farther
// away, where a pixel covers 15 to 25 m, the metaballs that stand for them take over.
struct DetailedVoxels {
    DensityGrid density;
    std::optional<DensityGrid> moisture;  // as CoverageField takes it
    DetailSetting setting;                // its extinction is that of the cloud
    std::size_t first = 0, count = 0;     // of MetaballCloud::metaballs
};

// A cloud made of metaballs. Along a ray, extinction (per metre) is
//     extinction_per_m * normalisation * sum_i density_i f(|x - x_i| / radius_i),
//     f(a) = 1 - 22/9 a^2 + 17/9 a^4 - 4/9 a^6 for a < 1, else 0 (Wyvill)
struct MetaballCloud {
    std::span<const Metaball> metaballs;  // metres; metaballs of density <= 0 draw nothing
    double extinction_per_m = 0.02;       // at density 1; >= 0
    double normalisation = 1.0;           // such that a saturated lattice has density 1; >= 0
    std::span<const DetailedVoxels> detailed{};  // of these metaballs; by `first`, without overlap
};

// One of T's billboards, facing the eye, lit per corner as by T's vertex shader:
//
//     diffuse  = clamp(dot(to_sun, direction from the cloud's centre to the corner) * sun's colour
//                      - absorbed, 0, 1) + ambient
//     radiance = texture * albedo * diffuse
//
// with ambient light by the corner's height between the cloud's base and top, then attenuated by the air. A
// flash of lightning adds a second term of the same form, towards its position and times its irradiance. The sun's term is
// multiplied by the sunlight that other clouds leave at the billboard's centre (render/frame/billboard_shade.h).
struct CloudBillboard {
    Vec3 centre_m{};                  // world
    float width_m = 1, height_m = 1;  // > 0, at most 60000
    float sun_absorbed = 0;           // CFA: absorbed fraction of the sunlight, 0..1
    float flash_absorbed = 0;         // absorbed fraction of the lightning, 0..1
    float opacity = 1;                // 0..1; below 1 while its cloud forms or dissolves
    BillboardTexture texture = BillboardTexture::soft;
    std::uint32_t variant = 0;  // any number; selects the texture's variant and orientation
    std::int32_t picture = -1;  // index in Splats::pictures, instead of a texture: upright; -1: none
    std::uint32_t cloud = 0;    // index in Splats::clouds
};

// The cloud that a set of billboards belongs to.
struct BillboardCloud {
    Vec3 centre_m{};               // world
    double base_m = 0, top_m = 1;  // world z; base_m < top_m
};

// Pictures that billboards can have instead of the renderer's own textures, in the form that back-ends draw. Immutable.
struct BillboardPictures;
inline constexpr std::size_t kMostBillboardPictures = 200;

// Each picture fills the rectangle of its billboard, but for a rim of 1/128 of its sides that is clear. It is resampled to
// 126 x 126 texels: its alpha is their opacity, its luminance scales the light. Throws Error(usage) when there are more
// than kMostBillboardPictures, or one has no pixels or values that its size does not state.
std::shared_ptr<const BillboardPictures> billboard_pictures(std::size_t count,
                                                            const std::function<AlphaImage(std::size_t)>& image_of);

// Sunlight that voxels lose by their place, beside what clouds in the picture take away: an optical depth >= 0 between a
// place of the world and the sun. `at` is thread-safe and does not change.
struct AddedDepth {
    std::array<std::uint64_t, 2> key{};  // of all that the depth depends on
    std::function<float(const Vec3& place_m)> at;
    bool any() const { return bool(at); }
};

struct Splats {
    std::span<const BillboardCloud> clouds;
    std::span<const CloudBillboard> billboards;
    MetaballCloud metaballs;
    std::optional<Flash> flash;
    double time_s = 0;  // simulated time of the frame
    // True: Picture::depth_m is requested. False: it is infinity, and billboards are drawn a sixth faster.
    bool depth = true;
    // True: Picture::light and Picture::shadow are requested. False: they are empty, and the back-end `cpu`
    // computes light for visible metaballs and texels alone; the pixels are the same.
    bool light = true;
    std::optional<GroundCoverView> ground_cover{};  // none: the ground is dry
    std::shared_ptr<const BillboardPictures> pictures{};  // of billboards; null: none has one
    // Billboards of clouds that the camera does not see: they are not drawn but cast shadows. `cloud` has no meaning.
    std::span<const CloudBillboard> unseen{};
    AddedDepth in_voxels{};                      // that metaballs and their detail have; it casts no shadow
    std::shared_ptr<const HeightMap> terrain{};  // ground that is not level (render/terrain/height_map.h); null: it is
    // That metaballs have between their centres and the lightning, beside other cloud; its key is not read.
    AddedDepth to_flash{};
};

}  // namespace nephos
