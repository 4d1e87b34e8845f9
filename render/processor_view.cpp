// SPDX-License-Identifier: Apache-2.0
#include "render/processor_view.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>
#include <vector>

#include <tbb/parallel_for.h>

#include "render/screen_ball.h"
#include "render/screen_box.h"
#include "render/tile_bins.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/processor_view.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/background-inl.h"
#include "render/column-inl.h"
#include "render/screen_ball-inl.h"

#ifndef NEPHOS_PROCESSOR_VIEW_TYPES_
#define NEPHOS_PROCESSOR_VIEW_TYPES_
namespace nephos {

// Sums over the metaballs in front, for the pixels of a tile row by row.
struct TileSums {
    static constexpr std::size_t kPixels = shader::kTileWidth * shader::kTileHeight;
    alignas(64) float red[kPixels] = {}, green[kPixels] = {}, blue[kPixels] = {}, distance[kPixels] = {};
    alignas(64) float transmittance[kPixels];
    TileSums() { std::fill_n(transmittance, kPixels, 1.0f); }
};

// What all tiles of a part of the picture share.
struct ViewScene {
    const shader::Frame* frame = nullptr;
    std::span<const ScreenBall> balls;  // nearest first
    std::span<const ExactBall> exact;
    const float* shadow = nullptr;
    int shadow_size = 0;
};

struct ViewTile {
    int x = 0, y = 0;                     // first pixel
    std::span<const std::uint32_t> list;  // of balls, nearest first
};

}  // namespace nephos
#endif

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// The pixels of a tile as the kernels need them.
struct TileRays {
    HWY_ALIGN float per_square[kTilePixels];  // 1 / |direction|^2
    HWY_ALIGN float x[kTilePixels], y[kTilePixels], z[kTilePixels], ground[kTilePixels];

    TileRays(const shader::Frame& frame, const ViewTile& tile, bool whole) {
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
            }
        }
    }
};

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

struct Rows {
    std::size_t begin, end;  // of the tile
};

HWY_INLINE Rows rows_of(const ScreenBall& ball, const ViewTile& tile, const Layout& layout) {
    const int begin = std::clamp(ball.first - tile.y, 0, int(shader::kTileHeight)),
              end = std::clamp(ball.end - tile.y, 0, int(shader::kTileHeight));
    return {std::size_t(begin) / layout.rows * layout.rows, std::size_t(end)};
}

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
            add_to_sums(sums, at, hn::Mul(w2, hn::MulAdd(hn::Mul(w2, w), high, low)), radiance, distance);
        }
    }
}

// shaders/integral.glsl: the part of the ball between the eye and the ground.
HWY_INLINE Floats integrated_opacity(const ExactBall& ball, const Floats3& ray, Floats ground_m) {
    const Lanes d;
    const Floats3 centre{set(ball.x), set(ball.y), set(ball.z)}, offset = cross(centre, ray);
    const Floats zero = hn::Zero(d);
    const Floats w = hn::Max(hn::Sub(set(1.0f), dot(offset, offset)), zero);
    const Floats half_chord = hn::Sqrt(w), middle = dot(centre, ray);
    const Floats start = hn::Max(hn::Neg(half_chord), hn::Neg(middle));
    const Floats end = hn::Min(half_chord, hn::MulSub(ground_m, set(ball.per_radius), middle));
    const Floats part = hn::Sub(column_part(w, end), column_part(w, start));
    const Floats depth = hn::IfThenElseZero(hn::Lt(start, end), hn::Mul(set(ball.depth_scale), part));
    return hn::Sub(set(1.0f), hn::Exp(d, hn::Neg(hn::Max(depth, zero))));
}

