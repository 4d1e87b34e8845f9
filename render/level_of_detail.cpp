// SPDX-License-Identifier: Apache-2.0
#include "render/level_of_detail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>

#include <tbb/parallel_for.h>

#include "automaton/smoothstep.h"
#include "automaton/vector_math.h"

namespace nephos {
namespace {

constexpr double kEdge = 0.15;   // share of a block's mean depth that counts as contrast
constexpr double kFull = 0.85;   // share of the threshold below which a block is merged wholly
constexpr double kLevel = 0.25;  // a block's threshold relative to its children's
constexpr double kSpread = 1.5;  // of the second moment that a block adds to its metaball
constexpr int kSide = 8;         // voxels of the largest block
constexpr std::size_t kMostLattices = 16;
constexpr double kFarthest = 1 << 22;  // voxels from the origin
constexpr std::size_t kPart = 8192;    // metaballs that one thread looks at

// Second moment of the metaball's field along an axis, in units of its radius squared: a third of the
// integral of r^4 f over that of r^2 f.
constexpr double kMoment =
    (1.0 / 5 - 22.0 / 63 + 17.0 / 81 - 4.0 / 99) / (3 * (1.0 / 3 - 22.0 / 45 + 17.0 / 63 - 4.0 / 81));

// Voxels of one size; a metaball at x lies in voxel floor(x per_edge - phase).
struct VoxelLattice {
    float radius = 0;  // of its metaballs, metres
    double edge_m = 1, per_edge = 1;
    double phase[3] = {};
};

double coordinate(const Metaball& ball, int axis) { return axis == 0 ? ball.x : axis == 1 ? ball.y : ball.z; }

// Of a lattice's first metaball, whose centre is that of a voxel. In steps of 1/64, so that rounding of
// coordinates moves no voxel into another block.
double phase_of(double coordinate_in_voxels) {
    const double steps = std::floor((coordinate_in_voxels - std::floor(coordinate_in_voxels)) * 64 + 0.5);
    return (steps >= 64 ? 0 : steps / 64) - 0.5;
}

// Consecutive metaballs in one block of 8 x 8 x 8 voxels.
struct Run {
    std::uint64_t block = 0;  // its place and lattice
    std::uint32_t begin = 0, end = 0;
};

constexpr int kPlaceBits = 20;  // of a block on each axis, counted from -kFarthest

std::array<int, 3> place_of(std::uint64_t block) {
    const auto part = [&](int axis) {
        return int(block >> axis * kPlaceBits & ((1u << kPlaceBits) - 1)) - int(kFarthest) / kSide;
    };
    return {part(0), part(1), part(2)};
}

// The lattices of a cloud, at most kMostLattices; none if there are more.
std::vector<VoxelLattice> lattices_of(const PreparedCloud& cloud, double radius_voxels) {
    std::vector<VoxelLattice> lattices;
    float last = -1;
    for (const std::uint32_t index : cloud.visible) {
        const Metaball& ball = cloud.metaballs[index];
        if (ball.radius == last) continue;
        last = ball.radius;
        if (std::ranges::any_of(lattices, [&](const VoxelLattice& each) { return each.radius == last; }))
            continue;
        if (lattices.size() == kMostLattices) return {};
        VoxelLattice lattice;
        lattice.radius = last;
        lattice.edge_m = last / radius_voxels;
        lattice.per_edge = radius_voxels / last;
        for (int axis = 0; axis < 3; ++axis)
            lattice.phase[axis] = phase_of(coordinate(ball, axis) * lattice.per_edge);
        lattices.push_back(lattice);
    }
    return lattices;
}

struct RunPart {
    std::vector<Run> runs;
    bool inside = true;  // no ball is too far away
};

RunPart runs_of_part(const PreparedCloud& cloud, std::span<const VoxelLattice> lattices, std::size_t begin,
                     std::size_t end) {
    RunPart part;
    std::size_t lattice = 0;
    for (std::size_t i = begin; i < end; ++i) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        while (lattices[lattice].radius != ball.radius) lattice = (lattice + 1) % lattices.size();
        const VoxelLattice& of = lattices[lattice];
        std::uint64_t number = lattice;
        for (const int axis : {2, 1, 0}) {
            const double voxel = coordinate(ball, axis) * of.per_edge - of.phase[axis];
            part.inside = part.inside && std::abs(voxel) < kFarthest;
            if (!part.inside) return part;
            number = number << kPlaceBits | std::uint64_t(voxel + kFarthest) / kSide;
        }
        if (part.runs.empty() || part.runs.back().block != number)
            part.runs.push_back({number, std::uint32_t(i), std::uint32_t(i)});
        part.runs.back().end = std::uint32_t(i) + 1;
    }
    return part;
}

// Those of one block behind each other; empty where there are no voxels.
std::vector<Run> runs_by_block(const PreparedCloud& cloud, std::span<const VoxelLattice> lattices) {
    const std::size_t count = cloud.visible.size(), parts = (count + kPart - 1) / kPart;
    std::vector<RunPart> found(parts);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        found[p] = runs_of_part(cloud, lattices, p * kPart, std::min(count, (p + 1) * kPart));
    });
    std::vector<Run> runs;
    for (const RunPart& part : found) {
        if (!part.inside) return {};
        runs.insert(runs.end(), part.runs.begin(), part.runs.end());
    }
    if (runs.size() > count / 2 + kPart) return {};
    std::ranges::sort(runs, [](const Run& a, const Run& b) {
        return a.block != b.block ? a.block < b.block : a.begin < b.begin;
    });
    return runs;
}

