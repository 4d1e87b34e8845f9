// SPDX-License-Identifier: Apache-2.0

// Compositing of a tile of the picture in vectors of pixels: splats front to back, shells of air between them, and the
// background behind (render/vulkan/view_tiles.comp).

#if defined(NEPHOS_RENDER_TILE_SPLATS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_TILE_SPLATS_INL_H_
#undef NEPHOS_RENDER_TILE_SPLATS_INL_H_
#else
#define NEPHOS_RENDER_TILE_SPLATS_INL_H_
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/cpu/billboard_pixels-inl.h"
#include "render/cpu/march-inl.h"
#include "render/cpu/screen_ball.h"
#include "render/cpu/tile_air-inl.h"
#include "render/cpu/view_scene.h"
#include "render/shading/background-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// sum += transmittance * opacity * radiance; transmittance *= 1 - opacity
HWY_INLINE void add_to_sums(TileSums& sums, std::size_t at, Floats opacity, const Floats3& radiance,
                            Floats distance) {
    const Lanes d;
    const Floats before = hn::Load(d, sums.transmittance + at), part = hn::Mul(before, opacity);
    hn::Store(hn::Sub(before, part), d, sums.transmittance + at);
    hn::Store(hn::MulAdd(part, radiance.x, hn::Load(d, sums.red + at)), d, sums.red + at);
    hn::Store(hn::MulAdd(part, radiance.y, hn::Load(d, sums.green + at)), d, sums.green + at);
    hn::Store(hn::MulAdd(part, radiance.z, hn::Load(d, sums.blue + at)), d, sums.blue + at);
    hn::Store(hn::MulAdd(part, distance, hn::Load(d, sums.distance + at)), d, sums.distance + at);
}

HWY_INLINE Rows rows_of(const ScreenBall& ball, const ViewTile& tile, const Layout& layout) {
    const int begin = std::clamp(ball.first - tile.y, 0, int(shader::kTileHeight)),
              end = std::clamp(ball.end - tile.y, 0, int(shader::kTileHeight));
    return {std::size_t(begin) / layout.rows * layout.rows, std::size_t(end)};
}

// Composites a vector of pixels of a splat; the visibility pre-pass (!kColours) updates transmittance alone.
template <bool kColours>
HWY_INLINE void add_opacity(TileSums& sums, std::size_t at, Floats opacity, const Floats3& radiance,
                            Floats distance) {
    if constexpr (kColours) {
        add_to_sums(sums, at, opacity, radiance, distance);
    } else {
        const Lanes d;
        const Floats before = hn::Load(d, sums.transmittance + at);
        hn::Store(hn::Sub(before, hn::Mul(before, opacity)), d, sums.transmittance + at);
    }
}

template <bool kColours>
HWY_INLINE void add_fitted(const ScreenBall& ball, const ViewTile& tile, const Layout& layout,
                           const FirstPixels* first, const TileRays& rays, TileSums& sums) {
    const Lanes d;
    const Rows rows = rows_of(ball, tile, layout);
    const Floats3 radiance{set(ball.red), set(ball.green), set(ball.blue)};
    const Floats distance = set(ball.distance), one = set(1.0f), yy = set(ball.yy);
    const Floats c0 = set(ball.fit[0]), c1 = set(ball.fit[1]), c2 = set(ball.fit[2]), c3 = set(ball.fit[3]),
                 c4 = set(ball.fit[4]), c5 = set(ball.fit[5]);
    for (std::size_t block = 0; block < layout.blocks; ++block) {
        const Floats dx = hn::Add(hn::Load(d, first[block].x), set(float(tile.x) - ball.x)),
                     down = hn::Add(hn::Load(d, first[block].y), set(float(tile.y) - ball.y));
        const Floats across = hn::Mul(hn::Mul(set(ball.xx), dx), dx), slope = hn::Mul(set(ball.xy), dx);
        for (std::size_t row = rows.begin; row < rows.end; row += layout.rows) {
            const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
            const Floats dy = hn::Add(down, set(float(row)));
            const Floats square = hn::MulAdd(dy, hn::MulAdd(yy, dy, slope), across);
            const Floats w =
                hn::Max(hn::NegMulAdd(square, hn::Load(d, rays.per_square + at), one), hn::Zero(d));
            const Floats w2 = hn::Mul(w, w);
            const Floats low = hn::MulAdd(w2, c2, hn::MulAdd(w, c1, c0)),
                         high = hn::MulAdd(w2, c5, hn::MulAdd(w, c4, c3));
            add_opacity<kColours>(sums, at, hn::Mul(w2, hn::MulAdd(hn::Mul(w2, w), high, low)), radiance,
                                  distance);
        }
    }
}