void add_exact(const ScreenBall& screen, const ExactBall& ball, const ViewTile& tile, const Layout& layout,
               const shader::Frame& frame, const TileRays& rays, TileSums& sums) {
    const Lanes d;
    const Rows rows = rows_of(screen, tile, layout);
    const Floats3 diffuse{set(ball.diffuse[0]), set(ball.diffuse[1]), set(ball.diffuse[2])},
        direct{set(ball.direct[0]), set(ball.direct[1]), set(ball.direct[2])};
    for (std::size_t at = rows.begin * shader::kTileWidth; at < rows.end * shader::kTileWidth;
         at += layout.lanes) {
        const Floats3 ray{hn::Load(d, rays.x + at), hn::Load(d, rays.y + at), hn::Load(d, rays.z + at)};
        const Floats opacity = integrated_opacity(ball, ray, hn::Load(d, rays.ground + at));
        if (hn::AllFalse(d, hn::Gt(opacity, hn::Zero(d)))) continue;
        add_to_sums(sums, at, opacity, times_add(phase_along(frame, ray), direct, diffuse),
                    set(ball.distance));
    }
}

bool is_opaque(const TileSums& sums, std::size_t lanes) {
    const Lanes d;
    Floats most = hn::Zero(d);
    for (std::size_t at = 0; at < kTilePixels; at += lanes)
        most = hn::Max(most, hn::Load(d, sums.transmittance + at));
    return hn::AllTrue(d, hn::Lt(most, set(shader::kOpaque)));
}

// Front to back, until the tile is opaque.
void add_balls(const ViewScene& scene, const ViewTile& tile, TileSums& sums) {
    constexpr std::size_t kAtOnce = 8;  // between two looks at the sums
    const Layout layout;
    if (tile.list.empty() || is_opaque(sums, layout.lanes)) return;
    const TileRays rays(*scene.frame, tile, !scene.exact.empty());
    FirstPixels first[shader::kTileWidth] = {{layout, 0}, {layout, 1}, {layout, 2}, {layout, 3},
                                             {layout, 4}, {layout, 5}, {layout, 6}, {layout, 7}};
    for (std::size_t begin = 0; begin < tile.list.size(); begin += kAtOnce) {
        const std::size_t end = std::min(begin + kAtOnce, tile.list.size());
        for (std::size_t i = begin; i < end; ++i) {
            if (i + kAtOnce < tile.list.size()) hwy::Prefetch(&scene.balls[tile.list[i + kAtOnce]]);
            const ScreenBall& ball = scene.balls[tile.list[i]];
            if (ball.distance > 0) {
                add_fitted(ball, tile, layout, first, rays, sums);
            } else {
                const ExactBall& exact = scene.exact[std::bit_cast<std::uint32_t>(ball.x)];
                add_exact(ball, exact, tile, layout, *scene.frame, rays, sums);
            }
        }
        if (is_opaque(sums, layout.lanes)) break;
    }
}

