// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/diffusion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

#include "render/cloud/light_sweep.h"
#include "render/shared/march.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cloud/diffusion.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#ifndef NEPHOS_RENDER_DIFFUSION_TYPES_
#define NEPHOS_RENDER_DIFFUSION_TYPES_
namespace nephos {

inline constexpr int kAround = 4;  // cells of a brick and beside it, on an edge
inline constexpr int kRow = 8;     // numbers in a row of nodes, of which kLightNodes count

// What interpolation adds up of the cells around a brick: weight, weighted fluence and flux, LightOfCells' numbers, in
// rows of nodes along x for each row of cells.
struct RowsOfNodes {
    alignas(64) float of[5][kAround][kAround][kRow];  // z, y, x
};

}  // namespace nephos
#endif

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Row = hn::CappedTag<float, kRow>;
using RowFloats = hn::Vec<Row>;
using RowWords = hn::Repartition<std::uint32_t, Row>;

HWY_INLINE RowFloats number(float value) { return hn::Set(Row(), value); }

// A byte from each of two numbers 0..255, rounded.
HWY_INLINE hn::Vec<RowWords> packed(RowFloats low, RowFloats high) {
    const auto rounded = [](RowFloats value) {
        const hn::Repartition<std::int32_t, Row> di;
        return hn::BitCast(RowWords(), hn::ConvertTo(di, hn::Add(value, number(0.5f))));
    };
    return hn::Or(rounded(low), hn::ShiftLeft<8>(rounded(high)));
}

// A node lies in the middle of a cell or between two on each axis: its light is the weighted mean of these. Calls
// set(fluence, flux to the east, north and up) for nodes in rows, where it returns words, and stores these. Where there
// is no cloud near the fluence is -1.
template <class Set>
HWY_INLINE void for_nodes(const RowsOfNodes& rows, const Set& set, std::uint16_t* out) {
    const Row d;
    const std::size_t lanes = hn::Lanes(d);
    const auto first = [](int node) { return (node + 1) / 2; };
    HWY_ALIGN std::uint32_t words[kRow];
    for (int z = 0; z < kLightNodes; ++z) {
        for (int y = 0; y < kLightNodes; ++y, out += kLightNodes) {
            for (std::size_t x = 0; x < kRow; x += lanes) {
                RowFloats sums[5];
                for (int n = 0; n < 5; ++n) {
                    const auto plane = [&](int cell) {
                        const auto& of = rows.of[n][cell];
                        const RowFloats low = hn::Load(d, &of[first(y)][x]);
                        return y % 2 != 0 ? low : hn::Add(low, hn::Load(d, &of[first(y) + 1][x]));
                    };
                    sums[n] = z % 2 != 0 ? plane(first(z)) : hn::Add(plane(first(z)), plane(first(z) + 1));
                }
                const auto some = hn::Gt(sums[0], hn::Zero(d));
                const RowFloats weight = hn::IfThenElse(some, sums[0], number(1));
                const auto mean = [&](int n) { return hn::IfThenElseZero(some, hn::Div(sums[n], weight)); };
                const RowFloats fluence = hn::IfThenElse(some, hn::Div(sums[1], weight), number(-1));
                hn::Store(set(fluence, mean(2), mean(3), mean(4)), RowWords(), words + x);
            }
            for (int x = 0; x < kLightNodes; ++x) out[x] = std::uint16_t(words[x]);
        }
    }
}

void upwards_at_nodes(const RowsOfNodes& rows, std::uint16_t* out) {
    const auto set = [](RowFloats value, RowFloats, RowFloats, RowFloats up) {
        const RowFloats fluence = hn::Max(value, number(0)),
                        share = hn::Min(hn::Div(fluence, number(shader::kMostFluence)), number(1)),
                        ratio = hn::Div(up, hn::Max(fluence, number(1e-9f)));
        return packed(hn::Mul(number(255), hn::Sqrt(share)),
                      hn::Add(number(128), hn::Mul(number(127), hn::Max(hn::Min(ratio, number(1)), number(-1)))));
    };
    for_nodes(rows, set, out);
}

