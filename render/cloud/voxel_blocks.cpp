// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/voxel_blocks.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include <tbb/parallel_for.h>

namespace nephos {
namespace {

constexpr std::size_t kMostLattices = 16;
constexpr double kFarthest =
    (1 << 22) - 2 * kBlockSide;                  // voxels from the origin: neighbours have a number too
constexpr int kOrigin = (1 << 22) / kBlockSide;  // number of the block at the world's origin
constexpr std::size_t kPart = 8192;              // metaballs that one thread looks at

double coordinate(const Metaball& ball, int axis) { return axis == 0 ? ball.x : axis == 1 ? ball.y : ball.z; }

// Returns the phase of a lattice by its first metaball, whose centre is that of a voxel; rounded to 1/64, so
// that rounding of coordinates moves no voxel into another block.
double phase_of(double coordinate_in_voxels) {
    const double steps = std::floor((coordinate_in_voxels - std::floor(coordinate_in_voxels)) * 64 + 0.5);
    return (steps >= 64 ? 0 : steps / 64) - 0.5;
}

// The first metaball of each radius, with and without detail, by its place in `visible`; no more than are of use.
std::vector<std::uint32_t> first_of_radii(const PreparedCloud& cloud, std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> first;
    float last = -1;
    std::uint8_t last_detailed = 0;
    for (std::size_t i = begin; i < end && first.size() <= kMostLattices; ++i) {
        const float radius = cloud.metaballs[cloud.visible[i]].radius;
        const std::uint8_t detailed = cloud.detail_of(i);
        if (radius == last && detailed == last_detailed) continue;
        last = radius;
        last_detailed = detailed;
        const auto is_alike = [&](std::uint32_t n) {
            return cloud.metaballs[cloud.visible[n]].radius == radius && cloud.detail_of(n) == detailed;
        };
        if (std::ranges::none_of(first, is_alike)) first.push_back(std::uint32_t(i));
    }
    return first;
}

struct RunPart {
    std::vector<BlockRun> runs;
    bool inside = true;  // no ball is too far away
};

RunPart runs_of_part(const PreparedCloud& cloud, std::span<const VoxelLattice> lattices, std::size_t begin,
                     std::size_t end, std::vector<VoxelPlace>& places) {
    RunPart part;
    std::size_t lattice = 0;
    for (std::size_t i = begin; i < end; ++i) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        while (lattices[lattice].radius != ball.radius || lattices[lattice].detailed != cloud.detail_of(i))
            lattice = (lattice + 1) % lattices.size();
        const VoxelLattice& of = lattices[lattice];
        const double x = ball.x * of.per_edge - of.phase[0], y = ball.y * of.per_edge - of.phase[1],
                     z = ball.z * of.per_edge - of.phase[2];
        if (!(std::max({std::abs(x), std::abs(y), std::abs(z)}) < kFarthest)) return {{}, false};
        const auto voxel = [](double at) { return std::uint32_t(std::int32_t(at + kOrigin * kBlockSide)); };
        const std::uint32_t vx = voxel(x), vy = voxel(y), vz = voxel(z);
        const auto block = [](std::uint32_t at) { return at / kBlockSide; };
        const std::uint64_t number =
            ((std::uint64_t(lattice) << kBlockPlaceBits | block(vz)) << kBlockPlaceBits | block(vy))
                << kBlockPlaceBits |
            block(vx);
        const auto inside = [&](double at, std::uint32_t of_voxel) {
            return float(at - (std::int32_t(block(of_voxel)) - kOrigin) * kBlockSide);
        };
        const auto pair = [](std::uint32_t at) { return at / 2 % 4; };
        places[i] = {inside(x, vx), inside(y, vy), inside(z, vz), (pair(vz) * 4 + pair(vy)) * 4 + pair(vx)};
        if (part.runs.empty() || part.runs.back().block != number)
            part.runs.push_back({number, std::uint32_t(i), std::uint32_t(i)});
        part.runs.back().end = std::uint32_t(i) + 1;
    }
    return part;
}

// Returns the lattices of a cloud; none if there are too many.
std::vector<VoxelLattice> voxel_lattices(const PreparedCloud& cloud, double radius_voxels) {
    const std::size_t count = cloud.visible.size(), parts = (count + kPart - 1) / kPart;
    std::vector<std::vector<std::uint32_t>> found(parts);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        found[p] = first_of_radii(cloud, p * kPart, std::min(count, (p + 1) * kPart));
    });
    std::vector<VoxelLattice> lattices;
    for (const std::vector<std::uint32_t>& part : found) {
        for (const std::uint32_t n : part) {
            const Metaball& ball = cloud.metaballs[cloud.visible[n]];
            const std::uint8_t detailed = cloud.detail_of(n);
            if (std::ranges::any_of(lattices, [&](const VoxelLattice& known) {
                    return known.radius == ball.radius && known.detailed == detailed;
                }))
                continue;
            if (lattices.size() == kMostLattices) return {};
            VoxelLattice lattice;
            lattice.detailed = detailed;
            lattice.radius = ball.radius;
            lattice.edge_m = ball.radius / radius_voxels;
            lattice.per_edge = radius_voxels / ball.radius;
            for (int axis = 0; axis < 3; ++axis)
                lattice.phase[axis] = phase_of(coordinate(ball, axis) * lattice.per_edge);
            lattices.push_back(lattice);
        }
    }
    return lattices;
}

// Puts the runs of one block behind each other, blocks by number, in the order in which they come.
void group_by_block(const std::vector<RunPart>& parts, VoxelBlocks& blocks) {
    std::unordered_map<std::uint64_t, std::size_t> found;  // and how many runs it has; later, where they go
    std::uint64_t last = 0;
    std::size_t* count = nullptr;
    for (const RunPart& part : parts) {
        for (const BlockRun& run : part.runs) {
            if (count == nullptr || run.block != last) count = &found[last = run.block];
            ++*count;
        }
    }
    std::vector<std::uint64_t> numbers;
    for (const auto& [number, runs] : found) numbers.push_back(number);
    std::ranges::sort(numbers);
    std::size_t sum = 0;
    for (const std::uint64_t number : numbers) {
        blocks.first.push_back(sum);
        std::size_t& place = found[number];
        sum += std::exchange(place, sum);
    }
    blocks.first.push_back(sum);
    blocks.runs.resize(sum);
    for (const RunPart& part : parts)
        for (const BlockRun& run : part.runs) blocks.runs[found[run.block]++] = run;
}

}  // namespace

std::array<int, 3> place_of(std::uint64_t block) {
    const auto part = [&](int axis) {
        return int(block >> axis * kBlockPlaceBits & ((1u << kBlockPlaceBits) - 1)) - kOrigin;
    };
    return {part(0), part(1), part(2)};
}

std::optional<VoxelBlocks> voxel_blocks(const PreparedCloud& cloud, double radius_voxels) {
    VoxelBlocks blocks{voxel_lattices(cloud, radius_voxels), {}, {}, {}};
    if (blocks.lattices.empty()) return std::nullopt;
    const std::size_t count = cloud.visible.size(), parts = (count + kPart - 1) / kPart;
    blocks.places.resize(count);
    std::vector<RunPart> found(parts);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        found[p] =
            runs_of_part(cloud, blocks.lattices, p * kPart, std::min(count, (p + 1) * kPart), blocks.places);
    });
    std::size_t runs = 0;
    for (const RunPart& part : found) {
        if (!part.inside) return std::nullopt;
        runs += part.runs.size();
    }
    if (runs > count / 2 + kPart) return std::nullopt;
    group_by_block(found, blocks);
    return blocks;
}

}  // namespace nephos
