// SPDX-License-Identifier: Apache-2.0
#include "density/smoothing.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/text.h"
#include "density/openvdb_access.h"
#include "density/smoothing_kernel.h"

namespace nephos {
namespace {

constexpr int kMaxRadius = 16;
constexpr int kGaussianPeak = 64;

void check_radius(int radius, const char* name) {
    if (radius < 0 || radius > kMaxRadius) {
        throw Error(ErrorCode::usage, std::string("smoothing radius ") + name + " = " +
                                          std::to_string(radius) + ": must be 0.." +
                                          std::to_string(kMaxRadius));
    }
}

// exp(-x) for 0 <= x < 8 from IEEE sums and products alone, so that weights are the same whatever the C
// library: the Taylor series at x / 256, squared eight times.
double exp_of_minus(double x) {
    const double y = -x / 256;
    double term = 1, sum = 1;
    for (int n = 1; n <= 8; ++n) {
        term *= y / n;
        sum += term;
    }
    for (int n = 0; n < 8; ++n) sum *= sum;
    return sum;
}

double sum_of(const std::vector<std::uint32_t>& weights) {
    double sum = 0;
    for (std::uint32_t w : weights) sum += w;
    return sum;
}

// The smallest float whose product with float(total) is at least 1: then min(1, ..) makes a saturated window
// exactly 1.
float reciprocal_of(double total) {
    const float whole = float(total);
    float r = float(1.0 / double(whole));
    while (whole * r < 1.0f) r = std::nextafter(r, 2.0f);
    return r;
}

void check_planes(std::span<const TimedPlane> planes, int t0) {
    if (planes.empty()) throw Error(ErrorCode::usage, "smoothing needs at least one bit plane");
    std::vector<bool> seen(std::size_t(2 * t0 + 1));
    for (const TimedPlane& plane : planes) {
        if (!(plane.cld.extent == planes.front().cld.extent)) {
            throw Error(ErrorCode::usage, "the bit planes of a smoothing window differ in extent");
        }
        if (std::abs(plane.step_offset) > t0) {
            throw Error(ErrorCode::usage, "step offset " + std::to_string(plane.step_offset) +
                                              " lies outside the smoothing window of " + std::to_string(t0) +
                                              " steps each way");
        }
        auto&& twice = seen[std::size_t(plane.step_offset + t0)];
        if (twice) {
            throw Error(ErrorCode::usage,
                        "step offset " + std::to_string(plane.step_offset) + " is given twice");
        }
        twice = true;
    }
}

SmoothingPlan make_plan(std::span<const TimedPlane> planes, const SmoothingOptions& options,
                        const Boundaries& boundaries) {
    check_radius(options.i0, "i0");
    check_radius(options.j0, "j0");
    check_radius(options.k0, "k0");
    check_radius(options.t0, "t0");
    check_planes(planes, options.t0);
    SmoothingPlan plan;
    plan.extent = planes.front().cld.extent;
    plan.boundaries = boundaries;
    plan.wx = kernel_weights(options.kernel, options.i0);
    plan.wy = kernel_weights(options.kernel, options.j0);
    plan.wz = kernel_weights(options.kernel, options.k0);
    const auto wt = kernel_weights(options.kernel, options.t0);
    for (const TimedPlane& plane : planes) {
        plan.planes.push_back(plane.cld);
        plan.plane_weights.push_back(wt[std::size_t(plane.step_offset + options.t0)]);
    }
    plan.total = sum_of(plan.wx) * sum_of(plan.wy) * sum_of(plan.wz) * sum_of(plan.plane_weights);
    plan.reciprocal = reciprocal_of(plan.total);
    const bool unit = options.kernel == SmoothingKernel::box;
    plan.type = unit && plan.total < 256    ? SumType::u8
                : plan.total < 65536        ? SumType::u16
                : plan.total < 2147483648.0 ? SumType::u32
                                            : SumType::f64;
    return plan;
}

// Tiles in the order y, x. Wide ones write long rows; deep ones repeat fewer halo rows; both at once leave
// the cache.
std::vector<SmoothingTile> make_tiles(const SmoothingPlan& plan) {
    const int words = std::min((plan.extent.x + 63) / 64, kMaxWords);
    const int rows = words <= kMaxWords / 2 ? kMaxRows : kMaxRows / 2;
    std::vector<SmoothingTile> tiles;
    const int row_words = (plan.extent.x + 63) / 64;
    const int all_rows = (plan.extent.y + kBlock - 1) / kBlock * kBlock;
    for (int y = 0; y < all_rows; y += rows) {
        for (int w = 0; w < row_words; w += words) {
            tiles.push_back({w, std::min(words, row_words - w), y, std::min(rows, all_rows - y)});
        }
    }
    return tiles;
}

// The finished blocks of one tile.
class TileBlocks final : public BlockSink {
  public:
    float* begin_block(int x, int y, int z) override {
        leaves_.push_back(uninitialised_leaf({x, y, z}));
        return leaves_.back()->buffer().data();
    }
    void end_block(const std::uint64_t (&mask)[8]) override {
        openvdb::util::NodeMask<3> bits;
        for (openvdb::Index n = 0; n < 8; ++n) bits.getWord<std::uint64_t>(n) = mask[n];
        leaves_.back()->setValueMask(bits);
    }
    void saturated_block(int x, int y, int z) override { saturated_.push_back({x, y, z}); }

