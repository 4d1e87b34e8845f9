// SPDX-License-Identifier: Apache-2.0
#include "density/density_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/text.h"
#include "density/openvdb_access.h"

namespace nephos {

struct DensityGrid::Impl {
    FloatGrid::Ptr grid;
    Extent extent;
    Placement placement;
};

namespace {

using Node1 = FloatTree::RootNodeType::ChildNodeType::ChildNodeType;

void check_placement(const Placement& placement) {
    if (!(placement.cell_size_m > 0) || !std::isfinite(placement.cell_size_m)) {
        throw Error(ErrorCode::usage,
                    "cell size " + number_text(placement.cell_size_m, 6) + " m: must be above 0 and finite");
    }
}

// Returns the number of blocks along an axis of n voxels.
int block_count(int n) { return (n + kBlock - 1) / kBlock; }

// Copies the part of a dense array that lies in the block at `origin` into a leaf.
void fill_leaf(FloatLeaf& leaf, std::span<const float> values, Extent extent, const openvdb::Coord& origin) {
    float* out = leaf.buffer().data();
    std::fill_n(out, kBlockVoxels, 0.0f);
    const int nx = std::min(kBlock, extent.x - origin.x());
    const int ny = std::min(kBlock, extent.y - origin.y());
    const int nz = std::min(kBlock, extent.z - origin.z());
    for (int z = 0; z < nz; ++z) {
        for (int y = 0; y < ny; ++y) {
            const float* row = &values[linear_index(extent, origin.x(), origin.y() + y, origin.z() + z)];
            for (int x = 0; x < nx; ++x) out[leaf_offset(x, y, z)] = row[x];
        }
    }
}

}  // namespace

TreeBuilder::TreeBuilder() : grid_(FloatGrid::create(0.0f)), accessor_(grid_->tree()) {}

void TreeBuilder::add(std::unique_ptr<FloatLeaf> leaf) { accessor_.addLeaf(leaf.release()); }

void TreeBuilder::add_tile(const openvdb::Coord& origin, float value) {
    accessor_.addTile(Node1::LEVEL, origin, value, true);
}

DensityGrid TreeBuilder::finish(Extent extent, const Placement& placement) {
    if (extent.cells() > 0) {
        accessor_.setActiveState({0, 0, 0}, true);
        accessor_.setActiveState({extent.x - 1, extent.y - 1, extent.z - 1}, true);
    }
    return OpenvdbAccess::wrap(std::move(grid_), extent, placement);
}

const FloatGrid& OpenvdbAccess::grid(const DensityGrid& density) { return *density.impl_->grid; }

DensityGrid OpenvdbAccess::wrap(FloatGrid::Ptr grid, Extent extent, const Placement& placement) {
    return DensityGrid(
        std::make_shared<const DensityGrid::Impl>(DensityGrid::Impl{std::move(grid), extent, placement}));
}

std::unique_ptr<FloatLeaf> uninitialised_leaf(const openvdb::Coord& origin) {
    auto leaf = std::make_unique<FloatLeaf>(openvdb::PartialCreate(), origin);
    leaf->allocate();
    return leaf;
}

int Block::positive_count() const {
    if (!leaf) return kBlockVoxels;
    const float* values = leaf->buffer().data();
    return int(std::count_if(values, values + kBlockVoxels, [](float v) { return v > 0; }));
}

void Block::copy_to(float* to, const std::array<std::size_t, 3>& stride, Extent extent) const {
    const int x = origin.x(), y = origin.y(), z = origin.z();
    const int nx = std::min(kBlock, extent.x - x), ny = std::min(kBlock, extent.y - y),
              nz = std::min(kBlock, extent.z - z);
    float* first =
        to + std::size_t(x) * stride[0] + std::size_t(y) * stride[1] + std::size_t(z) * stride[2];
    if (leaf == nullptr) {
        for (int k = 0; k < nz; ++k)
            for (int j = 0; j < ny; ++j)
                for (int i = 0; i < nx; ++i)
                    first[std::size_t(i) * stride[0] + std::size_t(j) * stride[1] + std::size_t(k) * stride[2]] =
                        tile;
        return;
    }
    const float* values = leaf->buffer().data();
    if (stride[0] == 1 && nx == kBlock) {
        // Rows of the array, whose length the compiler knows.
        for (int k = 0; k < nz; ++k) {
            for (int j = 0; j < ny; ++j) {
                float* row = first + std::size_t(j) * stride[1] + std::size_t(k) * stride[2];
                const float* from = values + leaf_offset(0, j, k);
                for (int i = 0; i < kBlock; ++i) row[i] = from[leaf_offset(i, 0, 0)];
            }
        }
        return;
    }
    for (int i = 0; i < nx; ++i)
        for (int j = 0; j < ny; ++j)
            for (int k = 0; k < nz; ++k)
                first[std::size_t(i) * stride[0] + std::size_t(j) * stride[1] + std::size_t(k) * stride[2]] =
                    values[leaf_offset(i, j, k)];
}

NewBlock NewBlock::from(std::unique_ptr<FloatLeaf> leaf) {
    const float* values = leaf->buffer().data();
    openvdb::util::NodeMask<3> mask;
    bool uniform = true;
    for (int n = 0; n < kBlockVoxels; n += 64) {
        std::uint64_t word = 0;
        for (int bit = 0; bit < 64; ++bit) {
            word |= std::uint64_t(values[n + bit] > 0) << bit;
            uniform = uniform && values[n + bit] == values[0];
        }
        mask.getWord<std::uint64_t>(openvdb::Index(n / 64)) = word;
    }
    if (uniform) return {nullptr, values[0]};
    leaf->setValueMask(mask);
    return {std::move(leaf), 0};
}

void NewBlock::move_to(TreeBuilder& builder, const openvdb::Coord& origin) {
    if (leaf) {
        builder.add(std::move(leaf));
    } else if (tile > 0) {
        builder.add_tile(origin, tile);
    }
}

std::tuple<int, int, int> block_order(const openvdb::Coord& origin) {
    return {origin.z(), origin.y(), origin.x()};
}

std::vector<Block> blocks_of(const DensityGrid& density) {
    std::vector<Block> blocks;
    const auto& root = OpenvdbAccess::grid(density).tree().root();
    for (auto node2 = root.cbeginChildOn(); node2; ++node2) {
        for (auto node1 = node2->cbeginChildOn(); node1; ++node1) {
            for (auto leaf = node1->cbeginChildOn(); leaf; ++leaf) {
                blocks.push_back({leaf->origin(), &*leaf, 0});
            }
            for (auto tile = node1->cbeginValueOn(); tile; ++tile) {
                blocks.push_back({tile.getCoord(), nullptr, *tile});
            }
        }
    }
    std::ranges::sort(blocks, {}, [](const Block& block) { return block_order(block.origin); });
    return blocks;
}

DensityGrid::DensityGrid()
    : impl_(std::make_shared<const Impl>(Impl{FloatGrid::create(0.0f), Extent{}, Placement{}})) {}

DensityGrid::DensityGrid(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

DensityGrid DensityGrid::from_dense(std::span<const float> values, Extent extent,
                                    const Placement& placement) {
    check_placement(placement);
    if (extent.x < 0 || extent.y < 0 || extent.z < 0 || values.size() != extent.cells()) {
        throw Error(ErrorCode::usage, std::to_string(values.size()) + " values for a box of " +
                                          std::to_string(extent.x) + " x " + std::to_string(extent.y) +
                                          " x " + std::to_string(extent.z) + " voxels");
    }
    const auto bad = std::ranges::find_if_not(values, [](float v) { return v >= 0 && std::isfinite(v); });
    if (bad != values.end()) {
        throw Error(ErrorCode::usage, "density " + number_text(*bad, 6) + " at position " +
                                          std::to_string(bad - values.begin()) +
                                          ": must be finite and at least 0");
    }
    TreeBuilder builder;
    const int bx = block_count(extent.x), by = block_count(extent.y), bz = block_count(extent.z);
    std::vector<NewBlock> layer(std::size_t(bx) * std::size_t(by));
    for (int z = 0; z < bz; ++z) {
        const auto origin = [&](std::size_t n) {
            return openvdb::Coord(int(n) % bx * kBlock, int(n) / bx * kBlock, z * kBlock);
        };
        tbb::parallel_for(std::size_t{0}, layer.size(), [&](std::size_t n) {
            auto leaf = uninitialised_leaf(origin(n));
            fill_leaf(*leaf, values, extent, origin(n));
            layer[n] = NewBlock::from(std::move(leaf));
        });
        for (std::size_t n = 0; n < layer.size(); ++n) layer[n].move_to(builder, origin(n));
    }
    return builder.finish(extent, placement);
}

Extent DensityGrid::extent() const { return impl_->extent; }

const Placement& DensityGrid::placement() const { return impl_->placement; }

float DensityGrid::value(int i, int j, int k) const {
    return impl_->grid->tree().getValue(openvdb::Coord(i, j, k));
}

std::uint64_t DensityGrid::active_voxels() const {
    std::uint64_t count = 0;
    for (const Block& block : blocks_of(*this)) count += std::uint64_t(block.positive_count());
    return count;
}

VoxelBox DensityGrid::bounding_box() const {
    openvdb::CoordBBox box;
    for (const Block& block : blocks_of(*this)) {
        if (!block.leaf) {
            box.expand(block.origin, kBlock);
            continue;
        }
        for (auto voxel = block.leaf->cbeginValueOn(); voxel; ++voxel) {
            if (*voxel > 0) box.expand(voxel.getCoord());
        }
    }
    if (box.empty()) return {};
    return {{box.min().x(), box.min().y(), box.min().z()}, {box.max().x(), box.max().y(), box.max().z()}};
}

// The largest of a leaf's values, in lanes that the compiler makes vectors of.
static float largest_of(const float* values) {
    constexpr int kLanes = 16;
    float lanes[kLanes] = {};
    for (int n = 0; n < kBlockVoxels; n += kLanes)
        for (int lane = 0; lane < kLanes; ++lane)
            lanes[lane] = lanes[lane] < values[n + lane] ? values[n + lane] : lanes[lane];
    return *std::max_element(lanes, lanes + kLanes);
}

float DensityGrid::max_value() const {
    float largest = 0;
    const auto& root = impl_->grid->tree().root();
    for (auto node2 = root.cbeginChildOn(); node2; ++node2) {
        for (auto node1 = node2->cbeginChildOn(); node1; ++node1) {
            for (auto leaf = node1->cbeginChildOn(); leaf; ++leaf)
                largest = std::max(largest, largest_of(leaf->buffer().data()));
            for (auto tile = node1->cbeginValueOn(); tile; ++tile) largest = std::max(largest, *tile);
        }
    }
    return largest;
}

// Four blocks at a time, as their sums do not wait for each other; each has the bits that it has alone.
double DensityGrid::sum() const {
    constexpr std::size_t kTogether = 4;
    const std::vector<Block> blocks = blocks_of(*this);
    const std::array<float, kBlockVoxels> none{};
    double total = 0;
    for (std::size_t first = 0; first < blocks.size(); first += kTogether) {
        const std::size_t count = std::min(kTogether, blocks.size() - first);
        std::array<const float*, kTogether> values;
        values.fill(none.data());
        for (std::size_t n = 0; n < count; ++n)
            if (blocks[first + n].leaf) values[n] = blocks[first + n].leaf->buffer().data();
        std::array<double, kTogether> parts{};
        for (std::size_t v = 0; v < kBlockVoxels; ++v)
            for (std::size_t n = 0; n < kTogether; ++n) parts[n] += double(values[n][v]);
        for (std::size_t n = 0; n < count; ++n) {
            if (!blocks[first + n].leaf)
                for (int v = 0; v < kBlockVoxels; ++v) parts[n] += double(blocks[first + n].tile);
            total += parts[n];
        }
    }
    return total;
}

std::vector<float> DensityGrid::to_dense() const {
    std::vector<float> dense(impl_->extent.cells(), 0.0f);
    const auto blocks = blocks_of(*this);
    const Extent extent = impl_->extent;
    const std::array<std::size_t, 3> stride{1, std::size_t(extent.x),
                                            std::size_t(extent.x) * std::size_t(extent.y)};
    tbb::parallel_for(std::size_t{0}, blocks.size(),
                      [&](std::size_t n) { blocks[n].copy_to(dense.data(), stride, extent); });
    return dense;
}

namespace {

std::array<int, 3> low_of(const Block& block) {
    return {block.origin.x(), block.origin.y(), block.origin.z()};
}

std::array<int, 3> size_of(const Block& block, Extent extent) {
    return {std::min(kBlock, extent.x - block.origin.x()), std::min(kBlock, extent.y - block.origin.y()),
            std::min(kBlock, extent.z - block.origin.z())};
}

using BlockValues = std::array<float, kBlockVoxels>;

// The values of a block inside of the extent, x fastest.
std::span<const float> values_of(const Block& block, Extent extent, BlockValues& values) {
    const auto [nx, ny, nz] = size_of(block, extent);
    std::size_t at = 0;
    for (int k = 0; k < nz; ++k)
        for (int j = 0; j < ny; ++j)
            for (int i = 0; i < nx; ++i) values[at++] = block.value(leaf_offset(i, j, k));
    return std::span(values).first(at);
}

}  // namespace

void DensityGrid::visit_blocks(const std::function<void(const VoxelBlock&)>& visit) const {
    const Extent extent = impl_->extent;
    BlockValues values{};
    for (const Block& block : blocks_of(*this))
        visit({low_of(block), size_of(block, extent), values_of(block, extent, values)});
}

void DensityGrid::visit_blocks(
    const DensityGrid& other,
    const std::function<void(std::span<const float>, std::span<const float>)>& visit) const {
    const Extent extent = impl_->extent;
    if (!(other.extent() == extent))
        throw Error(ErrorCode::usage, "grids of different extents have no blocks in common");
    const std::vector<Block> ours = blocks_of(*this), others = blocks_of(other);
    BlockValues values{}, other_values{};
    const BlockValues zeros{};
    for (auto a = ours.begin(), b = others.begin(); a != ours.end() || b != others.end();) {
        const bool is_ours =
            b == others.end() || (a != ours.end() && block_order(a->origin) <= block_order(b->origin));
        const bool is_others =
            a == ours.end() || (b != others.end() && block_order(b->origin) <= block_order(a->origin));
        std::span<const float> of_ours, of_others;
        if (is_ours) of_ours = values_of(*a++, extent, values);
        if (is_others) of_others = values_of(*b++, extent, other_values);
        const std::span<const float> none =
            std::span(zeros).first(std::max(of_ours.size(), of_others.size()));
        visit(is_ours ? of_ours : none, is_others ? of_others : none);
    }
}

std::size_t DensityGrid::memory_bytes() const { return impl_->grid->memUsage(); }

}  // namespace nephos
