// SPDX-License-Identifier: Apache-2.0

// Shells of air over the pixels of a tile (processor_view.cpp), and what the kernels know of these pixels.

#if defined(NEPHOS_RENDER_TILE_AIR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_TILE_AIR_INL_H_
#undef NEPHOS_RENDER_TILE_AIR_INL_H_
#else
#define NEPHOS_RENDER_TILE_AIR_INL_H_
#endif

#include <array>
#include <cstddef>

#include <hwy/highway.h>

#include "render/cpu/view_scene.h"
#include "render/shading/background-inl.h"
#include "render/shading/formulas-inl.h"
#include "render/shading/shells-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// The pixels of a tile as the kernels need them.
struct TileRays {
    HWY_ALIGN float per_square[kTilePixels];  // 1 / |direction|^2
    HWY_ALIGN float x[kTilePixels], y[kTilePixels], z[kTilePixels], ground[kTilePixels];
    HWY_ALIGN float shell_offset[kTilePixels];  // where in shells of air these pixels sample them
    HWY_ALIGN float open[kTilePixels];          // 0 where a ray ends at ground that is not level, else 1

    TileRays(const PictureFrame& frame, const ViewTile& tile, bool whole) {
        const Lanes d;
        const Layout layout;
        for (std::size_t block = 0; block < layout.blocks; ++block) {
            const FirstPixels first(layout, block);
            for (std::size_t row = 0; row < shader::kTileHeight; row += layout.rows) {
                const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
                const Floats3 direction =
                    pixel_direction(frame, hn::Add(hn::Load(d, first.x), set(float(tile.x))),
                                    hn::Add(hn::Load(d, first.y), set(float(tile.y) + float(row))));
                const Floats per = hn::Div(set(1.0f), dot(direction, direction));
                hn::Store(per, d, per_square + at);
                if (!whole) continue;
                const Floats3 ray = times(hn::Sqrt(per), direction);
                hn::Store(ray.x, d, x + at);
                hn::Store(ray.y, d, y + at);
                hn::Store(ray.z, d, z + at);
                hn::Store(ground_distance(frame, ray.z), d, ground + at);
                hn::Store(set(1.0f), d, open + at);
            }
        }
        if (whole && frame.terrain != nullptr) end_at_terrain(frame, tile);
    }

    // Pixels beyond the picture's sides, of which tiles have some, keep the plane.
    void end_at_terrain(const PictureFrame& frame, const ViewTile& tile) {
        const auto width = std::size_t(frame.picture.x), height = std::size_t(frame.picture.y);
        const std::size_t left = std::size_t(frame.picture.z) + std::size_t(tile.x),
                          top = std::size_t(frame.picture.w) + std::size_t(tile.y);
        const Layout layout;
        for (std::size_t block = 0; block < layout.blocks; ++block) {
            for (std::size_t row = 0; row < shader::kTileHeight; row += layout.rows) {
                for (std::size_t lane = 0; lane < layout.lanes; ++lane) {
                    const std::size_t pixel = block * layout.lanes + lane;
                    const std::size_t column = left + pixel % shader::kTileWidth,
                                      line = top + row + pixel / shader::kTileWidth;
                    if (column >= width || line >= height) continue;
                    const std::size_t at = row * shader::kTileWidth + block * layout.lanes + lane;
                    const float end = frame.terrain[line * width + column];
                    if (!(end < kNowhere)) continue;
                    ground[at] = end;
                    open[at] = 0;
                }
            }
        }
    }
};

// Sets the positions at which the pixels of a tile sample shells of air.
inline void set_shell_offsets(const PictureFrame& frame, const ViewTile& tile, TileRays& rays) {
    const Layout layout;
    const auto x = shader::uint(frame.picture.z) + shader::uint(tile.x),
               y = shader::uint(frame.picture.w) + shader::uint(tile.y);
    for (shader::uint block = 0; block < layout.blocks; ++block) {
        for (shader::uint row = 0; row < shader::kTileHeight; row += shader::uint(layout.rows)) {
            float* const to = rays.shell_offset + row * shader::kTileWidth + block * layout.lanes;
            for (shader::uint lane = 0; lane < layout.lanes; ++lane) {
                const shader::uint pixel = block * shader::uint(layout.lanes) + lane;
                to[lane] = shader::shell_offset(x + pixel % shader::kTileWidth,
                                                y + row + pixel / shader::kTileWidth);
            }
        }
    }
}

