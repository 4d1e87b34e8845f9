// SPDX-License-Identifier: Apache-2.0
#include "render/backend/processor_light.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include <tbb/parallel_for.h>

#include "render/frame/tile_bins.h"
#include "render/shared/half_floats.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/backend/processor_light.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/shading/formulas-inl.h"

#ifndef NEPHOS_PROCESSOR_LIGHT_TYPES_
#define NEPHOS_PROCESSOR_LIGHT_TYPES_
namespace nephos {

// A metaball on the shadow map; half a cache line.
struct LightBall {
    float x, y;               // texels
    float per_x2, per_y2;     // 1 / radius^2 along both axes, texels
    float z, per_radius;      // metres from the first centre; 1 / radius in metres
    float depth_scale;        // of the splat
    std::int16_t first, end;  // rows of the map
};
static_assert(sizeof(LightBall) == 32);

// Centres in one tile, in order from the sun. `depth` is added to.
struct LightCentres {
    std::span<const float> x, y, z;
    std::span<float> depth;
};

// Optical depths beyond these count as these: they change nothing that is seen, but end the sums. A texel
// of the map has 4e-8 then; light that was scattered often reaches deeper.
inline constexpr float kDarkTexel = 17.0f, kDarkCentre = 1000.0f;
inline constexpr std::size_t kAtOnce = 16;  // balls between two looks at the sums

// One tile of the map.
struct LightTile {
    int x = 0, y = 0;                  // first texel
    std::span<const LightBall> balls;  // in order from the sun
    float largest_radius = 0;          // metres
};

}  // namespace nephos
#endif

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// Adds the optical depth of some balls along the light through the texels of a tile.
HWY_INLINE std::size_t add_to_texels(const LightTile& tile, std::span<const LightBall> balls,
                                     const Layout& layout, std::size_t block, float* HWY_RESTRICT sums) {
    const Lanes d;
    const FirstPixels first(layout, block);
    const Floats x = hn::Add(hn::Load(d, first.x), set(float(tile.x))),
                 y = hn::Add(hn::Load(d, first.y), set(float(tile.y)));
    std::size_t vectors = 0;
    for (const LightBall& ball : balls) {
        const int row0 = std::max(0, ball.first - tile.y),
                  row1 = std::min(int(shader::kTileHeight), ball.end - tile.y);
        const Floats dx = hn::Sub(x, set(ball.x)), scale = set(ball.depth_scale);
        const Floats across = hn::NegMulAdd(hn::Mul(set(ball.per_x2), dx), dx, set(1.0f));
        const Floats per_y2 = set(ball.per_y2), down = hn::Sub(y, set(ball.y));
        for (std::size_t row = std::size_t(row0) / layout.rows * layout.rows; int(row) < row1;
             row += layout.rows) {
            float* const sum = sums + row * shader::kTileWidth + block * layout.lanes;
            const Floats dy = hn::Add(down, set(float(row)));
            const Floats w = hn::Max(hn::NegMulAdd(hn::Mul(per_y2, dy), dy, across), hn::Zero(d));
            hn::Store(hn::MulAdd(scale, line_integral(w, hn::Sqrt(w)), hn::Load(d, sum)), d, sum);
            ++vectors;
        }
    }
    return vectors * layout.lanes;
}

// Until the whole tile is dark; how many pairs of a ball and a texel it took.
std::size_t add_to_map(const LightTile& tile, float* HWY_RESTRICT sums) {
    const Lanes d;
    const Layout layout;
    std::size_t pairs = 0;
    for (std::size_t begin = 0; begin < tile.balls.size(); begin += 4 * kAtOnce) {
        const auto some = tile.balls.subspan(begin, std::min(4 * kAtOnce, tile.balls.size() - begin));
        for (std::size_t block = 0; block < layout.blocks; ++block)
            pairs += add_to_texels(tile, some, layout, block, sums);
        Floats least = hn::Load(d, sums);
        for (std::size_t at = layout.lanes; at < kTilePixels; at += layout.lanes)
            least = hn::Min(least, hn::Load(d, sums + at));
        if (hn::AllTrue(d, hn::Gt(least, set(kDarkTexel)))) break;
    }
    return pairs;
}

