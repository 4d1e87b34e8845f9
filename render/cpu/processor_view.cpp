// SPDX-License-Identifier: Apache-2.0
#include "render/cpu/processor_view.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <ranges>
#include <vector>

#include <tbb/parallel_for.h>

#include "render/frame/billboard_textures.h"
#include "render/cpu/screen_ball.h"
#include "render/cpu/view_scene.h"
#include "render/frame/screen_box.h"
#include "render/frame/tile_bins.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/processor_view.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include "render/cpu/screen_ball-inl.h"
#include "render/cpu/screen_billboard-inl.h"
#include "render/cpu/tile_splats-inl.h"
#include "render/cpu/visibility-inl.h"

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(shape_balls);
HWY_EXPORT(shape_billboards);
HWY_EXPORT(light_balls);
HWY_EXPORT(light_billboards);
HWY_EXPORT(add_balls);
HWY_EXPORT(find_visible_balls);
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

void store(const TileSums& sums, const ViewTile& tile, const PicturePart& part, bool depth, Picture& picture) {
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
                             const PictureFrame& frame, const PicturePart& part, const ViewSortedSplats& order,
                             const BatchLimits& limits, StageTimes* times)
    : order_(&order), frame_(frame), part_(part), limits_(limits), times_(times) {
    const StageTimer timer(times_, DrawStage::eye_bins);
    if (!order.billboards.empty()) source_ = splats_near_to_far(order);
    boxes_ = screen_boxes(order, camera, options.camera, part, source_);
}

// Returns the element of splats_near_to_far() for a splat counted from the nearest.
std::uint32_t ProcessorView::source(std::size_t splat) const {
    return source_.empty() ? std::uint32_t(boxes_.size() - 1 - splat) : source_[splat];
}

// The shapes of splats [first, last) of a batch; its metaballs that are not fitted begin with `number`.
void ProcessorView::shape(Batch& batch, std::size_t first, std::size_t last, std::uint32_t number) const {
    std::vector<shader::ViewBall> balls;
    std::vector<const shader::ViewBillboard*> billboards;
    std::vector<ScreenBall*> screen;  // of these
    for (std::size_t i = first; i < last; ++i) {
        const std::uint32_t from = source(batch.begin + i);
        if ((from & kBillboardSplat) == 0) {
            balls.push_back(order_->balls[from]);
        } else {
            billboards.push_back(&order_->billboards[from & ~kBillboardSplat]);
            screen.push_back(&batch.screen[i]);
        }
    }
    std::vector<ScreenBall> shaped(billboards.empty() ? 0 : balls.size());
    HWY_DYNAMIC_DISPATCH(shape_balls)
    (balls, frame_, billboards.empty() ? &batch.screen[first] : shaped.data(), batch.exact.data(), number);
    HWY_DYNAMIC_DISPATCH(shape_billboards)(billboards, frame_, screen.data());
    std::size_t next = 0;
    for (std::size_t i = first; i < last; ++i) {
        ScreenBall& splat = batch.screen[i];
        if (!billboards.empty() && (source(batch.begin + i) & kBillboardSplat) == 0) splat = shaped[next++];
        splat.first = to_row(boxes_[batch.begin + i].y0);
        splat.end = to_row(boxes_[batch.begin + i].y1);
    }
}

// The shapes of some splats, and their lists.
ProcessorView::Batch ProcessorView::prepare_batch(std::size_t begin, std::size_t end) const {
    const StageTimer timer(times_, DrawStage::eye_bins);
    const std::size_t count = end - begin, parts = (count + kPart - 1) / kPart;
    Batch batch{begin, end, {}, {}, {}};
    std::vector<std::uint32_t> numbers(parts + 1, 0);
    if (!order_->all_fitted) {
        for (std::size_t i = 0; i < count; ++i) {
            const std::uint32_t from = source(begin + i);
            const bool exact =
                (from & kBillboardSplat) == 0 && (order_->balls[from].flags & shader::kNotFitted) != 0;
            numbers[i / kPart + 1] += exact ? 1 : 0;
        }
        for (std::size_t p = 0; p < parts; ++p) numbers[p + 1] += numbers[p];
    }
    batch.screen.resize(count);
    batch.exact.resize(numbers[parts]);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        shape(batch, p * kPart, std::min(count, (p + 1) * kPart), numbers[p]);
    });
    batch.bins = bin_into_tiles(std::span(boxes_).subspan(begin, count), TileGrid{part_.width, part_.height});
    if (times_ != nullptr)  // boxes written and read twice, balls read twice, shapes and lists written
        (*times_)[DrawStage::eye_bins].bytes +=
            count * (3 * sizeof(PixelBox) + 2 * sizeof(shader::ViewBall) + sizeof(ScreenBall)) +
            4 * batch.bins.list.size();
    return batch;
}