// A block's sums over what is in it; lengths in voxels from the corner of the block of 8 x 8 x 8.
struct Sums {
    float mass = 0;                     // of optical depths of metaballs of the lattice's radius
    float x = 0, y = 0, z = 0;          // mass times place
    float square = 0;                   // mass times place squared
    float depth = 0, depth_square = 0;  // of the optical depths through the children's centres
    std::uint32_t balls = 0;
    // Of the metaball that stands for it.
    float radius = 0, own_depth = 0;  // voxels; optical depth scale
    float share = 0;                  // of what larger blocks leave

    void add(const Sums& part, float part_depth) {
        mass += part.mass;
        x += part.x;
        y += part.y;
        z += part.z;
        square += part.square;
        depth += part_depth;
        depth_square += part_depth * part_depth;
        balls += part.balls;
    }
};

// What all blocks of a cloud share.
struct Merging {
    const PreparedCloud& cloud;
    std::span<const VoxelLattice> lattices;
    Vec3 eye_m;
    double radius_voxels = 1;
    double per_density = 1;  // optical depth scale per density and metre
    struct Level {
        double side_voxels = 2;
        double threshold = 1;   // of contrast ...
        double far_voxels = 0;  // ... at this distance
    };
    Level levels[3];

    Merging(const PreparedCloud& given, const MetaballCloud& as, std::span<const VoxelLattice> of,
            const DetailView& view, const LevelOfDetailOptions& options, double radius)
        : cloud(given),
          lattices(of),
          eye_m(view.eye_m),
          radius_voxels(radius),
          per_density(as.extinction_per_m * as.normalisation) {
        double threshold = 1, child = 1;  // voxels on the side of a child
        for (Level& level : levels) {
            // A full block's, whose second moment is that of its voxels' centres.
            const double child_radius = std::sqrt(radius * radius + (child * child - 1) / (12 * kMoment));
            level = {2 * child, threshold, child_radius * view.pixels_per_unit / options.pixels};
            threshold *= kLevel;
            child *= 2;
        }
    }
};

// From 1 at kFull of the threshold to 0.
float falling_step(double contrast, double threshold) {
    return float(smoothstep(0, (1 - kFull) * threshold, threshold - contrast));
}

// The blocks of one block of 8 x 8 x 8 voxels.
class BlockTree {
  public:
    BlockTree(const Merging& merging, std::span<const Run> runs)
        : merging_(merging), runs_(runs), lattice_(merging.lattices[runs.front().block >> 3 * kPlaceBits]) {
        const std::array<int, 3> place = place_of(runs.front().block);
        for (std::size_t axis = 0; axis < 3; ++axis)
            corner_[axis] = kSide * place[axis] + lattice_.phase[axis];
        for (const Run& run : runs)
            for (std::uint32_t i = run.begin; i < run.end; ++i) add_ball(i);
        merge_small();
        merge_middle();
        merge_whole();
    }

    // Whether any metaball stands for several.
    bool merges() const {
        const auto merges_some = [](const Sums& block) { return block.balls > 1 && block.share > 0; };
        return std::ranges::any_of(small_, merges_some) || std::ranges::any_of(middle_, merges_some);
    }