// render/shading/integral.glsl: the part of the ball between the eye and the ground.
HWY_INLINE Floats integrated_opacity(const ExactBall& ball, const Floats3& ray, Floats ground_m) {
    const Lanes d;
    const Floats3 centre{set(ball.x), set(ball.y), set(ball.z)}, offset = cross(centre, ray);
    const Floats zero = hn::Zero(d);
    const Floats w = hn::Max(hn::Sub(set(1.0f), dot(offset, offset)), zero);
    const Floats half_chord = hn::Sqrt(w), middle = dot(centre, ray);
    const Floats start = hn::Max(hn::Neg(half_chord), hn::Neg(middle));
    const Floats end = hn::Min(half_chord, hn::MulSub(ground_m, set(ball.per_radius), middle));
    const Floats part = hn::Sub(partial_line_integral(w, end), partial_line_integral(w, start));
    const Floats depth = hn::IfThenElseZero(hn::Lt(start, end), hn::Mul(set(ball.depth_scale), part));
    return hn::Sub(set(1.0f), hn::Exp(d, hn::Neg(hn::Max(depth, zero))));
}

template <bool kColours>
void add_exact(const ScreenBall& screen, const ExactBall& ball, const ViewTile& tile, const Layout& layout,
               const PictureFrame& frame, const TileRays& rays, TileSums& sums) {
    const Lanes d;
    const Rows rows = rows_of(screen, tile, layout);
    const Floats3 diffuse{set(ball.diffuse[0]), set(ball.diffuse[1]), set(ball.diffuse[2])},
        direct{set(ball.direct[0]), set(ball.direct[1]), set(ball.direct[2])};
    for (std::size_t at = rows.begin * shader::kTileWidth; at < rows.end * shader::kTileWidth;
         at += layout.lanes) {
        const Floats3 ray{hn::Load(d, rays.x + at), hn::Load(d, rays.y + at), hn::Load(d, rays.z + at)};
        const Floats opacity = integrated_opacity(ball, ray, hn::Load(d, rays.ground + at));
        if (hn::AllFalse(d, hn::Gt(opacity, hn::Zero(d)))) continue;
        const Floats3 once = scattered_once(frame, dot(set3(frame.to_sun), ray));
        add_opacity<kColours>(sums, at, opacity, each_times_add(once, direct, diffuse), set(ball.distance));
    }
}

inline bool is_opaque(const TileSums& sums, std::size_t lanes) {
    const Lanes d;
    Floats most = set(-1.0f);
    for (std::size_t at = 0; at < kTilePixels; at += lanes)
        most = hn::Max(most, hn::Sub(hn::Load(d, sums.transmittance + at), hn::Load(d, sums.opaque + at)));
    return hn::AllTrue(d, hn::Lt(most, hn::Zero(d)));
}

HWY_INLINE float distance_of(const ScreenBall& ball, const ViewScene& scene) {
    return ball.distance != 0 ? std::abs(ball.distance)
                              : scene.exact[std::bit_cast<std::uint32_t>(ball.x)].distance;
}