// Returns the billboards' texels; null without billboards, so that they are not generated.
const BillboardTexels* ProcessorView::texels() const {
    return source_.empty() ? nullptr : &billboard_texels(order_->pictures);
}

TileSums::TileSums(const PictureFrame& frame, int x, int y) : TileSums() {
    if (!(frame.sun_disc.w > 0)) return;
    const auto of = [](const shader::vec4& axis) { return Vec3(double(axis.x), double(axis.y), double(axis.z)); };
    const Vec3 right = of(frame.right), up = of(frame.up), forward = of(frame.forward), to_sun = of(frame.to_sun);
    // A chord of the unit sphere, from a place in the tile.
    const auto chord_to_sun = [&](double column, double row) {
        const double across = 2 * (column + x + double(frame.picture.z)) / double(frame.picture.x) - 1,
                     above = 1 - 2 * (row + y + double(frame.picture.w)) / double(frame.picture.y);
        return float(glm::distance(glm::normalize(forward + across * right + above * up), to_sun));
    };
    constexpr float kHalfTile = 10;  // pixels, at least half of its diagonal
    const float chord = chord_to_sun(0.5 * shader::kTileWidth, 0.5 * shader::kTileHeight) - kHalfTile / frame.up.w;
    if (opaque_beside_sun(frame, chord) == shader::kOpaque) return;
    for (std::size_t n = 0; n < kPixels; ++n)
        opaque[n] = opaque_beside_sun(
            frame, chord_to_sun(double(n % shader::kTileWidth) + 0.5, double(n / shader::kTileWidth) + 0.5));
}

void ProcessorView::light(Batch& batch, const VisibleSet* seen) const {
    const StageTimer timer(times_, DrawStage::colour);
    const std::size_t count = batch.end - batch.begin, parts = (count + kPart - 1) / kPart;
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        std::vector<shader::ViewBall> balls;
        std::vector<const shader::ViewBillboard*> billboards;
        std::vector<ScreenBall*> screen, screen_billboards;
        for (std::size_t i = p * kPart; i < std::min(count, (p + 1) * kPart); ++i) {
            const std::uint32_t from = source(batch.begin + i);
            if ((from & kBillboardSplat) != 0) {
                billboards.push_back(&order_->billboards[from & ~kBillboardSplat]);
                screen_billboards.push_back(&batch.screen[i]);
                continue;
            }
            if (seen != nullptr && seen->balls[from] == 0) continue;
            balls.push_back(order_->balls[from]);
            screen.push_back(&batch.screen[i]);
        }
        HWY_DYNAMIC_DISPATCH(light_balls)
        (balls, frame_, screen.data(), batch.exact.data());
        HWY_DYNAMIC_DISPATCH(light_billboards)(billboards, order_->clouds, frame_, screen_billboards.data());
    });
}

// Looks at every `step`-th tile from `first` on; notes in `drawn` how many of its balls are seen, and, given
// `seen`, what is seen. False if that is nearly everything.
bool ProcessorView::find_visible_in_tiles(std::size_t first, std::size_t step,
                                          std::vector<std::uint32_t>& drawn, VisibleSet* seen,
                                          int shadow_size) {
    const StageTimer timer(times_, DrawStage::look);
    const Batch& batch = kept_.front();
    const TileGrid grid{part_.width, part_.height};
    const ViewScene scene{.frame = &frame_,
                          .balls = batch.screen,
                          .exact = batch.exact,
                          .shadow_size = shadow_size,
                          .texels = texels()};
    const std::size_t count = first < grid.tiles() ? (grid.tiles() - first + step - 1) / step : 0;
    std::atomic<std::size_t> listed = 0, shown = 0, pairs = 0;
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
        const std::size_t t = first + i * step;
        const ViewTile tile = tile_at(t, grid, batch.bins);
        TileSums sums(frame_, tile.x, tile.y);
        const TileWork work = HWY_DYNAMIC_DISPATCH(find_visible_balls)(scene, tile, sums);
        pairs += work.pairs;
        drawn[t] = std::uint32_t(work.splats);
        listed += tile.list.size();
        shown += drawn[t];
        if (seen == nullptr) return;
        for (const std::uint32_t splat : tile.list.first(drawn[t]))
            if (const std::uint32_t from = source(splat); (from & kBillboardSplat) == 0)
                mark(seen->balls[from]);
        HWY_DYNAMIC_DISPATCH(mark_ground)(scene, tile, sums, seen->map_tiles.data());
    });
    if (times_ != nullptr) (*times_)[DrawStage::look].pairs += pairs;
    return double(shown) <= kMostSeen * double(listed);
}

