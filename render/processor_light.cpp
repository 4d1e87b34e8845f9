// SPDX-License-Identifier: Apache-2.0
#include "render/processor_light.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>

#include <tbb/parallel_for.h>

#include "render/half_floats.h"
#include "render/light_bins.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/processor_light.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/column-inl.h"

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

// Adds the optical depth of all balls along the light through the texels of a tile.
void add_to_map(const LightTile& tile, float* HWY_RESTRICT sums) {
    const Lanes d;
    const Layout layout;
    for (std::size_t block = 0; block < layout.blocks; ++block) {
        const FirstPixels first(layout, block);
        const Floats x = hn::Add(hn::Load(d, first.x), set(float(tile.x))),
                     y = hn::Add(hn::Load(d, first.y), set(float(tile.y)));
        for (const LightBall& ball : tile.balls) {
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
                hn::Store(hn::MulAdd(scale, column(w, hn::Sqrt(w)), hn::Load(d, sum)), d, sum);
            }
        }
    }
}

// A ball seen along the light from centres at x and y: the square of half the chord.
HWY_INLINE Floats half_chord_squared(const LightBall& ball, Floats x, Floats y) {
    const Floats dx = hn::Sub(x, set(ball.x)), dy = hn::Sub(y, set(ball.y));
    const Floats across = hn::NegMulAdd(hn::Mul(set(ball.per_x2), dx), dx, set(1.0f));
    return hn::Max(hn::NegMulAdd(hn::Mul(set(ball.per_y2), dy), dy, across), hn::Zero(Lanes()));
}

// Adds the optical depth of the part of every ball that lies between a centre and the sun: of the whole ball
// as long as it lies in front of all centres of the vector.
Floats depth_of_centres(const LightTile& tile, Floats x, Floats y, Floats z, float nearest, float farthest) {
    const Lanes d;
    Floats depth = hn::Zero(d);
    std::size_t i = 0;
    for (; i < tile.balls.size() && tile.balls[i].z < nearest - tile.largest_radius; ++i) {
        const LightBall& ball = tile.balls[i];
        const Floats w = half_chord_squared(ball, x, y);
        depth = hn::MulAdd(set(ball.depth_scale), column(w, hn::Sqrt(w)), depth);
    }
    for (; i < tile.balls.size() && tile.balls[i].z <= farthest + tile.largest_radius; ++i) {
        const LightBall& ball = tile.balls[i];
        const Floats w = half_chord_squared(ball, x, y), half_chord = hn::Sqrt(w);
        const Floats behind = hn::Mul(hn::Sub(z, set(ball.z)), set(ball.per_radius));
        const Floats end = hn::Max(hn::Min(behind, half_chord), hn::Neg(half_chord));
        const Floats part = hn::MulAdd(set(0.5f), column(w, half_chord), column_part(w, end));
        depth = hn::MulAdd(set(ball.depth_scale), part, depth);
    }
    return depth;
}

void add_to_centres(const LightTile& tile, const LightCentres& centres) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d);
    for (std::size_t begin = 0; begin < centres.x.size(); begin += lanes) {
        const std::size_t count = std::min(lanes, centres.x.size() - begin);
        HWY_ALIGN float x[2 * shader::kTileWidth], y[2 * shader::kTileWidth], z[2 * shader::kTileWidth];
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const std::size_t i = begin + std::min(lane, count - 1);
            x[lane] = centres.x[i];
            y[lane] = centres.y[i];
            z[lane] = centres.z[i];
        }
        const Floats depth =
            depth_of_centres(tile, hn::Load(d, x), hn::Load(d, y), hn::Load(d, z), z[0], z[count - 1]);
        hn::Store(depth, d, x);
        for (std::size_t lane = 0; lane < count; ++lane) centres.depth[begin + lane] += x[lane];
    }
}

// exp(-depth) of some optical depths, in place.
void to_transmittance(float* depths, std::size_t count) {
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d);
    std::size_t i = 0;
    for (; i + lanes <= count; i += lanes)
        hn::StoreU(hn::Exp(d, hn::Neg(hn::LoadU(d, depths + i))), d, depths + i);
    for (; i < count; ++i) depths[i] = hn::GetLane(hn::Exp(d, set(-depths[i])));
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