    void emit(MergedCloud& to) const {
        emit_block(whole_, whole_.share, to);
        for (const Sums& block : middle_) emit_block(block, (1 - whole_.share) * block.share, to);
        for (int n = 0; n < 64; ++n)
            if (small_[n].balls > 1) emit_block(small_[n], left_by_larger(n) * small_[n].share, to);
        if (whole_.share >= 1) return;
        for (const Run& run : runs_)
            for (std::uint32_t i = run.begin; i < run.end; ++i) emit_ball(i, to);
    }

  private:
    struct Place {
        float x, y, z;  // voxels from the corner
        int small;      // number of its block of 2 x 2 x 2
    };

    Place place_in_block(const Metaball& ball) const {
        const auto x = float(ball.x * lattice_.per_edge - corner_[0]),
                   y = float(ball.y * lattice_.per_edge - corner_[1]),
                   z = float(ball.z * lattice_.per_edge - corner_[2]);
        const auto half = [](float at) { return std::clamp(int(at) >> 1, 0, 3); };
        return {x, y, z, half(z) * 16 + half(y) * 4 + half(x)};
    }

    const Metaball& ball_at(std::uint32_t i) const {
        return merging_.cloud.metaballs[merging_.cloud.visible[i]];
    }

    void add_ball(std::uint32_t i) {
        const Place at = place_in_block(ball_at(i));
        const float depth = merging_.cloud.depth_scale[i];
        const Sums ball{.mass = depth,
                        .x = depth * at.x,
                        .y = depth * at.y,
                        .z = depth * at.z,
                        .square = depth * (at.x * at.x + at.y * at.y + at.z * at.z),
                        .balls = 1};
        small_[at.small].add(ball, depth);
    }

    void merge_small() {
        for (int n = 0; n < 64; ++n)
            if (small_[n].balls > 0) finish(small_[n], 0, n & 3, n >> 2 & 3, n >> 4, 1);
    }

    void merge_middle() {
        float least[8] = {1, 1, 1, 1, 1, 1, 1, 1};
        for (int n = 0; n < 64; ++n) {
            if (small_[n].balls == 0) continue;
            const int m = middle_of(n);
            middle_[m].add(small_[n], small_[n].own_depth);
            least[m] = std::min(least[m], small_[n].share);
        }
        for (int n = 0; n < 8; ++n)
            if (middle_[n].balls > 0 && least[n] > 0)
                finish(middle_[n], 1, n & 1, n >> 1 & 1, n >> 2, least[n]);
    }

    void merge_whole() {
        float least = 1;
        for (const Sums& block : middle_) {
            if (block.balls == 0) continue;
            whole_.add(block, block.own_depth);
            least = std::min(least, block.share);
        }
        if (least > 0) finish(whole_, 2, 0, 0, 0, least);
    }

    static int middle_of(int n) { return (n >> 5 & 1) << 2 | (n >> 3 & 1) << 1 | (n >> 1 & 1); }
    float left_by_larger(int n) const { return (1 - whole_.share) * (1 - middle_[middle_of(n)].share); }

    // The metaball that stands for a block at some place among those of its level, and how far it does: its
    // children do as far as `least`.
    void finish(Sums& sums, int number, int x, int y, int z, float least) const {
        const float per_mass = 1 / sums.mass;
        const float mx = per_mass * sums.x, my = per_mass * sums.y, mz = per_mass * sums.z;
        const float moment = std::max(0.0f, per_mass * sums.square - (mx * mx + my * my + mz * mz)) / 3;
        const double square = merging_.radius_voxels * merging_.radius_voxels,
                     larger = square + kSpread * moment / kMoment;
        sums.radius = float(std::sqrt(larger));
        sums.own_depth = float(sums.mass * square / larger);

        const double mean = sums.depth / 8, variance = std::max(0.0, sums.depth_square / 8 - mean * mean);
        const double contrast = std::sqrt(variance + kEdge * kEdge * mean * mean);
        const Merging::Level& level = merging_.levels[number];
        const auto middle = [&](std::size_t axis, int at) {
            return (corner_[axis] + level.side_voxels * (at + 0.5)) * lattice_.edge_m;
        };
        const Vec3 way = Vec3{middle(0, x), middle(1, y), middle(2, z)} - merging_.eye_m;
        const double far_m = level.far_voxels * lattice_.edge_m;
        const double rise = std::clamp(dot(way, way) / (far_m * far_m), 1e-12, 1e12);
        sums.share = least * falling_step(contrast, level.threshold * rise);
    }