void sideways_at_nodes(const RowsOfNodes& rows, std::uint16_t* out) {
    const auto set = [](RowFloats value, RowFloats east, RowFloats north, RowFloats) {
        const RowFloats fluence = hn::Max(value, number(1e-9f));
        const auto ratio = [&](RowFloats flux) {
            const RowFloats of = hn::Div(flux, fluence);
            return hn::Add(number(128), hn::Mul(number(127), hn::Max(hn::Min(of, number(1)), number(-1))));
        };
        return packed(ratio(east), ratio(north));
    };
    for_nodes(rows, set, out);
}

// What does not come from the sky comes from the ground.
void surroundings_at_nodes(const RowsOfNodes& rows, std::uint16_t* out) {
    const auto set = [](RowFloats value, RowFloats, RowFloats, RowFloats) {
        const RowFloats sky =
            hn::IfThenElse(hn::Lt(value, number(0)), number(0.5f), hn::Min(value, number(1)));
        return packed(hn::Mul(number(255), sky), hn::Mul(number(255), hn::Sub(number(1), sky)));
    };
    for_nodes(rows, set, out);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(upwards_at_nodes);
HWY_EXPORT(sideways_at_nodes);
HWY_EXPORT(surroundings_at_nodes);

namespace {

// Adds up pairs of cells along x.
void gather_rows(const DiffusionCells& cells, const std::vector<LightOfCells>& light, std::size_t brick, int count,
                 RowsOfNodes& rows) {
    const auto& around = cells.around[brick];
    for (int z = 0; z < kAround; ++z) {
        for (int y = 0; y < kAround; ++y) {
            // Cell -1 is the upper one of the brick below, and so on.
            const int row = 9 * ((z + 1) / 2) + 3 * ((y + 1) / 2),
                      cell = 4 * ((z + 1) % 2) + 2 * ((y + 1) % 2);
            const LightOfCells *const low = &light[std::size_t(around[std::size_t(row)])],
                               *const own = &light[std::size_t(around[std::size_t(row + 1)])],
                               *const high = &light[std::size_t(around[std::size_t(row + 2)])];
            for (int n = 0; n < count; ++n) {
                const auto of = [&](const LightOfCells* from, int x) {
                    return (*from)[std::size_t(n)].of[std::size_t(cell + x)];
                };
                const float a = of(low, 1), b = of(own, 0), c = of(own, 1), d = of(high, 0);
                float* const to = rows.of[n][z][y];
                to[0] = a + b;
                to[1] = b;
                to[2] = b + c;
                to[3] = c;
                to[4] = c + d;
            }
        }
    }
}

constexpr std::size_t kCorners = 3;  // of cells, on an edge of a brick

// The light that the sun loses in a cell, and the mean of where on each axis, -1 to 1.
struct LostLight {
    float light = 0;
    std::array<float, 3> place{};
};

// What enters a cell through faces and does not leave it: exact, as neighbours share faces. Multiplied with the distance
// from the middle, what enters less what leaves is the sum of where light is lost, but for the light of the whole cell
// times its direction; of that each optical depth of `thickness` loses one part. `corner`: light at the cell's lower
// corner, kCorners on an edge; between corners it is bilinear.
LostLight lost_by_sun(const float* corner, const std::array<float, 3>& towards, float thickness) {
    constexpr float kArm = 1.0f / 3;  // the mean of where a corner's part of a face's light lies
    LostLight lost;
    for (std::size_t n = 0; n < 8; ++n) {
        const std::size_t o[3] = {n % 2, n / 2 % 2, n / 4};
        const float light = corner[(o[2] * kCorners + o[1]) * kCorners + o[0]];
        for (std::size_t face = 0; face < 3; ++face) {
            const float entering = 0.25f * light * (o[face] == 1 ? towards[face] : -towards[face]);
            lost.light += entering;
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const float arm = axis == face ? 1.0f : kArm;
                lost.place[axis] += (o[axis] == 1 ? arm : -arm) * entering;
            }
        }
    }
    if (!(lost.light > 0)) return {};
    for (std::size_t axis = 0; axis < 3; ++axis)
        lost.place[axis] = std::clamp(lost.place[axis] / lost.light - 2 * towards[axis] / thickness, -1.0f, 1.0f);
    return lost;
}

StartingLight lost_by_sun(const DiffusionCells& cells, std::size_t brick, const float* depths, const Vec3& to_sun,
                          double albedo) {
    const std::array<float, 3> towards{float(to_sun.x), float(to_sun.y), float(to_sun.z)};
    std::array<float, kCorners * kCorners * kCorners> light;
    for (std::size_t n = 0; n < light.size(); ++n) {
        const std::size_t x = 2 * (n % kCorners), y = 2 * (n / kCorners % kCorners), z = 2 * (n / kCorners / kCorners);
        light[n] = std::exp((cells.mean_cosine - 1) * depths[(z * kLightNodes + y) * kLightNodes + x]);
    }
    StartingLight starting;
    for (std::size_t cell = 0; cell < kDiffusionCells; ++cell) {
        const float thickness = cells.thickness[brick].of[cell];
        if (!(thickness > 0)) continue;
        const LostLight lost =
            lost_by_sun(&light[(cell / 4 * kCorners + cell / 2 % 2) * kCorners + cell % 2], towards, thickness);
        starting.light.of[cell] = float(albedo) * lost.light;
        for (std::size_t axis = 0; axis < 3; ++axis) starting.place[axis].of[cell] = lost.place[axis];
    }
    return starting;
}

}  // namespace