// A ball seen along the light from centres at x and y: the square of half the chord.
HWY_INLINE Floats half_chord_squared(const LightBall& ball, Floats x, Floats y) {
    const Floats dx = hn::Sub(x, set(ball.x)), dy = hn::Sub(y, set(ball.y));
    const Floats across = hn::NegMulAdd(hn::Mul(set(ball.per_x2), dx), dx, set(1.0f));
    return hn::Max(hn::NegMulAdd(hn::Mul(set(ball.per_y2), dy), dy, across), hn::Zero(Lanes()));
}

// Adds the optical depth of the part of every ball that lies between a centre and the sun: of the whole ball
// as long as it lies in front of all centres of the vector. A lane's sum does not depend on the other lanes:
// a ball that lies wholly before or behind its centre adds the same as in a vector without the others.
Floats depth_of_centres(const LightTile& tile, Floats x, Floats y, Floats z, float nearest, float farthest,
                        std::size_t& i) {
    const Lanes d;
    Floats depth = hn::Zero(d);
    const auto is_dark = [&](std::size_t at) {
        return at % kAtOnce == 0 && hn::AllTrue(d, hn::Gt(depth, set(kDarkCentre)));
    };
    const float reach = 1.0001f * tile.largest_radius;
    for (i = 0; i < tile.balls.size() && tile.balls[i].z < nearest - reach; ++i) {
        if (is_dark(i)) return depth;
        const LightBall& ball = tile.balls[i];
        const Floats w = half_chord_squared(ball, x, y);
        depth = hn::MulAdd(set(ball.depth_scale), line_integral(w, hn::Sqrt(w)), depth);
    }
    for (; i < tile.balls.size() && tile.balls[i].z <= farthest + reach; ++i) {
        if (is_dark(i)) return depth;
        const LightBall& ball = tile.balls[i];
        const Floats w = half_chord_squared(ball, x, y), half_chord = hn::Sqrt(w);
        const Floats whole = line_integral(w, half_chord);
        const Floats end = hn::Mul(hn::Sub(z, set(ball.z)), set(ball.per_radius));
        const Floats inside = hn::Max(hn::Min(end, half_chord), hn::Neg(half_chord));
        const Floats part = hn::MulAdd(set(0.5f), whole, partial_line_integral(w, inside));
        const Floats before = hn::IfThenElse(hn::Ge(end, half_chord), whole, hn::Max(part, hn::Zero(d)));
        const Floats added = hn::IfThenZeroElse(hn::Le(end, hn::Neg(half_chord)), before);
        depth = hn::MulAdd(set(ball.depth_scale), added, depth);
    }
    return depth;
}

// Adds a tile's metaballs to its centres. Returns the number of evaluated pairs.
std::size_t add_to_centres(const LightTile& tile, const LightCentres& centres) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d);
    std::size_t pairs = 0;
    for (std::size_t begin = 0; begin < centres.x.size(); begin += lanes) {
        const std::size_t count = std::min(lanes, centres.x.size() - begin);
        HWY_ALIGN float x[2 * shader::kTileWidth], y[2 * shader::kTileWidth], z[2 * shader::kTileWidth];
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const std::size_t i = begin + std::min(lane, count - 1);
            x[lane] = centres.x[i];
            y[lane] = centres.y[i];
            z[lane] = centres.z[i];
        }
        std::size_t balls = 0;
        const Floats depth =
            depth_of_centres(tile, hn::Load(d, x), hn::Load(d, y), hn::Load(d, z), z[0], z[count - 1], balls);
        pairs += balls * lanes;
        hn::Store(depth, d, x);
        for (std::size_t lane = 0; lane < count; ++lane) centres.depth[begin + lane] += x[lane];
    }
    return pairs;
}

// exp(-depth) of the optical depths in a row of a tile, in place; those beyond `dark` count as that.
void to_transmittance(float* depths, std::size_t count, float dark) {
    const hn::CappedTag<float, shader::kTileWidth> d;
    const auto most = hn::Set(d, dark);
    std::size_t i = 0;
    for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d))
        hn::StoreU(hn::Exp(d, hn::Neg(hn::Min(hn::LoadU(d, depths + i), most))), d, depths + i);
    for (; i < count; ++i) depths[i] = hn::GetLane(hn::Exp(d, hn::Neg(hn::Min(hn::Set(d, depths[i]), most))));
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(add_to_map);
HWY_EXPORT(add_to_centres);
HWY_EXPORT(to_transmittance);