// All centres, tile by tile, and in each tile in order from the sun.
struct Centres {
    TileBins bins;
    std::vector<float> x, y, z, depth;

    Centres(const SunOrder& order, const TileGrid& grid) : bins(bin_centres(order.splats, grid)) {
        for (const std::uint32_t i : bins.list) {
            x.push_back(order.splats[i].x);
            y.push_back(order.splats[i].y);
            z.push_back(order.places[i].z);
        }
        depth.assign(x.size(), 0.0f);
    }
    LightCentres of_tile(std::size_t tile) {
        const std::size_t begin = bins.ranges[tile].begin, count = bins.ranges[tile].end - begin;
        return {std::span(x).subspan(begin, count), std::span(y).subspan(begin, count),
                std::span(z).subspan(begin, count), std::span(depth).subspan(begin, count)};
    }
};

// Adds a tile's sums to its texels of the map.
void add_texels(const float* sums, const LightTile& tile, const TileGrid& grid, std::vector<float>& map) {
    const int columns = std::min(int(shader::kTileWidth), grid.width - tile.x),
              rows = std::min(int(shader::kTileHeight), grid.height - tile.y);
    for (int y = 0; y < rows; ++y) {
        float* to = &map[std::size_t(tile.y + y) * std::size_t(grid.width) + std::size_t(tile.x)];
        for (int x = 0; x < columns; ++x) to[x] += sums[y * int(shader::kTileWidth) + x];
    }
}

// What some of the balls, consecutive in the order from the sun, take from the light.
void add_balls(std::span<const LightBall> balls, const TileBins& bins, const TileGrid& grid,
               float largest_radius, Centres& centres, std::vector<float>& map) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, grid.tiles(), 8), [&](const auto& range) {
        std::vector<LightBall> of_tile;
        for (std::size_t t = range.begin(); t != range.end(); ++t) {
            if (bins.ranges[t].begin == bins.ranges[t].end) continue;
            of_tile.clear();
            for (std::uint32_t i = bins.ranges[t].begin; i < bins.ranges[t].end; ++i)
                of_tile.push_back(balls[bins.list[i]]);
            const auto columns = std::size_t(grid.columns());
            const LightTile tile{.x = int(t % columns) * int(shader::kTileWidth),
                                 .y = int(t / columns) * int(shader::kTileHeight),
                                 .balls = of_tile,
                                 .largest_radius = largest_radius};
            alignas(64) float sums[shader::kTileWidth * shader::kTileHeight] = {};
            HWY_DYNAMIC_DISPATCH(add_to_map)(tile, sums);
            add_texels(sums, tile, grid, map);
            HWY_DYNAMIC_DISPATCH(add_to_centres)(tile, centres.of_tile(t));
        }
    });
}

void to_transmittance(std::vector<float>& depths) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, depths.size(), 65536), [&](const auto& range) {
        HWY_DYNAMIC_DISPATCH(to_transmittance)(depths.data() + range.begin(), range.size());
    });
}

}  // namespace

std::vector<float> light_by_processor(const SunOrder& order, int shadow_size, std::vector<float>& shadow,
                                      const BatchLimits& limits) {
    const TileGrid grid{shadow_size, shadow_size};
    const std::vector<PixelBox> boxes = light_boxes(order.splats);
    Centres centres(order, grid);
    shadow.assign(std::size_t(shadow_size) * std::size_t(shadow_size), 0.0f);
    std::vector<LightBall> balls;
    for (std::size_t begin = 0; begin < boxes.size();) {
        const std::size_t end = end_of_batch(boxes, begin, grid, limits.boxes, limits.entries);
        balls.clear();
        for (std::size_t i = begin; i < end; ++i)
            balls.push_back(light_ball(order.splats[i], order.places[i], boxes[i]));
        add_balls(balls, bin_into_tiles(std::span(boxes).subspan(begin, end - begin), grid), grid,
                  order.largest_radius, centres, shadow);
        begin = end;
    }
    to_transmittance(shadow);
    to_transmittance(centres.depth);
    std::vector<float> light(order.splats.size());
    for (std::size_t i = 0; i < light.size(); ++i) light[centres.bins.list[i]] = centres.depth[i];
    return light;
}

}  // namespace nephos
#endif