// sum += transmittance * light; transmittance *= that of the layer
HWY_INLINE void add_layer(const AirLayer& layer, Floats3& sum, Floats& transmittance) {
    sum = times_add(transmittance, layer.light, sum);
    transmittance = hn::Mul(transmittance, layer.transmittance);
}

// Shells of air [first, end) over one vector of pixels.
HWY_INLINE void add_shells_to(const ViewScene& scene, const TileRays& rays, std::size_t at, std::size_t first,
                              std::size_t end, TileSums& sums) {
    const Lanes d;
    const PictureFrame& frame = *scene.frame;
    const shader::Shells& data = frame.shells->data;
    Floats transmittance = hn::Load(d, sums.transmittance + at);
    if (hn::AllTrue(d, hn::Lt(transmittance, hn::Load(d, sums.opaque + at)))) return;
    const Floats3 ray{hn::Load(d, rays.x + at), hn::Load(d, rays.y + at), hn::Load(d, rays.z + at)};
    const AirInterval part = interval_with_air(*frame.shells, frame.endless, ray);
    if (part.begin >= part.end) return;
    const RayAir of(frame, ray);
    const Floats ground = air_end(frame, ray.z, hn::Load(d, rays.ground + at)), offset = hn::Load(d, rays.shell_offset + at);
    Floats3 sum{hn::Load(d, sums.red + at), hn::Load(d, sums.green + at), hn::Load(d, sums.blue + at)};
    const Floats first_m = air_begin(frame, ray);
    const auto within = [&](float distance_m) { return hn::Min(hn::Max(set(distance_m), first_m), ground); };
    Floats3 before{};
    Floats distance = hn::Load(d, sums.distance + at);
    bool begun = false;
    for (std::size_t k = first; k < end; ++k) {
        const float begin_m = k == 0 ? 0.0f : shell_end(data, k - 1), end_m = shell_end(data, k);
        if (end_m <= part.begin) continue;
        if (begin_m >= part.end) break;
        const Floats shell_begins = within(begin_m), shell_ends = within(end_m);
        if (!begun) before = clear_air(frame, ray, shell_begins);
        begun = true;
        const bool whole = frame.sky == nullptr && hn::AllTrue(d, hn::Eq(shell_ends, set(end_m)));
        const std::array<float, 3>& clear = frame.shells->clear[k];
        const Floats3 behind =
            whole ? Floats3{set(clear[0]), set(clear[1]), set(clear[2])} : clear_air(frame, ray, shell_ends);
        const AirLayer layer =
            air_layer<Heights::alike>(frame, of, before, behind, shell_begins, shell_ends, offset);
        const Floats hidden = hn::Mul(transmittance, hn::Sub(set(1.0f), layer.transmittance));
        distance = hn::MulAdd(hidden, layer.distance, distance);
        add_layer(layer, sum, transmittance);
        before = behind;
    }
    if (!begun) return;
    hn::Store(distance, d, sums.distance + at);
    hn::Store(transmittance, d, sums.transmittance + at);
    hn::Store(sum.x, d, sums.red + at);
    hn::Store(sum.y, d, sums.green + at);
    hn::Store(sum.z, d, sums.blue + at);
}

inline void march_to(const ViewScene& scene, const TileRays& rays, float limit_m, MarchState& state, TileSums& sums);

// All shells in front of a ball that are not in the sums yet; before each, the clouds with detail in front of its end.
inline void add_shells_before(const ViewScene& scene, const TileRays& rays, std::size_t ball, TileSums& sums,
                              MarchState* march) {
    const std::size_t count = scene.before_shells.size();
    while (sums.next_shell < count && scene.before_shells[sums.next_shell] <= ball) {
        const std::size_t first = sums.next_shell++;
        if (march != nullptr && !march->done) {
            march_to(scene, rays, shell_end(scene.frame->shells->data, first), *march, sums);
        } else {
            while (sums.next_shell < count && scene.before_shells[sums.next_shell] <= ball) ++sums.next_shell;
        }
        for (std::size_t at = 0; at < kTilePixels; at += hn::Lanes(Lanes()))
            add_shells_to(scene, rays, at, first, sums.next_shell, sums);
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