namespace {

std::int16_t to_row(int y) { return std::int16_t(std::clamp(y, -32768, 32767)); }

LightBall light_ball(const shader::LightSplat& splat, const shader::LightPlace& place, const PixelBox& box) {
    const auto [rx, ry] = unpack_halves(splat.radii);
    return {.x = splat.x,
            .y = splat.y,
            .per_x2 = 1.0f / (rx * rx),
            .per_y2 = 1.0f / (ry * ry),
            .z = place.z,
            .per_radius = place.per_radius,
            .depth_scale = splat.depth_scale,
            .first = to_row(box.y0),
            .end = to_row(box.y1)};
}

// The requested centres, tile by tile, and in each tile in order from the sun.
struct Centres {
    TileBins bins;
    std::vector<float> x, y, z, depth;

    Centres(const LightSortedSplats& order, const TileGrid& grid, std::span<const std::uint8_t> requested)
        : bins(bin_centres(order.splats, grid, requested)) {
        const std::size_t count = bins.list.size();
        x.resize(count);
        y.resize(count);
        z.resize(count);
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 8192), [&](const auto& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) {
                const std::uint32_t source = bins.list[i];
                x[i] = order.splats[source].x;
                y[i] = order.splats[source].y;
                z[i] = order.places[source].z;
            }
        });
        depth.assign(count, 0.0f);
    }
    LightCentres of_tile(std::size_t tile) {
        const std::size_t begin = bins.ranges[tile].begin, count = bins.ranges[tile].end - begin;
        return {std::span(x).subspan(begin, count), std::span(y).subspan(begin, count),
                std::span(z).subspan(begin, count), std::span(depth).subspan(begin, count)};
    }
};

bool is_requested(std::span<const std::uint8_t> requested, std::size_t i) {
    return requested.empty() || requested[i] != 0;
}

// Calls work(first texel of a row, how many) for the rows of a tile of the map.
template <class Work>
void for_each_row(std::size_t tile, const TileGrid& grid, const Work& work) {
    const int x = int(tile % std::size_t(grid.columns())) * int(shader::kTileWidth),
              y = int(tile / std::size_t(grid.columns())) * int(shader::kTileHeight);
    const int columns = std::min(int(shader::kTileWidth), grid.width - x),
              rows = std::min(int(shader::kTileHeight), grid.height - y);
    for (int row = 0; row < rows; ++row)
        work(std::size_t(y + row) * std::size_t(grid.width) + std::size_t(x), std::size_t(columns));
}

// The shadow map and the centres while batches of balls are added.
struct LightSums {
    TileGrid grid;
    std::span<const std::uint8_t> map_tiles;  // as LightRequest
    std::vector<std::uint8_t> tiles;          // those of which anything is requested
    Centres centres;
    std::vector<float>& map;

    LightSums(const LightSortedSplats& order, const TileGrid& of, const LightRequest& requested,
              std::vector<float>& shadow)
        : grid(of),
          map_tiles(requested.map_tiles),
          tiles(of.tiles()),
          centres(order, of, requested.centres),
          map(shadow) {
        for (std::size_t t = 0; t < tiles.size(); ++t) {
            const shader::TileRange range = centres.bins.ranges[t];
            tiles[t] = is_requested(map_tiles, t) || range.begin < range.end ? 1 : 0;
        }
    }
};

// Copied together, they serve the map and the centres.
void gather(std::span<const LightBall> balls, const TileBins& bins, std::size_t tile,
            std::vector<LightBall>& out) {
    constexpr std::uint32_t kAhead = 16;
    const shader::TileRange range = bins.ranges[tile];
    out.resize(range.end - range.begin);
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
        hwy::Prefetch(&balls[bins.list[std::min(i + kAhead, std::uint32_t(bins.list.size() - 1))]]);
        out[i - range.begin] = balls[bins.list[i]];
    }
}

// Adds the optical depths of consecutive light-sorted metaballs. Returns the number of evaluated pairs.
std::size_t add_balls(std::span<const LightBall> balls, const TileBins& bins, float largest_radius,
                      LightSums& light) {
    const TileGrid& grid = light.grid;
    std::atomic<std::size_t> pairs = 0;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, grid.tiles(), 8), [&](const auto& range) {
        std::vector<LightBall> of_tile;
        for (std::size_t t = range.begin(); t != range.end(); ++t) {
            if (bins.ranges[t].begin == bins.ranges[t].end) continue;
            gather(balls, bins, t, of_tile);
            const auto columns = std::size_t(grid.columns());
            const LightTile tile{.x = int(t % columns) * int(shader::kTileWidth),
                                 .y = int(t / columns) * int(shader::kTileHeight),
                                 .balls = of_tile,
                                 .largest_radius = largest_radius};
            pairs += HWY_DYNAMIC_DISPATCH(add_to_centres)(tile, light.centres.of_tile(t));
            if (!is_requested(light.map_tiles, t)) continue;
            alignas(64) float sums[shader::kTileWidth * shader::kTileHeight] = {};
            pairs += HWY_DYNAMIC_DISPATCH(add_to_map)(tile, sums);
            const float* from = sums;
            for_each_row(t, grid, [&](std::size_t at, std::size_t count) {
                for (std::size_t i = 0; i < count; ++i) light.map[at + i] += from[i];
                from += shader::kTileWidth;
            });
        }
    });
    return pairs;
}