// Hides the pixels of a tile from splats beyond ground that is not level: their transmittance is 0 while one is drawn. The
// plane hides none, as without terrain.
class TerrainMask {
  public:
    TerrainMask(const PictureFrame& frame, const TileRays& rays) : any_(frame.terrain != nullptr) {
        if (!any_) return;
        for (std::size_t n = 0; n < kTilePixels; ++n) end_[n] = rays.open[n] > 0 ? kNowhere : rays.ground[n];
        nearest_ = *std::min_element(end_, end_ + kTilePixels);
        farthest_ = *std::max_element(end_, end_ + kTilePixels);
    }
    // Whether all pixels end before a distance, so that nothing beyond it is seen.
    bool ends_before(float distance_m) const { return any_ && farthest_ < distance_m; }
    bool hides_some(float distance_m) const { return any_ && nearest_ < distance_m; }
    void hide(float distance_m, TileSums& sums) {
        const Lanes d;
        for (std::size_t at = 0; at < kTilePixels; at += hn::Lanes(d)) {
            const Floats left = hn::Load(d, sums.transmittance + at);
            hn::Store(left, d, before_ + at);
            const auto seen = hn::Ge(hn::Load(d, end_ + at), set(distance_m));
            hn::Store(hn::IfThenElseZero(seen, left), d, sums.transmittance + at);
        }
    }
    void show(float distance_m, TileSums& sums) const {
        const Lanes d;
        for (std::size_t at = 0; at < kTilePixels; at += hn::Lanes(d)) {
            const auto seen = hn::Ge(hn::Load(d, end_ + at), set(distance_m));
            const Floats now = hn::Load(d, sums.transmittance + at);
            hn::Store(hn::IfThenElse(seen, now, hn::Load(d, before_ + at)), d, sums.transmittance + at);
        }
    }

  private:
    bool any_;
    float nearest_ = 0, farthest_ = 0;
    HWY_ALIGN float end_[kTilePixels];  // distances of terrain; kNowhere where there is none
    HWY_ALIGN float before_[kTilePixels] = {};
};

// Front to back, until the tile is opaque; what it took. Clouds with detail are marched meanwhile, if there are any.
template <bool kColours>
HWY_INLINE TileWork add_some(const ViewScene& scene, const ViewTile& tile, TileSums& sums,
                             MarchState* march = nullptr) {
    constexpr std::size_t kAtOnce = 8;  // between two looks at the sums
    const Layout layout;
    if (tile.list.empty() || is_opaque(sums, layout.lanes)) return {};
    for (const std::uint32_t splat : tile.list.first(std::min(kAtOnce, tile.list.size())))
        hwy::Prefetch(&scene.balls[splat]);
    const bool shells = kColours && !scene.before_shells.empty();
    const bool terrain = scene.frame->terrain != nullptr;
    TileRays rays(*scene.frame, tile, shells || march != nullptr || terrain || !scene.exact.empty());
    TerrainMask mask(*scene.frame, rays);
    if (shells) set_shell_offsets(*scene.frame, tile, rays);
    FirstPixels first[shader::kTileWidth] = {{layout, 0}, {layout, 1}, {layout, 2}, {layout, 3},
                                             {layout, 4}, {layout, 5}, {layout, 6}, {layout, 7}};
    std::size_t end = 0, rows = 0;
    bool ended = false;
    for (std::size_t begin = 0; begin < tile.list.size() && !ended; begin += kAtOnce) {
        end = std::min(begin + kAtOnce, tile.list.size());
        for (std::size_t i = begin; i < end; ++i) {
            if (i + kAtOnce < tile.list.size()) hwy::Prefetch(&scene.balls[tile.list[i + kAtOnce]]);
            const ScreenBall& ball = scene.balls[tile.list[i]];
            const float ball_m = terrain ? distance_of(ball, scene) : 0.0f;
            if (mask.ends_before(ball_m)) {
                ended = true;
                break;
            }
            if (shells) add_shells_before(scene, rays, scene.first_ball + tile.list[i], sums, march);
            if (march != nullptr) march_to(scene, rays, distance_of(ball, scene), *march, sums);
            const Rows of_ball = rows_of(ball, tile, layout);
            rows += of_ball.end - std::min(of_ball.begin, of_ball.end);
            const bool masked = mask.hides_some(ball_m);
            if (masked) mask.hide(ball_m, sums);
            if (ball.distance > 0) {
                add_fitted<kColours>(ball, tile, layout, first, rays, sums);
            } else if (ball.distance < 0) {
                add_billboard<kColours>(std::bit_cast<ScreenBillboard>(ball), of_ball, tile, layout, first,
                                        *scene.texels, scene.distances, sums);
            } else {
                const ExactBall& exact = scene.exact[std::bit_cast<std::uint32_t>(ball.x)];
                add_exact<kColours>(ball, exact, tile, layout, *scene.frame, rays, sums);
            }
            if (masked) mask.show(ball_m, sums);
        }
        if (is_opaque(sums, layout.lanes)) break;
    }
    return {end, rows * shader::kTileWidth};
}

