// SPDX-License-Identifier: Apache-2.0
#include "density/detail.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "density/detail_kernels.h"
#include "density/detail_scalar.h"
#include "density/metaballs.h"
#include "density/openvdb_access.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "density/detail.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include "density/detail-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

constexpr std::size_t kMaxLanes = 16;

// Detailed density at `count` places relative to the field's corner, whose brick, x, y and z in it (nodes) and x, y, z
// in metres are given. Up to kMaxLanes numbers behind those of the places are read.
void sample_places(const DetailKernel& field, std::int32_t brick, const float* const (&local)[3],
                   const float* const (&place)[3], std::size_t count, float footprint, float* out) {
    using namespace erosion;
    const Lanes d;
    const std::size_t lanes = hn::Lanes(d);
    HWY_ALIGN float results[kMaxLanes];
    for (std::size_t n = 0; n < count; n += lanes) {
        const std::size_t some = std::min(lanes, count - n);
        const auto load = [&](const float* from) { return hn::LoadU(d, from + n); };
        const Node node = node_at(field, integer(brick), load(local[0]), load(local[1]), load(local[2]));
        const Eroded result = eroded(field, node, load(place[0]), load(place[1]), load(place[2]),
                                     number(footprint), hn::FirstN(d, some));
        hn::Store(result.density, d, results);
        std::copy_n(results, some, out + n);
    }
}

// t and growth in the middles of the boxes between the nodes of a brick, as node_at() has them, without its gathers.
struct Middles {
    static constexpr std::size_t kSide = CoverageField::kBrickNodes - 1;
    HWY_ALIGN float t[kSide * kSide * kSide], growth[kSide * kSide * kSide];
};

namespace hn = hwy::HWY_NAMESPACE;

void find_middles(const DetailKernel& field, std::int32_t brick, Middles& middles) {
    constexpr std::size_t kSide = Middles::kSide, kEdge = kSide + 1;
    const hn::CappedTag<float, kSide> d;
    const hn::Rebind<std::int32_t, decltype(d)> di;
    const hn::Rebind<std::uint16_t, decltype(d)> dh;
    using Row = hn::Vec<decltype(d)>;
    const std::size_t lanes = hn::Lanes(d);
    const auto* const nodes = reinterpret_cast<const std::uint16_t*>(
        field.nodes + std::size_t(brick) * CoverageField::kBrickBytes);
    const Row half = hn::Set(d, 0.5f);
    const auto between = [&](Row a, Row b) { return hn::MulAdd(half, hn::Sub(b, a), a); };
    HWY_ALIGN float along_x[2][kEdge][kSide], planes[2][2][kSide * kSide];  // t and growth; planes of two z
    for (std::size_t z = 0; z < kEdge; ++z) {
        for (std::size_t y = 0; y < kEdge; ++y) {
            for (std::size_t x = 0; x < kSide; x += lanes) {
                const std::uint16_t* const row = nodes + (z * kEdge + y) * kEdge + x;
                const auto a = hn::PromoteTo(di, hn::LoadU(dh, row)), b = hn::PromoteTo(di, hn::LoadU(dh, row + 1));
                const auto low = [&](hn::Vec<decltype(di)> pair) {
                    return hn::ConvertTo(d, hn::And(pair, hn::Set(di, 255)));
                };
                const auto high = [&](hn::Vec<decltype(di)> pair) { return hn::ConvertTo(d, hn::ShiftRight<8>(pair)); };
                hn::Store(between(low(a), low(b)), d, &along_x[0][y][x]);
                hn::Store(between(high(a), high(b)), d, &along_x[1][y][x]);
            }
        }
        for (std::size_t n = 0; n < 2; ++n)
            for (std::size_t i = 0; i < kSide * kSide; i += lanes)
                hn::Store(between(hn::Load(d, &along_x[n][0][0] + i), hn::Load(d, &along_x[n][0][0] + kSide + i)), d,
                          &planes[z % 2][n][i]);
        if (z == 0) continue;
        for (std::size_t i = 0; i < kSide * kSide; i += lanes) {
            const auto middle = [&](std::size_t n) {
                return between(hn::Load(d, &planes[(z - 1) % 2][n][i]), hn::Load(d, &planes[z % 2][n][i]));
            };
            const std::size_t to = (z - 1) * kSide * kSide + i;
            hn::Store(hn::Mul(middle(0), hn::Set(d, 1.0f / 255.0f)), d, middles.t + to);
            hn::Store(hn::MulSub(middle(1), hn::Set(d, 1.0f / 127.0f), hn::Set(d, 128.0f / 127.0f)), d,
                      middles.growth + to);
        }
    }
}