void clear_map(LightSums& light) {
    for (std::size_t t = 0; t < light.tiles.size(); ++t) {
        if (!is_requested(light.map_tiles, t)) continue;
        for_each_row(t, light.grid, [&](std::size_t at, std::size_t count) {
            std::fill_n(light.map.begin() + std::ptrdiff_t(at), count, 0.0f);
        });
    }
}

// Converts the optical depths of the map to transmittances.
void finish(LightSums& light) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, light.tiles.size(), 64), [&](const auto& range) {
        for (std::size_t t = range.begin(); t != range.end(); ++t) {
            if (!is_requested(light.map_tiles, t)) continue;
            for_each_row(t, light.grid, [&](std::size_t at, std::size_t count) {
                HWY_DYNAMIC_DISPATCH(to_transmittance)(&light.map[at], count, kDarkTexel);
            });
        }
    });
}

}  // namespace

void light_by_processor(const LightSortedSplats& order, int shadow_size, const LightRequest& requested,
                        std::vector<float>& depths, std::vector<float>& shadow, const BatchLimits& limits,
                        StageTimes* times) {
    const TileGrid grid{shadow_size, shadow_size};
    shadow.resize(std::size_t(shadow_size) * std::size_t(shadow_size), 1.0f);
    depths.resize(order.splats.size(), 0.0f);
    std::optional<StageTimer> timer(std::in_place, times, DrawStage::sun_bins);
    const std::vector<PixelBox> boxes = light_boxes(order.splats);
    LightSums sums(order, grid, requested, shadow);
    clear_map(sums);
    std::vector<LightBall> balls;
    for (std::size_t begin = 0; begin < boxes.size();) {
        const std::size_t end = end_of_batch(boxes, begin, grid, limits.boxes, limits.entries);
        timer.emplace(times, DrawStage::sun_bins);
        balls.resize(end - begin);
        tbb::parallel_for(tbb::blocked_range<std::size_t>(begin, end, 8192), [&](const auto& range) {
            for (std::size_t i = range.begin(); i != range.end(); ++i)
                balls[i - begin] = light_ball(order.splats[i], order.places[i], boxes[i]);
        });
        const TileBins bins = bin_into_tiles(std::span(boxes).subspan(begin, end - begin), grid, sums.tiles);
        timer.emplace(times, DrawStage::light);
        const std::size_t pairs = add_balls(balls, bins, order.largest_radius, sums);
        if (times != nullptr) {  // boxes written and read twice, balls written, lists written; then gathered
            (*times)[DrawStage::sun_bins].bytes +=
                balls.size() * (3 * sizeof(PixelBox) + sizeof(LightBall) + 24) + 4 * bins.list.size();
            (*times)[DrawStage::light].pairs += pairs;
        }
        begin = end;
    }
    finish(sums);
    const std::vector<std::uint32_t>& source = sums.centres.bins.list;
    for (std::size_t i = 0; i < source.size(); ++i)
        depths[source[i]] = std::min(sums.centres.depth[i], kDarkCentre);
}

void light_some_by_processor(const LightSortedSplats& order, int shadow_size, std::span<const std::uint8_t> balls,
                             std::span<const std::uint8_t> tiles, std::vector<float>& sun_depths,
                             std::vector<float>& shadow, StageTimes* times) {
    std::vector<std::uint8_t> centres(order.source.size());
    for (std::size_t i = 0; i < centres.size(); ++i) centres[i] = balls[order.source[i]];
    std::vector<float> depths;
    light_by_processor(order, shadow_size, {centres, tiles}, depths, shadow, {}, times);
    for (std::size_t i = 0; i < centres.size(); ++i)
        if (centres[i] != 0) sun_depths[order.source[i]] = depths[i];
}

}  // namespace nephos
#endif