void ProcessorView::find_visible(int shadow_size, VisibleSet& seen) {
    const TileGrid grid{part_.width, part_.height};
    const std::size_t end = end_of_batch(boxes_, 0, grid, limits_.boxes, limits_.entries);
    if (end == boxes_.size()) {  // more are not kept until they are drawn
        kept_.push_back(prepare_batch(0, end));
        std::vector<std::uint32_t> drawn(grid.tiles(), 0);
        if (find_visible_in_tiles(kSampleStep / 2, kSampleStep, drawn, nullptr, shadow_size)) {
            find_visible_in_tiles(0, 1, drawn, &seen, shadow_size);
            for (std::size_t t = 0; t < grid.tiles(); ++t)
                kept_.front().bins.ranges[t].end = kept_.front().bins.ranges[t].begin + drawn[t];
            return;
        }
    }
    std::ranges::fill(seen.balls, std::uint8_t{1});
    find_visible_ground(shadow_size, seen);
}

// As if there were no clouds before it.
void ProcessorView::find_visible_ground(int shadow_size, VisibleSet& seen) const {
    const StageTimer timer(times_, DrawStage::look);
    const TileGrid grid{part_.width, part_.height};
    const ViewScene scene{.frame = &frame_, .shadow_size = shadow_size};
    const TileSums nothing;
    TileBins bins;
    bins.ranges.resize(grid.tiles());
    tbb::parallel_for(std::size_t{0}, grid.tiles(), [&](std::size_t t) {
        HWY_DYNAMIC_DISPATCH(mark_ground)(scene, tile_at(t, grid, bins), nothing, seen.map_tiles.data());
    });
}

void ProcessorView::draw(Picture& picture, const float* shadow, int shadow_size, const AirShells& shells,
                         const VisibleSet* seen, const MarchedScene* march) {
    frame_.shells = shells.any() ? &shells : nullptr;
    frame_.endless = march != nullptr && march->repeats ? march : nullptr;
    const std::vector<std::uint32_t> before_shells = splats_before_shells(shells, *order_);
    const TileGrid grid{part_.width, part_.height};
    std::vector<TileSums> sums_between;  // batches
    std::vector<MarchState> march_between;
    std::size_t begin = 0;
    do {  // once even without any ball, for the background
        const std::size_t end = kept_.empty()
                                    ? end_of_batch(boxes_, begin, grid, limits_.boxes, limits_.entries)
                                    : kept_.front().end;
        Batch batch = kept_.empty() ? prepare_batch(begin, end) : std::move(kept_.front());
        light(batch, seen);
        const StageTimer timer(times_, DrawStage::view);
        const ViewScene scene{.frame = &frame_,
                              .balls = batch.screen,
                              .exact = batch.exact,
                              .shadow = shadow,
                              .shadow_size = shadow_size,
                              .before_shells = before_shells,
                              .first_ball = begin,
                              .texels = texels(),
                              .distances = order_->depth,
                              .march = march};
        const bool last = end == boxes_.size();
        if (begin == 0 && !last) {
            sums_between.resize(grid.tiles());
            if (march != nullptr) march_between.resize(grid.tiles());
        }
        std::atomic<std::size_t> pairs = 0;
        tbb::parallel_for(std::size_t{0}, grid.tiles(), [&](std::size_t t) {
            const ViewTile tile = tile_at(t, grid, batch.bins);
            TileSums own;
            TileSums& sums = sums_between.empty() ? own : sums_between[t];
            if (begin == 0) sums = TileSums(frame_, tile.x, tile.y);
            MarchState own_march;
            MarchState* const state = march == nullptr         ? nullptr
                                      : march_between.empty() ? &own_march
                                                              : &march_between[t];
            pairs += HWY_DYNAMIC_DISPATCH(add_balls)(scene, tile, sums, state).pairs;
            if (!last) return;
            HWY_DYNAMIC_DISPATCH(finish_tile)(scene, tile, sums, state);
            store(sums, tile, part_, order_->depth, picture);
        });
        if (times_ != nullptr) (*times_)[DrawStage::view].pairs += pairs;
        begin = end;
    } while (begin < boxes_.size());
    kept_.clear();
}

}  // namespace nephos
#endif