    void emit_block(const Sums& sums, float share, MergedCloud& to) const {
        if (!(share > 0)) return;
        const double radius_m = sums.radius * lattice_.edge_m;
        const float depth = share * sums.own_depth;
        const auto world = [&](float sum, std::size_t axis) {
            return float((corner_[axis] + double(sum) / sums.mass) * lattice_.edge_m);
        };
        to.metaballs.push_back({world(sums.x, 0), world(sums.y, 1), world(sums.z, 2), float(radius_m),
                                float(depth / (merging_.per_density * radius_m))});
        to.depth_scale.push_back(depth);
    }

    void emit_ball(std::uint32_t i, MergedCloud& to) const {
        Metaball ball = ball_at(i);
        const int n = place_in_block(ball).small;
        const float own = small_[n].balls > 1 ? 1 - small_[n].share : 1;  // alone it is its block
        const float share = left_by_larger(n) * own;
        if (!(share > 0)) return;
        ball.density *= share;
        to.metaballs.push_back(ball);
        to.depth_scale.push_back(share * merging_.cloud.depth_scale[i]);
    }

    const Merging& merging_;
    std::span<const Run> runs_;
    const VoxelLattice& lattice_;
    double corner_[3];                    // of the block, voxels
    Sums small_[64], middle_[8], whole_;  // x fastest
};

// Where each block's runs begin, and their end.
std::vector<std::size_t> first_runs(std::span<const Run> runs) {
    std::vector<std::size_t> first;
    for (std::size_t i = 0; i < runs.size(); ++i)
        if (i == 0 || runs[i].block != runs[i - 1].block) first.push_back(i);
    first.push_back(runs.size());
    return first;
}

// What some blocks become.
struct MergedPart {
    MergedCloud cloud;
    bool merges = false;
};

MergedCloud joined(const std::vector<MergedPart>& parts) {
    std::vector<std::size_t> begin(parts.size() + 1, 0);
    for (std::size_t p = 0; p < parts.size(); ++p) begin[p + 1] = begin[p] + parts[p].cloud.metaballs.size();
    MergedCloud all;
    all.metaballs.resize(begin.back());
    all.depth_scale.resize(begin.back());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t p) {
        std::ranges::copy(parts[p].cloud.metaballs, all.metaballs.begin() + std::ptrdiff_t(begin[p]));
        std::ranges::copy(parts[p].cloud.depth_scale, all.depth_scale.begin() + std::ptrdiff_t(begin[p]));
    });
    return all;
}

}  // namespace

std::optional<MergedCloud> merge_voxels(const PreparedCloud& given, const MetaballCloud& cloud,
                                        const DetailView& view, const LevelOfDetailOptions& options) {
    if (given.visible.empty() || !(options.pixels > 0)) return std::nullopt;
    // The inverse of metaball_normalisation().
    const double radius_voxels =
        std::clamp(std::cbrt(2835.0 / (736.0 * std::numbers::pi * cloud.normalisation)), kMinMetaballRadius,
                   kMaxMetaballRadius);
    const std::vector<VoxelLattice> lattices = lattices_of(given, radius_voxels);
    if (lattices.empty()) return std::nullopt;
    const std::vector<Run> runs = runs_by_block(given, lattices);
    if (runs.empty()) return std::nullopt;
    const Merging merging(given, cloud, lattices, view, options, radius_voxels);
    const std::vector<std::size_t> first = first_runs(runs);
    constexpr std::size_t kAtOnce = 16;  // blocks of 8 x 8 x 8 that one thread looks at
    const std::size_t blocks = first.size() - 1;
    std::vector<MergedPart> parts((blocks + kAtOnce - 1) / kAtOnce);
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t p) {
        for (std::size_t b = p * kAtOnce; b < std::min(blocks, (p + 1) * kAtOnce); ++b) {
            const BlockTree tree(merging, std::span(runs).subspan(first[b], first[b + 1] - first[b]));
            tree.emit(parts[p].cloud);
            parts[p].merges = parts[p].merges || tree.merges();
        }
    });
    if (std::ranges::none_of(parts, &MergedPart::merges)) return std::nullopt;
    return joined(parts);
}

}  // namespace nephos