// Adds what is seen of the background behind the clouds; distances become means.
void finish_tile(const ViewScene& scene, const ViewTile& tile, TileSums& sums) {
    const Lanes d;
    const Layout layout;
    const ShadowTexels map{scene.shadow, scene.shadow_size};
    for (std::size_t block = 0; block < layout.blocks; ++block) {
        const FirstPixels first(layout, block);
        for (std::size_t row = 0; row < shader::kTileHeight; row += layout.rows) {
            const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
            const Floats left = hn::Min(hn::Load(d, sums.transmittance + at), set(1.0f));
            const Floats seen = hn::IfThenElseZero(hn::Ge(left, set(shader::kOpaque)), left);
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
            const Floats3 behind = background(*scene.frame, map, ray);
            hn::Store(hn::MulAdd(seen, behind.x, hn::Load(d, sums.red + at)), d, sums.red + at);
            hn::Store(hn::MulAdd(seen, behind.y, hn::Load(d, sums.green + at)), d, sums.green + at);
            hn::Store(hn::MulAdd(seen, behind.z, hn::Load(d, sums.blue + at)), d, sums.blue + at);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(prepare_balls);
HWY_EXPORT(add_balls);
HWY_EXPORT(finish_tile);

namespace {

std::int16_t to_row(int y) { return std::int16_t(std::clamp(y, -32768, 32767)); }

struct PreparedBalls {
    std::vector<ScreenBall> screen;  // nearest first
    std::vector<ExactBall> exact;
};

// `balls`: farthest first.
PreparedBalls prepare(std::span<const shader::ViewBall> balls, std::span<const PixelBox> boxes,
                      const shader::Frame& frame) {
    constexpr std::size_t kPart = 2048;
    const std::size_t count = balls.size(), parts = (count + kPart - 1) / kPart;
    std::vector<std::uint32_t> numbers(parts + 1, 0);
    for (std::size_t i = 0; i < count; ++i)
        numbers[i / kPart + 1] += (balls[count - 1 - i].flags & shader::kNotFitted) != 0 ? 1 : 0;
    for (std::size_t p = 0; p < parts; ++p) numbers[p + 1] += numbers[p];
    PreparedBalls prepared;
    prepared.screen.resize(count);
    prepared.exact.resize(numbers[parts]);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        const std::size_t begin = p * kPart, end = std::min(count, begin + kPart);
        const std::vector<shader::ViewBall> near_first(balls.rbegin() + std::ptrdiff_t(begin),
                                                       balls.rbegin() + std::ptrdiff_t(end));
        HWY_DYNAMIC_DISPATCH(prepare_balls)
        (near_first, frame, &prepared.screen[begin], prepared.exact.data(), numbers[p]);
        for (std::size_t i = begin; i < end; ++i) {
            prepared.screen[i].first = to_row(boxes[i].y0);
            prepared.screen[i].end = to_row(boxes[i].y1);
        }
    });
    return prepared;
}

void store(const TileSums& sums, const ViewTile& tile, const Tile& part, bool depth, Picture& picture) {
    const int columns = std::min(int(shader::kTileWidth), part.width - tile.x),
              rows = std::min(int(shader::kTileHeight), part.height - tile.y);
    for (int y = 0; y < rows; ++y) {
        std::size_t from = std::size_t(y) * shader::kTileWidth;
        std::size_t to =
            std::size_t(part.y + tile.y + y) * std::size_t(picture.width) + std::size_t(part.x + tile.x);
        for (int x = 0; x < columns; ++x, ++from, ++to) {
            picture.beauty[3 * to] = sums.red[from];
            picture.beauty[3 * to + 1] = sums.green[from];
            picture.beauty[3 * to + 2] = sums.blue[from];
            picture.transmittance[to] = sums.transmittance[from];
            picture.depth_m[to] = depth ? sums.distance[from] : std::numeric_limits<float>::infinity();
        }
    }
}

}  // namespace

void view_by_processor(const RenderOptions& options, const CameraFrame& camera, const shader::Frame& frame,
                       const Tile& part, const EyeOrder& order, Picture& picture, const BatchLimits& limits) {
    const TileGrid grid{part.width, part.height};
    const std::vector<PixelBox> boxes = screen_boxes(order, camera, options.camera, part);
    std::vector<TileSums> kept;  // between batches
    std::size_t begin = 0;
    do {  // once even without any ball, for the background
        const std::size_t end = end_of_batch(boxes, begin, grid, limits.boxes, limits.entries);
        const std::span some = std::span(boxes).subspan(begin, end - begin);
        const PreparedBalls balls =
            prepare(std::span(order.balls).subspan(boxes.size() - end, end - begin), some, frame);
        const TileBins bins = bin_into_tiles(some, grid);
        const ViewScene scene{&frame, balls.screen, balls.exact, picture.shadow.data(), picture.shadow_size};
        const bool last = end == boxes.size();
        if (begin == 0 && !last) kept.resize(grid.tiles());
        tbb::parallel_for(std::size_t{0}, grid.tiles(), [&](std::size_t t) {
            const auto columns = std::size_t(grid.columns());
            const shader::TileRange range = bins.ranges[t];
            const ViewTile tile{int(t % columns) * int(shader::kTileWidth),
                                int(t / columns) * int(shader::kTileHeight),
                                std::span(bins.list).subspan(range.begin, range.end - range.begin)};
            TileSums own;
            TileSums& sums = kept.empty() ? own : kept[t];
            HWY_DYNAMIC_DISPATCH(add_balls)(scene, tile, sums);
            if (!last) return;
            HWY_DYNAMIC_DISPATCH(finish_tile)(scene, tile, sums);
            store(sums, tile, part, order.depth, picture);
        });
        begin = end;
    } while (begin < boxes.size());
}

}  // namespace nephos
#endif
