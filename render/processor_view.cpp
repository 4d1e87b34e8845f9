// SPDX-License-Identifier: Apache-2.0
#include "render/processor_view.h"

#include <algorithm>
#include <atomic>
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
    const PictureFrame* frame = nullptr;
    std::span<const ScreenBall> balls;  // nearest first
    std::span<const ExactBall> exact;
    const float* shadow = nullptr;
    int shadow_size = 0;
};

// Many threads may.
inline void mark(std::uint8_t& byte) {
    const std::atomic_ref<std::uint8_t> shared(byte);
    if (shared.load(std::memory_order_relaxed) == 0) shared.store(1, std::memory_order_relaxed);
}

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

// Of a look, which only wants to know what is seen, the transmittance.
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
        const Floats once = scattered_once(frame, dot(set3(frame.to_sun), ray));
        add_opacity<kColours>(sums, at, opacity, times_add(once, direct, diffuse), set(ball.distance));
    }
}

bool is_opaque(const TileSums& sums, std::size_t lanes) {
    const Lanes d;
    Floats most = hn::Zero(d);
    for (std::size_t at = 0; at < kTilePixels; at += lanes)
        most = hn::Max(most, hn::Load(d, sums.transmittance + at));
    return hn::AllTrue(d, hn::Lt(most, set(shader::kOpaque)));
}

// Front to back, until the tile is opaque; how many it took.
template <bool kColours>
HWY_INLINE std::size_t add_some(const ViewScene& scene, const ViewTile& tile, TileSums& sums) {
    constexpr std::size_t kAtOnce = 8;  // between two looks at the sums
    const Layout layout;
    if (tile.list.empty() || is_opaque(sums, layout.lanes)) return 0;
    const TileRays rays(*scene.frame, tile, !scene.exact.empty());
    FirstPixels first[shader::kTileWidth] = {{layout, 0}, {layout, 1}, {layout, 2}, {layout, 3},
                                             {layout, 4}, {layout, 5}, {layout, 6}, {layout, 7}};
    std::size_t end = 0;
    for (std::size_t begin = 0; begin < tile.list.size(); begin += kAtOnce) {
        end = std::min(begin + kAtOnce, tile.list.size());
        for (std::size_t i = begin; i < end; ++i) {
            if (i + kAtOnce < tile.list.size()) hwy::Prefetch(&scene.balls[tile.list[i + kAtOnce]]);
            const ScreenBall& ball = scene.balls[tile.list[i]];
            if (ball.distance > 0) {
                add_fitted<kColours>(ball, tile, layout, first, rays, sums);
            } else {
                const ExactBall& exact = scene.exact[std::bit_cast<std::uint32_t>(ball.x)];
                add_exact<kColours>(ball, exact, tile, layout, *scene.frame, rays, sums);
            }
        }
        if (is_opaque(sums, layout.lanes)) break;
    }
    return end;
}

void add_balls(const ViewScene& scene, const ViewTile& tile, TileSums& sums) {
    add_some<true>(scene, tile, sums);
}
std::size_t look_at_balls(const ViewScene& scene, const ViewTile& tile, TileSums& sums) {
    return add_some<false>(scene, tile, sums);
}