DiffuseLight diffuse_sunlight(const DiffusionCells& cells, std::span<const float> sun_depths, const Vec3& to_sun,
                              double albedo) {
    std::vector<StartingLight> starting(cells.bricks);
    tbb::parallel_for(std::size_t{0}, cells.active.size(), [&](std::size_t n) {
        const auto brick = std::size_t(cells.active[n]);
        starting[brick] = lost_by_sun(cells, brick, &sun_depths[brick * kLightNodesOfBrick], to_sun, albedo);
    });
    const SharedLight shared = share_light(cells, starting);
    const std::vector<LightOfCells> light =
        light_of_cells(cells, solve(cells, shared.source, albedo), {}, shared.leaving);
    DiffuseLight result;
    result.upwards.assign(sun_depths.size() + 1, 0);
    result.sideways.assign(result.upwards.size(), 0);
    tbb::parallel_for(std::size_t{0}, cells.bricks, [&](std::size_t brick) {
        RowsOfNodes rows{};
        gather_rows(cells, light, brick, 5, rows);
        HWY_DYNAMIC_DISPATCH(upwards_at_nodes)(rows, &result.upwards[brick * kLightNodesOfBrick]);
        HWY_DYNAMIC_DISPATCH(sideways_at_nodes)(rows, &result.sideways[brick * kLightNodesOfBrick]);
    });
    return result;
}

// Where nothing is absorbed, a cloud before a sky and a ground of one radiance has that radiance. Faces at the side see
// half of the sky.
std::vector<std::uint16_t> diffuse_surroundings(const DiffusionCells& cells) {
    const FluenceOutside sky{0.5f, 0.5f, 0.5f, 0.5f, 0.0f, 1.0f};
    const std::vector<LightOfCells> light =
        light_of_cells(cells, solve(cells, light_from_outside(cells, sky), 1), sky);
    std::vector<std::uint16_t> surroundings(cells.bricks * kLightNodesOfBrick + 1, 0);
    tbb::parallel_for(std::size_t{0}, cells.bricks, [&](std::size_t brick) {
        RowsOfNodes rows{};
        gather_rows(cells, light, brick, 2, rows);
        HWY_DYNAMIC_DISPATCH(surroundings_at_nodes)(rows, &surroundings[brick * kLightNodesOfBrick]);
    });
    return surroundings;
}

}  // namespace nephos
#endif