// Detailed density in the middles of the 8 x 8 x 8 boxes between the nodes of a brick, x fastest; `corner`: of the
// brick, metres from that of the field.
void sample_brick(const DetailKernel& field, std::int32_t brick, const float* corner, float footprint,
                  BrickSamples samples, float* out) {
    using namespace erosion;
    const Lanes d;
    constexpr std::size_t kSide = CoverageField::kBrickNodes - 1, kCount = kSide * kSide * kSide,
                          kCells = CoverageField::kBrickCells;
    static_assert(kMaxLanes <= 2 * kSide, "all lanes lie in one row of cells");
    const std::uint8_t* const cells = field.cells + std::size_t(brick) * CoverageField::kCellBytes;
    const auto clear = [&](std::size_t cell) { return float(cells[cell]) * CoverageField::kFactorStep >= 1; };
    std::size_t empty = 0;
    while (empty < kCells * kCells * kCells && clear(empty)) ++empty;
    if (empty == kCells * kCells * kCells) {
        std::fill_n(out, kCount, 0.0f);
        return;
    }
    const std::size_t lanes = hn::Lanes(d);
    HWY_ALIGN float middle[3][kMaxLanes];
    Middles middles;
    if (samples == BrickSamples::middles) find_middles(field, brick, middles);
    for (std::size_t n = 0; n < kCount; n += lanes) {
        const std::size_t row = (n / kSide / kSide / 2 * kCells + n / kSide % kSide / 2) * kCells;
        if (clear(row) && clear(row + 1) && clear(row + 2) && clear(row + 3)) {
            std::fill_n(out + n, lanes, 0.0f);
            continue;
        }
        for (std::size_t i = 0; i < lanes; ++i) {
            const std::size_t at[3] = {(n + i) % kSide, (n + i) / kSide % kSide, (n + i) / kSide / kSide};
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const std::size_t others = at[(axis + 1) % 3] + at[(axis + 2) % 3];
                const float inside = samples == BrickSamples::middles ? 0.5f : others % 2 == 0 ? 0.25f : 0.75f;
                middle[axis][i] = float(at[axis]) + inside;
            }
        }
        const Floats x = hn::Load(d, middle[0]), y = hn::Load(d, middle[1]), z = hn::Load(d, middle[2]);
        const Node node = samples == BrickSamples::middles
                              ? Node{hn::Load(d, middles.t + n), hn::Load(d, middles.growth + n)}
                              : node_at(field, integer(brick), x, y, z);
        const Floats metres = number(field.node_m);
        const auto place = [&](Floats local, int axis) { return hn::MulAdd(local, metres, number(corner[axis])); };
        const Eroded result = eroded(field, node, place(x, 0), place(y, 1), place(z, 2), number(footprint),
                                     hn::FirstN(d, lanes));
        hn::StoreU(result.density, d, out + n);
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(sample_places);
HWY_EXPORT(sample_brick);

namespace {


namespace text = detail_text;

constexpr int kEdge = CoverageField::kBrickNodes;

constexpr std::size_t kLanesBehind = 16;  // that sample_places() reads
float scalar_small_noise(float level, float x, float y, float z) {
    const int below = std::min(int(level), 2);
    const auto at = [&](int l) {
        const float scale = 1.0f / float(1 << l);
        return scalar_noise(std::span(detail_noise().small).subspan(first_of_level(l)), kSmallNoiseVoxels >> l,
                            x * scale, y * scale, z * scale);
    };
    const float fine = at(below);
    return fine + (level - float(below)) * (at(below + 1) - fine);
}

}  // namespace

DetailKernel::DetailKernel(const CoverageField& field)
    : nodes(field.nodes().data()),
      table(field.table().data()),
      cells(field.cells().data()),
      large_noise(detail_noise().large.data()),
      small_noise(detail_noise().small.data()),
      erosion(&field.erosion()),
      bricks(field.bricks()),
      node_m(float(field.node_m())),
      extinction_per_m(float(field.extinction_per_m())),
      corner_m{field.corner_m().x, field.corner_m().y, field.corner_m().z} {
    for (std::size_t band = 0; band < std::min(kBands, erosion->bands.size()); ++band)
        for (std::size_t n = 0; n < bands.size(); ++n) bands[n][band] = erosion->bands[band][n];
}

std::size_t CoverageField::memory_bytes() const {
    return nodes_.size() + cells_.size() + 4 * cell_density_.size() + 4 * (table_.size() + places_.size());
}

std::vector<float> detailed_density(const CoverageField& field, const Vec3& corner_m,
                                    const std::array<int, 3>& count, double footprint_m) {
    const auto nx = std::size_t(count[0]), ny = std::size_t(count[1]), nz = std::size_t(count[2]);
    std::vector<float> result(nx * ny * nz, 0.0f);
    const DetailKernel kernel(field);
    const Vec3 from = corner_m - field.corner_m();
    const double per_brick = 1 / (field.node_m() * (kEdge - 1));
    tbb::parallel_for(std::size_t{0}, ny * nz, [&](std::size_t row) {
        const double y = from.y + (double(row % ny) + 0.5) * footprint_m,
                     z = from.z + (double(row / ny) + 0.5) * footprint_m;
        const int by = int(std::floor(y * per_brick)), bz = int(std::floor(z * per_brick));
        if (by < 0 || bz < 0 || by >= kernel.bricks[1] || bz >= kernel.bricks[2]) return;
        std::vector<float> local[3], place[3];
        const auto x_of = [&](std::size_t i) { return from.x + (double(i) + 0.5) * footprint_m; };
        const auto brick_of = [&](std::size_t i) { return int(std::floor(x_of(i) * per_brick)); };
        for (std::size_t begin = 0, end = 0; begin < nx; begin = end) {
            const int bx = brick_of(begin);
            while (end < nx && brick_of(end) == bx) ++end;
            if (bx < 0 || bx >= kernel.bricks[0]) continue;
            const std::int32_t brick =
                kernel.table[(std::size_t(bz) * std::size_t(kernel.bricks[1]) + std::size_t(by)) *
                                 std::size_t(kernel.bricks[0]) +
                             std::size_t(bx)];
            if (brick < 0) continue;
            for (auto& values : local) values.clear();
            for (auto& values : place) values.clear();
            for (std::size_t i = begin; i < end; ++i) {
                const double at[3] = {x_of(i), y, z};
                const int b[3] = {bx, by, bz};
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    place[axis].push_back(float(at[axis]));
                    local[axis].push_back(float((at[axis] * per_brick - b[axis]) * (kEdge - 1)));
                }
            }
            for (std::size_t axis = 0; axis < 3; ++axis) {
                place[axis].resize(place[axis].size() + kLanesBehind);
                local[axis].resize(local[axis].size() + kLanesBehind);
            }
            const float* const locals[3] = {local[0].data(), local[1].data(), local[2].data()};
            const float* const places[3] = {place[0].data(), place[1].data(), place[2].data()};
            HWY_DYNAMIC_DISPATCH(sample_places)
            (kernel, brick, locals, places, end - begin, float(footprint_m), &result[row * nx + begin]);
        }
    });
    return result;
}