    void move_to(TreeBuilder& builder) {
        for (auto& leaf : leaves_) builder.add(std::move(leaf));
        for (const openvdb::Coord& origin : saturated_) builder.add_tile(origin, 1.0f);
        leaves_.clear();
    }

  private:
    std::vector<std::unique_ptr<FloatLeaf>> leaves_;
    std::vector<openvdb::Coord> saturated_;
};

// Pairs the blocks of two grids by position, with a tile of 0 for a missing one.
std::vector<std::pair<Block, Block>> pair_blocks(const std::vector<Block>& a, const std::vector<Block>& b) {
    std::vector<std::pair<Block, Block>> pairs;
    auto left = a.begin(), right = b.begin();
    while (left != a.end() || right != b.end()) {
        const bool take_left =
            right == b.end() || (left != a.end() && block_order(left->origin) <= block_order(right->origin));
        const bool take_right =
            left == a.end() || (right != b.end() && block_order(right->origin) <= block_order(left->origin));
        const openvdb::Coord origin = take_left ? left->origin : right->origin;
        const Block nothing{origin, nullptr, 0};
        pairs.emplace_back(take_left ? *left : nothing, take_right ? *right : nothing);
        if (take_left) ++left;
        if (take_right) ++right;
    }
    return pairs;
}

}  // namespace

std::vector<std::uint32_t> kernel_weights(SmoothingKernel kernel, int radius) {
    check_radius(radius, "");
    std::vector<std::uint32_t> weights;
    for (int n = -radius; n <= radius; ++n) {
        const double x = n / ((radius + 0.5) / 2);
        switch (kernel) {
            case SmoothingKernel::box:
                weights.push_back(1);
                break;
            case SmoothingKernel::tent:
                weights.push_back(std::uint32_t(radius + 1 - std::abs(n)));
                break;
            case SmoothingKernel::gaussian:
                weights.push_back(
                    std::uint32_t(std::max(1.0, std::floor(kGaussianPeak * exp_of_minus(x * x / 2) + 0.5))));
                break;
        }
    }
    return weights;
}

DensityGrid smooth(std::span<const TimedPlane> planes, const SmoothingOptions& options,
                   const Placement& placement, const Boundaries& boundaries) {
    const SmoothingPlan plan = make_plan(planes, options, boundaries);
    const auto tiles = make_tiles(plan);
    std::vector<TileBlocks> blocks(tiles.size());
    tbb::parallel_for(std::size_t{0}, tiles.size(),
                      [&](std::size_t n) { smooth_tile(plan, tiles[n], blocks[n]); });
    TreeBuilder builder;
    for (TileBlocks& tile : blocks) tile.move_to(builder);
    return builder.finish(plan.extent, placement);
}

DensityGrid mix(const DensityGrid& a, const DensityGrid& b, double fraction) {
    if (!(fraction >= 0 && fraction <= 1)) {
        throw Error(ErrorCode::usage,
                    "fraction " + number_text(fraction, 6) + " between two steps: must be 0..1");
    }
    if (!(a.extent() == b.extent()) || !(a.placement() == b.placement())) {
        throw Error(ErrorCode::usage, "only grids of the same extent and placement can be mixed");
    }
    if (fraction == 0) return a;
    if (fraction == 1) return b;
    const auto pairs = pair_blocks(blocks_of(a), blocks_of(b));
    std::vector<NewBlock> blocks(pairs.size());
    tbb::parallel_for(std::size_t{0}, pairs.size(), [&](std::size_t n) {
        auto leaf = uninitialised_leaf(pairs[n].first.origin);
        float* out = leaf->buffer().data();
        const float f = float(fraction);
        for (int v = 0; v < kBlockVoxels; ++v) {
            const float from = pairs[n].first.value(v), to = pairs[n].second.value(v);
            out[v] = from + (to - from) * f;
        }
        blocks[n] = NewBlock::from(std::move(leaf));
    });
    TreeBuilder builder;
    for (std::size_t n = 0; n < blocks.size(); ++n) blocks[n].move_to(builder, pairs[n].first.origin);
    return builder.finish(a.extent(), a.placement());
}

}  // namespace nephos
