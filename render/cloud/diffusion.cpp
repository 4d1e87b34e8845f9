// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/diffusion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

#include "render/cloud/diffusion_solver.h"
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

inline constexpr int kRow = 8;  // numbers in a row of nodes, of which kLightNodes count

inline constexpr std::uint16_t kNoFlux = 128;  // as a byte
inline constexpr int kMostAround = 6;  // cells of a brick and beside it, on an edge

// What interpolation adds up of the cells around a brick: weight, weighted fluence and flux, LightOfCells' numbers, in
// rows of nodes along x for each row of cells.
struct RowsOfNodes {
    bool wide;  // two cells on a brick's edge; else four
    alignas(64) float of[5][kMostAround][kMostAround][kRow];  // z, y, x
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

// A node lies between two cells on each axis, or in the middle of a wide one: its light is the weighted mean of these.
// Calls set(fluence, flux to the east, north and up) for nodes in rows, where it returns words, and stores these. Where
// there is no cloud near the fluence is -1.
template <class Set>
HWY_INLINE void for_nodes(const RowsOfNodes& rows, const Set& set, std::uint16_t* out) {
    const Row d;
    const std::size_t lanes = hn::Lanes(d);
    const auto first = [&](int node) { return rows.wide ? (node + 1) / 2 : node; };
    const auto in_middle = [&](int node) { return rows.wide && node % 2 != 0; };
    HWY_ALIGN std::uint32_t words[kRow];
    for (int z = 0; z < kLightNodes; ++z) {
        for (int y = 0; y < kLightNodes; ++y, out += kLightNodes) {
            for (std::size_t x = 0; x < kRow; x += lanes) {
                RowFloats sums[5];
                for (int n = 0; n < 5; ++n) {
                    const auto plane = [&](int cell) {
                        const auto& of = rows.of[n][cell];
                        const RowFloats low = hn::Load(d, &of[first(y)][x]);
                        return in_middle(y) ? low : hn::Add(low, hn::Load(d, &of[first(y) + 1][x]));
                    };
                    sums[n] = in_middle(z) ? plane(first(z)) : hn::Add(plane(first(z)), plane(first(z) + 1));
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
                      hn::Add(number(float(kNoFlux)), hn::Mul(number(127), hn::Max(hn::Min(ratio, number(1)), number(-1)))));
    };
    for_nodes(rows, set, out);
}

void sideways_at_nodes(const RowsOfNodes& rows, std::uint16_t* out) {
    const auto set = [](RowFloats value, RowFloats east, RowFloats north, RowFloats) {
        const RowFloats fluence = hn::Max(value, number(1e-9f));
        const auto ratio = [&](RowFloats flux) {
            const RowFloats of = hn::Div(flux, fluence);
            return hn::Add(number(float(kNoFlux)), hn::Mul(number(127), hn::Max(hn::Min(of, number(1)), number(-1))));
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

// The cells around a brick along an axis, from the one below: the brick, of three, the coordinates of the octet in it, and of
// the cell in that.
struct CellAround {
    std::uint8_t brick, octet, number;
};
constexpr std::array<CellAround, 4> kWideAround{{{0, 0, 1}, {1, 0, 0}, {1, 0, 1}, {2, 0, 0}}};
constexpr std::array<CellAround, kMostAround> kLatticeAround{
    {{0, 1, 1}, {1, 0, 0}, {1, 0, 1}, {1, 1, 0}, {1, 1, 1}, {2, 0, 0}}};

// Adds up pairs of cells along x. Returns false if there are none.
bool gather_rows(const DiffusionCells& cells, const std::vector<LightOfCells>& light, std::size_t brick, std::size_t count,
                 RowsOfNodes& rows) {
    rows.wide = cells.octets_of_brick == 1;
    const std::span<const CellAround> places = rows.wide ? std::span<const CellAround>(kWideAround) : kLatticeAround;
    const auto& around = cells.around[brick];
    bool any = false;
    for (std::size_t z = 0; z < places.size(); ++z) {
        for (std::size_t y = 0; y < places.size(); ++y) {
            const std::size_t bricks = 9 * std::size_t(places[z].brick) + 3 * std::size_t(places[y].brick),
                              octets = 4 * std::size_t(places[z].octet) + 2 * std::size_t(places[y].octet),
                              numbers = 4 * std::size_t(places[z].number) + 2 * std::size_t(places[y].number);
            std::array<const LightOfCells*, kMostAround> of;
            for (std::size_t x = 0; x < places.size(); ++x) {
                const std::size_t octet = cells.octet_of(around[bricks + places[x].brick], octets + places[x].octet);
                any = any || octet != cells.octets;
                of[x] = &light[octet];
            }
            for (std::size_t n = 0; n < count; ++n) {
                std::array<float, kMostAround> value;
                for (std::size_t x = 0; x < places.size(); ++x)
                    value[x] = (*of[x])[n].of[numbers + places[x].number];
                float* const to = rows.of[n][z][y];
                for (std::size_t node = 0; node < kLightNodes; ++node) {
                    if (!rows.wide)
                        to[node] = value[node] + value[node + 1];
                    else
                        to[node] = node % 2 != 0 ? value[(node + 1) / 2] : value[node / 2] + value[node / 2 + 1];
                }
            }
        }
    }
    return any;
}

constexpr std::size_t kCorners = 3;  // of cells, on an edge of an octet

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
    // Sums over the corners: of a number's bits each stands for an axis along which lower corners count negatively.
    std::array<float, 8> sums;
    for (std::size_t n = 0; n < 8; ++n)
        sums[n] = corner[((n >> 2) * kCorners + (n >> 1 & 1)) * kCorners + (n & 1)];
    for (std::size_t bit = 1; bit < 8; bit *= 2) {
        for (std::size_t n = 0; n < 8; ++n) {
            if ((n & bit) != 0) continue;
            const float low = sums[n], high = sums[n | bit];
            sums[n] = high + low;
            sums[n | bit] = high - low;
        }
    }
    LostLight lost;
    lost.light = 0.25f * (towards[0] * sums[1] + towards[1] * sums[2] + towards[2] * sums[4]);
    if (!(lost.light > 0)) return {};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t bit = std::size_t{1} << axis;
        float moment = towards[axis] * sums[0];
        for (std::size_t face = 0; face < 3; ++face)
            if (face != axis) moment += kArm * towards[face] * sums[bit | std::size_t{1} << face];
        lost.place[axis] = std::clamp(0.25f * moment / lost.light - 2 * towards[axis] / thickness, -1.0f, 1.0f);
    }
    return lost;
}

StartingLight lost_by_sun(const DiffusionCells& cells, std::size_t octet, std::span<const float> sun_depths, const Vec3& to_sun,
                          double albedo) {
    const std::array<float, 3> towards{float(to_sun.x), float(to_sun.y), float(to_sun.z)};
    // Corners of wide cells are every other node.
    const bool wide = cells.octets_of_brick == 1;
    const std::size_t step = wide ? 2 : 1, within = cells.within_brick(octet);
    const std::size_t first[3] = {2 * (within & 1), 2 * (within >> 1 & 1), 2 * (within >> 2)};
    const float* const depths = &sun_depths[cells.brick_of(octet) * kLightNodesOfBrick];
    std::array<float, kCorners * kCorners * kCorners> light;
    for (std::size_t n = 0; n < light.size(); ++n) {
        const std::size_t x = first[0] + step * (n % kCorners), y = first[1] + step * (n / kCorners % kCorners),
                          z = first[2] + step * (n / kCorners / kCorners);
        light[n] = std::exp((cells.mean_cosine - 1) * depths[(z * kLightNodes + y) * kLightNodes + x]);
    }
    StartingLight starting;
    for (std::size_t cell = 0; cell < kDiffusionCells; ++cell) {
        const float thickness = cells.thickness[octet].of[cell];
        if (!(thickness > 0)) continue;
        const LostLight lost =
            lost_by_sun(&light[(cell / 4 * kCorners + cell / 2 % 2) * kCorners + cell % 2], towards, thickness);
        starting.light.of[cell] = float(albedo) * lost.light;
        for (std::size_t axis = 0; axis < 3; ++axis) starting.place[axis].of[cell] = lost.place[axis];
    }
    return starting;
}

SharedLight shared_sunlight(const DiffusionCells& cells, std::span<const float> sun_depths, const Vec3& to_sun,
                            double albedo) {
    std::vector<StartingLight> starting(cells.octets);
    tbb::parallel_for(std::size_t{0}, cells.active.size(), [&](std::size_t n) {
        const auto octet = std::size_t(cells.active[n]);
        starting[octet] = lost_by_sun(cells, octet, sun_depths, to_sun, albedo);
    });
    return share_light(cells, starting);
}

}  // namespace

DiffuseLight diffuse_sunlight(const DiffusionCells& cells, const DiffusionCells* wide, std::span<const float> sun_depths,
                              const Vec3& to_sun, double albedo) {
    const SharedLight shared = shared_sunlight(cells, sun_depths, to_sun, albedo);
    const std::vector<Octet> fluence = wide != nullptr ? solve(cells, *wide, shared.source, albedo)
                                                       : solve(cells, shared.source, albedo);
    const std::vector<LightOfCells> light = light_of_cells(cells, fluence, {}, shared.leaving);
    DiffuseLight result;
    result.upwards.assign(sun_depths.size() + 1, kNoFlux << 8);
    result.sideways.assign(result.upwards.size(), kNoFlux << 8 | kNoFlux);
    tbb::parallel_for(std::size_t{0}, cells.around.size(), [&](std::size_t brick) {
        RowsOfNodes rows{};
        if (!gather_rows(cells, light, brick, 5, rows)) return;
        HWY_DYNAMIC_DISPATCH(upwards_at_nodes)(rows, &result.upwards[brick * kLightNodesOfBrick]);
        HWY_DYNAMIC_DISPATCH(sideways_at_nodes)(rows, &result.sideways[brick * kLightNodesOfBrick]);
    });
    return result;
}

// Where nothing is absorbed, a cloud before a sky and a ground of one radiance has that radiance. Faces at the side see
// half of the sky.
std::vector<std::uint16_t> diffuse_surroundings(const DiffusionCells& wide) {
    const FluenceOutside sky{0.5f, 0.5f, 0.5f, 0.5f, 0.0f, 1.0f};
    const std::vector<LightOfCells> light =
        light_of_cells(wide, solve(wide, light_from_outside(wide, sky), 1), sky);
    std::vector<std::uint16_t> surroundings(wide.octets * kLightNodesOfBrick + 1, 0);
    tbb::parallel_for(std::size_t{0}, wide.octets, [&](std::size_t brick) {
        RowsOfNodes rows{};
        gather_rows(wide, light, brick, 2, rows);
        HWY_DYNAMIC_DISPATCH(surroundings_at_nodes)(rows, &surroundings[brick * kLightNodesOfBrick]);
    });
    return surroundings;
}

}  // namespace nephos
#endif