void detailed_density_of_brick(const CoverageField& field, std::size_t number, double footprint_m,
                               BrickSamples samples, std::span<float> out) {
    const DetailKernel kernel(field);
    const auto at = brick_at(field.places()[number], field.bricks());
    float corner[3];
    for (std::size_t axis = 0; axis < 3; ++axis) corner[axis] = float(at[axis] * field.node_m() * (kEdge - 1));
    HWY_DYNAMIC_DISPATCH(sample_brick)(kernel, std::int32_t(number), corner, float(footprint_m), samples, out.data());
}

double bump_size_m(const DetailOptions& options, double cell_m) {
    return options.size_m > 0 ? options.size_m : 4 * cell_m;
}

float detailed_density_at(const CoverageField& field, const Vec3& place_m, float footprint) {
    const Vec3 from = place_m - field.corner_m();
    const auto& bricks = field.bricks();
    int b[3], whole[3];
    float rest[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double nodes = from[axis] / field.node_m();
        b[axis] = int(std::floor(nodes / (kEdge - 1)));
        if (b[axis] < 0 || b[axis] >= bricks[std::size_t(axis)]) return 0;
        const double local = nodes - double(b[axis]) * (kEdge - 1);
        whole[axis] = std::min(int(local), kEdge - 2);
        rest[axis] = float(local - whole[axis]);
    }
    const std::int32_t brick =
        field.table()[(std::size_t(b[2]) * std::size_t(bricks[1]) + std::size_t(b[1])) * std::size_t(bricks[0]) +
                      std::size_t(b[0])];
    if (brick < 0) return 0;
    const std::uint8_t* nodes = &field.nodes()[std::size_t(brick) * CoverageField::kBrickBytes];
    float t = 0, growth = 0;
    for (int n = 0; n < 8; ++n) {
        const int o[3] = {n & 1, n >> 1 & 1, n >> 2};
        float weight = 1;
        for (int axis = 0; axis < 3; ++axis) weight *= o[axis] != 0 ? rest[axis] : 1 - rest[axis];
        const std::uint8_t* at =
            nodes + 2 * (((whole[2] + o[2]) * kEdge + whole[1] + o[1]) * kEdge + whole[0] + o[0]);
        t += weight * float(at[0]) / 255.0f;
        growth += weight * (float(at[1]) - 128.0f) / 127.0f;
    }
    const ErosionConstants& e = field.erosion();
    footprint *= e.footprint_scale;
    const float coverage = text::coverage_of(t), c = coverage + e.whole, top = text::towards_top(float(from.z) - e.base_m);
    const float large = text::large_width(top, growth, e.base_width, e.top_width, e.dissolving_width);
    const float medium = text::medium_width(footprint, e.medium_width),
                fine = text::fine_width(footprint, e.fine_width), soft = text::edge_softness(footprint);
    const float others = 0.5f * (medium + fine + soft);
    if (!(c > 0.5f - 0.5f * large - others && coverage > e.least_coverage)) return 0;
    std::array<float, 3> own{}, next{};
    for (std::size_t row = 0; row < 3; ++row) {
        const auto& to = e.to_noise[row];
        own[row] = to[0] * float(from.x) + to[1] * float(from.y) + to[2] * float(from.z) + to[3];
    }
    float share = 0, all_apart = 0;
    if (!e.bands.empty()) {
        const int last = int(e.bands.size()) - 1;
        const float place = (float(from.z) - e.bands_begin_m) * e.bands_per_m - 0.5f;
        const int below = std::clamp(int(std::floor(place)), 0, last), above = std::min(below + 1, last);
        share = text::share_of_upper(place - float(below));
        all_apart = e.bands[std::size_t(below)][3];
        for (std::size_t row = 0; row < 3; ++row) {
            next[row] = own[row] + e.bands[std::size_t(above)][row];
            own[row] += e.bands[std::size_t(below)][row];
        }
    }
    const auto of_bands = [&](float apart, const auto& look_up) {
        const float of_own = look_up(own[0], own[1], own[2]);
        return share > 0 ? text::mean_of_uniform(of_own, look_up(next[0], next[1], next[2]), share, apart) : of_own;
    };
    const auto edge = float(kLargeNoiseVoxels);
    float noise = 0.5f + large * (of_bands(all_apart, [&](float u, float v, float w) {
                                      return scalar_noise(detail_noise().large, kLargeNoiseVoxels, u * edge, v * edge,
                                                          w * edge);
                                  }) - 0.5f);
    const auto level = [&](float voxels_per_m) {
        int exponent = 0;
        const float mantissa = std::frexp(std::max(footprint * voxels_per_m, 1.0f), &exponent);
        return std::min(float(exponent - 1) + (2 * mantissa - 1), 3.0f);
    };
    if (std::abs(c - noise) < others && medium > 0) {
        const float s = e.medium_scale * float(kSmallNoiseVoxels), f = e.fine_scale * float(kSmallNoiseVoxels);
        const float bumps = of_bands(text::apart_of_small(all_apart), [&](float u, float v, float w) {
            const float a = u * s, g = w * s;
            return scalar_small_noise(level(e.medium_per_m), 0.6f * a - 0.8f * g, v * s, 0.8f * a + 0.6f * g);
        });
        noise += medium * text::billows(top, growth, e.wisps) * (bumps - 0.5f);
        const auto grain = [&](float u, float v, float w) {
            return scalar_small_noise(level(e.fine_per_m), u * f, v * f, w * f);
        };
        if (fine > 0) noise += fine * (of_bands(text::apart_of_small(all_apart), grain) - 0.5f);
    }
    const float mask = text::saturate((c - noise) / soft + 0.5f);
    const float small = std::min(std::sqrt(medium * medium + soft * soft), large);
    const float fraction = std::max(text::cloudy_fraction(c, large, small), 0.02f);
    const float coarse = text::saturate((footprint - 13.0f) / 12.0f);
    const float mean = text::density_of(t, e.half_density);
    return mask * std::min((e.gain[0] + coarse * (e.gain[1] - e.gain[0])) * mean / fraction, std::max(mean, e.cap));
}