// Marks the tiles of the shadow map that the ground wears where it is seen.
void mark_ground(const ViewScene& scene, const ViewTile& tile, const TileSums& sums, std::uint8_t* marks) {
    const Lanes d;
    const hn::RebindToSigned<Lanes> di;
    const Layout layout;
    const PictureFrame& frame = *scene.frame;
    const Floats size = set(float(scene.shadow_size)), last = set(float(scene.shadow_size - 1));
    const int columns = TileGrid{scene.shadow_size, scene.shadow_size}.columns();
    int marked = -1;
    for (std::size_t at = 0; at < kTilePixels; at += layout.lanes) {
        const FirstPixels first(layout, at / layout.lanes % layout.blocks);
        const float row = float(at / (layout.lanes * layout.blocks) * layout.rows);
        const Floats3 direction = pixel_direction(frame, hn::Add(hn::Load(d, first.x), set(float(tile.x))),
                                                  hn::Add(hn::Load(d, first.y), set(float(tile.y) + row)));
        const Floats3 ray = times(hn::Div(set(1.0f), hn::Sqrt(dot(direction, direction))), direction);
        const Floats distance = ground_distance(frame, ray.z);
        const auto shown = hn::And(hn::Lt(distance, set(kNowhere)),
                                   hn::Ge(hn::Load(d, sums.transmittance + at), set(shader::kOpaque)));
        if (hn::AllFalse(d, shown)) continue;
        const Floats3 point = times(hn::IfThenElseZero(shown, distance), ray);
        const auto texel = [&](const shader::vec4& axis) {
            const Floats place = hn::Add(dot(set3(axis), point), set(axis.w));
            return hn::Floor(hn::Min(hn::Max(hn::MulSub(place, size, set(0.5f)), set(-2.0f)), last));
        };
        HWY_ALIGN std::int32_t x[2 * shader::kTileWidth], y[2 * shader::kTileWidth];
        hn::Store(hn::ConvertTo(di, texel(frame.shadow_u)), di, x);
        hn::Store(hn::ConvertTo(di, texel(frame.shadow_v)), di, y);
        HWY_ALIGN float is_shown[2 * shader::kTileWidth];
        hn::Store(hn::IfThenElseZero(shown, set(1.0f)), d, is_shown);
        for (std::size_t lane = 0; lane < layout.lanes; ++lane) {
            if (!(is_shown[lane] > 0) || (x[lane] << 16 ^ y[lane]) == marked) continue;
            marked = x[lane] << 16 ^ y[lane];
            for (const int column : {std::max(x[lane], 0), std::min(x[lane] + 1, scene.shadow_size - 1)})
                for (const int line : {std::max(y[lane], 0), std::min(y[lane] + 1, scene.shadow_size - 1)})
                    mark(marks[line / int(shader::kTileHeight) * columns + column / int(shader::kTileWidth)]);
        }
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

HWY_EXPORT(shape_balls);
HWY_EXPORT(light_balls);
HWY_EXPORT(add_balls);
HWY_EXPORT(look_at_balls);
HWY_EXPORT(mark_ground);
HWY_EXPORT(finish_tile);

namespace {

constexpr std::size_t kPart = 2048;  // balls that one thread prepares

// A look pays if it saves light: it goes on only if of some tiles' lists no more than this is seen.
constexpr double kMostSeen = 0.75;
constexpr std::size_t kSampleStep = 16;  // tiles from one that is tried to the next

std::int16_t to_row(int y) { return std::int16_t(std::clamp(y, -32768, 32767)); }

ViewTile tile_at(std::size_t t, const TileGrid& grid, const TileBins& bins) {
    const auto columns = std::size_t(grid.columns());
    const shader::TileRange range = bins.ranges[t];
    return {int(t % columns) * int(shader::kTileWidth), int(t / columns) * int(shader::kTileHeight),
            std::span(bins.list).subspan(range.begin, range.end - range.begin)};
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

ProcessorView::ProcessorView(const RenderOptions& options, const CameraFrame& camera,
                             const PictureFrame& frame, const Tile& part, const EyeOrder& order,
                             const BatchLimits& limits, StageTimes* times)
    : options_(&options),
      camera_(&camera),
      order_(&order),
      frame_(frame),
      part_(part),
      limits_(limits),
      times_(times) {
    const StageTimer timer(times_, DrawStage::eye_bins);
    boxes_ = screen_boxes(order, camera, options.camera, part);
}

// The shapes of some balls, and their lists.
ProcessorView::Batch ProcessorView::prepare_batch(std::size_t begin, std::size_t end) const {
    const StageTimer timer(times_, DrawStage::eye_bins);
    const std::size_t count = end - begin, parts = (count + kPart - 1) / kPart;
    const std::span balls = std::span(order_->balls).subspan(boxes_.size() - end, count);  // farthest first
    Batch batch{begin, end, {}, {}, {}};
    std::vector<std::uint32_t> numbers(parts + 1, 0);
    if (!order_->all_fitted) {
        for (std::size_t i = 0; i < count; ++i)
            numbers[i / kPart + 1] += (balls[count - 1 - i].flags & shader::kNotFitted) != 0 ? 1 : 0;
        for (std::size_t p = 0; p < parts; ++p) numbers[p + 1] += numbers[p];
    }
    batch.screen.resize(count);
    batch.exact.resize(numbers[parts]);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        const std::size_t first = p * kPart, last = std::min(count, first + kPart);
        const std::vector<shader::ViewBall> near_first(balls.rbegin() + std::ptrdiff_t(first),
                                                       balls.rbegin() + std::ptrdiff_t(last));
        HWY_DYNAMIC_DISPATCH(shape_balls)
        (near_first, frame_, &batch.screen[first], batch.exact.data(), numbers[p]);
        for (std::size_t i = first; i < last; ++i) {
            batch.screen[i].first = to_row(boxes_[begin + i].y0);
            batch.screen[i].end = to_row(boxes_[begin + i].y1);
        }
    });
    batch.bins = bin_into_tiles(std::span(boxes_).subspan(begin, count), TileGrid{part_.width, part_.height});
    return batch;
}

void ProcessorView::light(Batch& batch, const SeenLight* seen) const {
    const StageTimer timer(times_, DrawStage::colour);
    const std::size_t count = batch.end - batch.begin, parts = (count + kPart - 1) / kPart;
    const std::size_t last = boxes_.size() - 1 - batch.begin;  // of the order: the batch's nearest ball
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        std::vector<shader::ViewBall> balls;
        std::vector<ScreenBall*> screen;
        for (std::size_t i = p * kPart; i < std::min(count, (p + 1) * kPart); ++i) {
            if (seen != nullptr && seen->balls[last - i] == 0) continue;
            balls.push_back(order_->balls[last - i]);
            screen.push_back(&batch.screen[i]);
        }
        HWY_DYNAMIC_DISPATCH(light_balls)(balls, frame_, screen.data(), batch.exact.data());
    });
}