inline TileWork add_balls(const ViewScene& scene, const ViewTile& tile, TileSums& sums, MarchState* march) {
    return add_some<true>(scene, tile, sums, march);
}
inline TileWork find_visible_balls(const ViewScene& scene, const ViewTile& tile, TileSums& sums) {
    return add_some<false>(scene, tile, sums);
}

// Adds what is seen of the background behind the clouds; distances become means.
inline void finish_tile(const ViewScene& scene, const ViewTile& tile, TileSums& sums, MarchState* march) {
    const Lanes d;
    const Layout layout;
    const ShadowTexels map{scene.shadow, scene.shadow_size};
    const bool shells = sums.next_shell < scene.before_shells.size();
    if ((shells || march != nullptr) && !is_opaque(sums, layout.lanes)) {
        TileRays rays(*scene.frame, tile, true);
        if (shells) set_shell_offsets(*scene.frame, tile, rays);
        if (shells) add_shells_before(scene, rays, SIZE_MAX, sums, march);
        if (march != nullptr) march_to(scene, rays, kNowhere, *march, sums);
    }
    std::optional<TileRays> ends;
    if (scene.frame->terrain != nullptr) ends.emplace(*scene.frame, tile, true);
    for (std::size_t block = 0; block < layout.blocks; ++block) {
        const FirstPixels first(layout, block);
        for (std::size_t row = 0; row < shader::kTileHeight; row += layout.rows) {
            const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
            const Floats left = hn::Min(hn::Load(d, sums.transmittance + at), set(1.0f));
            const Floats seen = hn::IfThenElseZero(hn::Ge(left, hn::Load(d, sums.opaque + at)), left);
            hn::Store(seen, d, sums.transmittance + at);
            const Floats opacity = hn::Sub(set(1.0f), seen);
            const auto has_depth = hn::Ge(opacity, set(kLeastOpacity));
            const Floats mean = hn::Div(hn::Load(d, sums.distance + at), opacity);
            const Floats infinity = set(std::numeric_limits<float>::infinity());
            hn::Store(hn::IfThenElse(has_depth, mean, infinity), d, sums.distance + at);
            if (hn::AllFalse(d, hn::Gt(seen, hn::Zero(d)))) continue;
            const Floats3 direction =
                pixel_direction(*scene.frame, hn::Add(hn::Load(d, first.x), set(float(tile.x))),
                                hn::Add(hn::Load(d, first.y), set(float(tile.y) + float(row))));
            const Floats3 ray = times(hn::Div(set(1.0f), hn::Sqrt(dot(direction, direction))), direction);
            Floats3 behind = background(*scene.frame, map, ray);
            if (ends) behind = times(hn::Load(d, ends->open + at), behind);  // terrain is drawn later
            hn::Store(hn::MulAdd(seen, behind.x, hn::Load(d, sums.red + at)), d, sums.red + at);
            hn::Store(hn::MulAdd(seen, behind.y, hn::Load(d, sums.green + at)), d, sums.green + at);
            hn::Store(hn::MulAdd(seen, behind.z, hn::Load(d, sums.blue + at)), d, sums.blue + at);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