DensityGrid resample_with_detail(const CoverageField& field, Extent coarse, const Placement& placement, int refine) {
    if (refine < 1 || refine > kMaxRefine)
        throw Error(ErrorCode::usage,
                    "refinement of " + std::to_string(refine) + " voxels per cell: must be 1..8");
    if (std::int64_t{std::max({coarse.x, coarse.y, coarse.z})} * refine > std::numeric_limits<int>::max() - kBlock)
        throw Error(ErrorCode::usage,
                    "a refinement of " + std::to_string(refine) + " gives too many voxels on an axis");
    const Extent fine{coarse.x * refine, coarse.y * refine, coarse.z * refine};
    Placement finer = placement;
    finer.cell_size_m /= refine;
    // Blocks that a brick with cloud touches.
    const auto& bricks = field.bricks();
    const Vec3 shift = (field.corner_m() - placement.origin_m) / finer.cell_size_m;  // voxels
    const double brick_voxels = field.node_m() * (kEdge - 1) / finer.cell_size_m;
    std::vector<openvdb::Coord> origins;
    for (const std::int32_t place : field.places()) {
        const auto at = brick_at(place, bricks);
        int low[3], high[3];
        const int sizes[3] = {fine.x, fine.y, fine.z};
        for (int axis = 0; axis < 3; ++axis) {
            const double begin = shift[axis] + at[std::size_t(axis)] * brick_voxels;
            low[axis] = std::max(int(std::floor(begin)), 0) & ~(kBlock - 1);
            high[axis] = std::min(int(std::ceil(begin + brick_voxels)), sizes[axis]);
        }
        for (int z = low[2]; z < high[2]; z += kBlock)
            for (int y = low[1]; y < high[1]; y += kBlock)
                for (int x = low[0]; x < high[0]; x += kBlock) origins.emplace_back(x, y, z);
    }
    std::ranges::sort(origins, {}, block_order);
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
    std::vector<NewBlock> blocks(origins.size());
    tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
        const openvdb::Coord& o = origins[n];
        const Vec3 corner = placement.origin_m + finer.cell_size_m * Vec3(o.x(), o.y(), o.z());
        const std::vector<float> values =
            detailed_density(field, corner, {kBlock, kBlock, kBlock}, finer.cell_size_m);
        auto leaf = uninitialised_leaf(o);
        float* const out = leaf->buffer().data();
        for (int v = 0; v < kBlockVoxels; ++v) {
            const int x = v & 7, y = v >> 3 & 7, z = v >> 6;
            const bool inside = o.x() + x < fine.x && o.y() + y < fine.y && o.z() + z < fine.z;
            out[leaf_offset(x, y, z)] = inside ? values[std::size_t(v)] : 0.0f;
        }
        blocks[n] = NewBlock::from(std::move(leaf));
    });
    TreeBuilder builder;
    for (std::size_t n = 0; n < blocks.size(); ++n) blocks[n].move_to(builder, origins[n]);
    return builder.finish(fine, finer);
}

}  // namespace nephos
#endif