// Looks at every `step`-th tile from `first` on; notes in `drawn` how many of its balls are seen, and, given
// `seen`, what is seen. False if that is nearly everything.
bool ProcessorView::look_at_tiles(std::size_t first, std::size_t step, std::vector<std::uint32_t>& drawn,
                                  SeenLight* seen, int shadow_size) {
    const StageTimer timer(times_, DrawStage::look);
    const Batch& batch = kept_.front();
    const TileGrid grid{part_.width, part_.height};
    const ViewScene scene{&frame_, batch.screen, batch.exact, nullptr, shadow_size};
    const std::size_t count = first < grid.tiles() ? (grid.tiles() - first + step - 1) / step : 0;
    std::atomic<std::size_t> listed = 0, shown = 0;
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
        const std::size_t t = first + i * step;
        const ViewTile tile = tile_at(t, grid, batch.bins);
        TileSums sums;
        drawn[t] = std::uint32_t(HWY_DYNAMIC_DISPATCH(look_at_balls)(scene, tile, sums));
        listed += tile.list.size();
        shown += drawn[t];
        if (seen == nullptr) return;
        for (const std::uint32_t ball : tile.list.first(drawn[t]))
            mark(seen->balls[boxes_.size() - 1 - ball]);
        HWY_DYNAMIC_DISPATCH(mark_ground)(scene, tile, sums, seen->map_tiles.data());
    });
    return double(shown) <= kMostSeen * double(listed);
}

void ProcessorView::look(int shadow_size, SeenLight& seen) {
    const TileGrid grid{part_.width, part_.height};
    const std::size_t end = end_of_batch(boxes_, 0, grid, limits_.boxes, limits_.entries);
    if (end == boxes_.size()) {  // more are not kept until they are drawn
        kept_.push_back(prepare_batch(0, end));
        std::vector<std::uint32_t> drawn(grid.tiles(), 0);
        if (look_at_tiles(kSampleStep / 2, kSampleStep, drawn, nullptr, shadow_size)) {
            look_at_tiles(0, 1, drawn, &seen, shadow_size);
            for (std::size_t t = 0; t < grid.tiles(); ++t)
                kept_.front().bins.ranges[t].end = kept_.front().bins.ranges[t].begin + drawn[t];
            return;
        }
    }
    std::ranges::fill(seen.balls, std::uint8_t{1});
    look_at_ground(shadow_size, seen);
}

// As if there were no clouds before it.
void ProcessorView::look_at_ground(int shadow_size, SeenLight& seen) const {
    const StageTimer timer(times_, DrawStage::look);
    const TileGrid grid{part_.width, part_.height};
    const ViewScene scene{&frame_, {}, {}, nullptr, shadow_size};
    const TileSums nothing;
    TileBins bins;
    bins.ranges.resize(grid.tiles());
    tbb::parallel_for(std::size_t{0}, grid.tiles(), [&](std::size_t t) {
        HWY_DYNAMIC_DISPATCH(mark_ground)(scene, tile_at(t, grid, bins), nothing, seen.map_tiles.data());
    });
}

void ProcessorView::draw(Picture& picture, const float* shadow, int shadow_size, const SeenLight* seen) {
    const TileGrid grid{part_.width, part_.height};
    std::vector<TileSums> sums_between;  // batches
    std::size_t begin = 0;
    do {  // once even without any ball, for the background
        const std::size_t end = kept_.empty()
                                    ? end_of_batch(boxes_, begin, grid, limits_.boxes, limits_.entries)
                                    : kept_.front().end;
        Batch batch = kept_.empty() ? prepare_batch(begin, end) : std::move(kept_.front());
        light(batch, seen);
        const StageTimer timer(times_, DrawStage::view);
        const ViewScene scene{&frame_, batch.screen, batch.exact, shadow, shadow_size};
        const bool last = end == boxes_.size();
        if (begin == 0 && !last) sums_between.resize(grid.tiles());
        tbb::parallel_for(std::size_t{0}, grid.tiles(), [&](std::size_t t) {
            const ViewTile tile = tile_at(t, grid, batch.bins);
            TileSums own;
            TileSums& sums = sums_between.empty() ? own : sums_between[t];
            HWY_DYNAMIC_DISPATCH(add_balls)(scene, tile, sums);
            if (!last) return;
            HWY_DYNAMIC_DISPATCH(finish_tile)(scene, tile, sums);
            store(sums, tile, part_, order_->depth, picture);
        });
        begin = end;
    } while (begin < boxes_.size());
    kept_.clear();
}

void view_by_processor(const RenderOptions& options, const CameraFrame& camera, const PictureFrame& frame,
                       const Tile& part, const EyeOrder& order, Picture& picture, const BatchLimits& limits) {
    ProcessorView(options, camera, frame, part, order, limits)
        .draw(picture, picture.shadow.data(), picture.shadow_size);
}

}  // namespace nephos
#endif
