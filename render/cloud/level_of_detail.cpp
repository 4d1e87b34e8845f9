// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/level_of_detail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

#include <tbb/parallel_for.h>

#include "core/math.h"
#include "core/vec.h"

namespace nephos {
namespace {

constexpr float kEdge = 0.15f;   // fraction of a block's mean depth that counts as contrast
constexpr float kFull = 0.85f;   // fraction of the threshold below which a block is merged entirely
constexpr double kLevel = 0.25;  // a block's threshold relative to its children's
constexpr float kSpread = 1.5f;  // of the second moment that a block adds to its metaball
// Optical depths around an octant from which on it begins to be merged for being hidden, and is wholly; and
// the most that one of those around it counts, so that there are two of them at least.
constexpr float kVeiled = 4.5f, kHidden = 6.5f, kMostOfOctant = 3.25f;

// Second moment of the metaball's field along an axis, in units of its radius squared: a third of the
// integral of r^4 f over that of r^2 f.
constexpr double kMoment =
    (1.0 / 5 - 22.0 / 63 + 17.0 / 81 - 4.0 / 99) / (3 * (1.0 / 3 - 22.0 / 45 + 17.0 / 63 - 4.0 / 81));

// Sums over what is in each block of one size, kSide x kSide x kSide of them in a block of 8 x 8 x 8 voxels,
// x fastest; lengths in voxels from its corner.
template <std::size_t kSide>
struct Sums {
    static constexpr std::size_t kCount = kSide * kSide * kSide;
    using Values = std::array<float, kCount>;
    Values mass{};                   // of optical depths of metaballs of the lattice's radius
    Values x{}, y{}, z{};            // mass times place
    Values square{};                 // mass times place squared
    Values depth{}, depth_square{};  // of the optical depths through the children's centres
    Values balls{};
    // The metaball that replaces it.
    Values radius{}, own_depth{};  // voxels; optical depth scale
    Values fraction{};             // of what larger blocks leave

    template <std::size_t kChildren>
    void add(std::size_t n, const Sums<kChildren>& part, std::size_t child) {
        mass[n] += part.mass[child];
        x[n] += part.x[child];
        y[n] += part.y[child];
        z[n] += part.z[child];
        square[n] += part.square[child];
        depth[n] += part.own_depth[child];
        depth_square[n] += part.own_depth[child] * part.own_depth[child];
        balls[n] += part.balls[child];
    }
};

// The state shared by all blocks of a cloud.
struct Merging {
    Vec3 eye_m{};
    double radius_voxels = 1;
    double per_density = 1;  // optical depth scale per density and metre
    struct Level {
        float threshold = 1;    // of contrast ...
        double far_voxels = 0;  // ... at this distance
    };
    Level levels[3];

    Merging(const MetaballCloud& cloud, double radius, const DetailView& view,
            const LevelOfDetailOptions& options)
        : eye_m(view.eye_m),
          radius_voxels(radius),
          per_density(cloud.extinction_per_m * cloud.normalisation) {
        double threshold = 1, child = 1;  // voxels on the side of a child
        for (Level& level : levels) {
            // A full block's, whose second moment is that of its voxels' centres.
            const double child_radius = std::sqrt(radius * radius + (child * child - 1) / (12 * kMoment));
            level = {float(threshold), child_radius * view.pixels_per_unit / options.pixels};
            threshold *= kLevel;
            child *= 2;
        }
    }
};

// Returns the octant of a block of 2 x 2 x 2 voxels.
std::size_t octant_of(std::size_t n) { return (n >> 5 & 1) << 2 | (n >> 3 & 1) << 1 | (n >> 1 & 1); }

// The metaballs of a block of 8 x 8 x 8 voxels, and where it lies.
struct BlockBalls {
    const PreparedCloud& cloud;
    const VoxelBlocks& blocks;
    std::span<const BlockRun> runs;
    const VoxelLattice& lattice;
    double corner[3];  // voxels

    BlockBalls(const PreparedCloud& given, const VoxelBlocks& all, std::size_t number)
        : cloud(given),
          blocks(all),
          runs(all.of_block(number)),
          lattice(all.lattices[lattice_of(runs.front().block)]) {
        const std::array<int, 3> place = place_of(runs.front().block);
        for (std::size_t axis = 0; axis < 3; ++axis)
            corner[axis] = kBlockSide * place[axis] + lattice.phase[axis];
    }

    // work(index in PreparedCloud::visible) for all.
    template <class Work>
    void for_each(const Work& work) const {
        for (const BlockRun& run : runs)
            for (std::uint32_t i = run.begin; i < run.end; ++i) work(i);
    }
    const VoxelPlace& place(std::uint32_t i) const { return blocks.places[i]; }
    float depth_scale(std::uint32_t i) const { return cloud.depth_scale[i]; }

    // Returns the least optical depths through its octants, each at most kMostOfOctant: that of four voxels
    // like the thinnest one; 0 if a voxel is missing, as there is a gap. `per_scale`: ratio of the depth
    // through four voxels to the depth scale of one.
    OfOctants octant_depths(double per_scale) const {
        std::array<std::uint64_t, 8> filled{};
        OfOctants least;
        least.fill(std::numeric_limits<float>::max());
        for_each([&](std::uint32_t i) {
            const VoxelPlace& at = place(i);
            const std::size_t octant = octant_of(at.pair);
            const auto voxel = [](float along) { return unsigned(along) & 3; };
            filled[octant] |= std::uint64_t{1} << (16 * voxel(at.z) + 4 * voxel(at.y) + voxel(at.x));
            least[octant] = std::min(least[octant], depth_scale(i));
        });
        OfOctants depths{};
        for (std::size_t n = 0; n < 8; ++n)
            if (~filled[n] == 0) depths[n] = std::min(float(least[n] * per_scale), kMostOfOctant);
        return depths;
    }
};

// The blocks of one block of 8 x 8 x 8 voxels: of 2 voxels on a side, of 4, and the whole.
class BlockTree {
  public:
    // `hidden`: weight, 0..1, with which each octant is merged whatever its contrast.
    BlockTree(const Merging& merging, const BlockBalls& balls, const OfOctants& hidden)
        : merging_(merging), balls_(balls) {
        balls.for_each([&](std::uint32_t i) { add_ball(balls.place(i), balls.depth_scale(i)); });
        merge_small(hidden);
        merge_middle(hidden);
        merge_whole(hidden);
    }

    // Returns true when any metaball replaces several.
    bool merges() const {
        const auto merges_some = [](const auto& sums) {
            for (std::size_t n = 0; n < sums.kCount; ++n)
                if (sums.balls[n] > 1 && sums.fraction[n] > 0) return true;
            return false;
        };
        return merges_some(small_) || merges_some(middle_);
    }

    void emit(MergedCloud& to) const {
        emit_block(whole_, 0, whole_.fraction[0], to);
        const float left = 1 - whole_.fraction[0];
        if (!(left > 0)) return;
        for (std::size_t n = 0; n < 8; ++n) emit_block(middle_, n, left * middle_.fraction[n], to);
        std::array<float, 64> own;  // fraction of each metaball in a small block
        float most = 0;
        for (std::size_t n = 0; n < 64; ++n) {
            const float of_small = left * (1 - middle_.fraction[octant_of(n)]);
            const bool alone = small_.balls[n] <= 1;  // it is its block
            if (!alone) emit_block(small_, n, of_small * small_.fraction[n], to);
            own[n] = alone ? of_small : of_small * (1 - small_.fraction[n]);
            most = std::max(most, small_.balls[n] > 0 ? own[n] : 0.0f);
        }
        if (!(most > 0)) return;
        const PreparedCloud& cloud = balls_.cloud;
        balls_.for_each([&](std::uint32_t i) {
            const float fraction = own[balls_.place(i).pair];
            if (!(fraction > 0)) return;
            to.metaballs.push_back(cloud.metaballs[cloud.visible[i]]);
            to.metaballs.back().density *= fraction;
            to.depth_scale.push_back(fraction * cloud.depth_scale[i]);
        });
    }

  private:
    void add_ball(const VoxelPlace& at, float depth) {
        const std::size_t n = at.pair;
        small_.mass[n] += depth;
        small_.x[n] += depth * at.x;
        small_.y[n] += depth * at.y;
        small_.z[n] += depth * at.z;
        small_.square[n] += depth * (at.x * at.x + at.y * at.y + at.z * at.z);
        small_.depth[n] += depth;
        small_.depth_square[n] += depth * depth;
        small_.balls[n] += 1;
    }

    void merge_small(const OfOctants& hidden) {
        std::array<float, 64> least, of_octant;
        least.fill(1);
        for (std::size_t n = 0; n < 64; ++n) of_octant[n] = hidden[octant_of(n)];
        finish(small_, merging_.levels[0], least, of_octant);
    }

    void merge_middle(const OfOctants& hidden) {
        std::array<float, 8> least;
        least.fill(1);
        for (std::size_t n = 0; n < 64; ++n) {
            const std::size_t m = octant_of(n);
            middle_.add(m, small_, n);
            if (small_.balls[n] > 0) least[m] = std::min(least[m], small_.fraction[n]);
        }
        finish(middle_, merging_.levels[1], least, hidden);
    }

    void merge_whole(const OfOctants& hidden) {
        float least = 1, least_hidden = 1;
        for (std::size_t n = 0; n < 8; ++n) {
            whole_.add(0, middle_, n);
            if (!(middle_.balls[n] > 0)) continue;
            least = std::min(least, middle_.fraction[n]);
            least_hidden = std::min(least_hidden, hidden[n]);
        }
        finish(whole_, merging_.levels[2], {least}, {least_hidden});
    }

    // Squares of the distances along an axis from the eye to the middles of blocks, voxels.
    template <std::size_t kSide>
    std::array<float, kSide> squared_way(std::size_t axis) const {
        const double eye[3] = {merging_.eye_m.x, merging_.eye_m.y, merging_.eye_m.z};
        std::array<float, kSide> squares;
        for (std::size_t n = 0; n < kSide; ++n) {
            const double middle = (double(n) + 0.5) * (kBlockSide / double(kSide));
            const double way = balls_.corner[axis] + middle - eye[axis] * balls_.lattice.per_edge;
            squares[n] = float(way * way);
        }
        return squares;
    }

    // Computes the merged metaball of each block and its weight, at most `least`, the least of its children's
    // weights. Undefined for blocks without metaballs. Branchless, for vectorisation.
    template <std::size_t kSide>
    void finish(Sums<kSide>& sums, const Merging::Level& level, const typename Sums<kSide>::Values& least,
                const typename Sums<kSide>::Values& hidden) const {
        const std::array<float, kSide> wx = squared_way<kSide>(0), wy = squared_way<kSide>(1),
                                       wz = squared_way<kSide>(2);
        const auto square = float(merging_.radius_voxels * merging_.radius_voxels);
        const auto per_far_square = float(1 / (level.far_voxels * level.far_voxels));
        const float threshold = level.threshold;
        std::array<float, Sums<kSide>::kCount> way;
        for (std::size_t n = 0; n < way.size(); ++n)
            way[n] = wx[n % kSide] + wy[n / kSide % kSide] + wz[n / (kSide * kSide)];
        for (std::size_t n = 0; n < way.size(); ++n) {
            const float mass = std::max(sums.mass[n], 1e-30f), per_mass = 1 / mass;
            const float x = per_mass * sums.x[n], y = per_mass * sums.y[n], z = per_mass * sums.z[n];
            const float moment = std::max(per_mass * sums.square[n] - (x * x + y * y + z * z), 0.0f);
            const float larger = square + (kSpread / float(3 * kMoment)) * moment;
            sums.radius[n] = std::sqrt(larger);
            sums.own_depth[n] = sums.mass[n] * square / larger;

            const float mean = 0.125f * sums.depth[n];
            const float variance = std::max(0.125f * sums.depth_square[n] - mean * mean, 0.0f);
            const float contrast = std::sqrt(variance + kEdge * kEdge * mean * mean);
            const float limit = threshold * std::min(std::max(way[n] * per_far_square, 1e-12f), 1e12f);
            // Falls from 1 at kFull of the limit to 0 at the limit.
            const float t = std::min(std::max((limit - contrast) / ((1 - kFull) * limit), 0.0f), 1.0f);
            sums.fraction[n] = least[n] * std::max(t * t * (3 - 2 * t), hidden[n]);
        }
    }

    template <std::size_t kSide>
    void emit_block(const Sums<kSide>& sums, std::size_t n, float fraction, MergedCloud& to) const {
        if (!(fraction > 0) || !(sums.balls[n] > 0)) return;
        const double radius_m = sums.radius[n] * balls_.lattice.edge_m;
        const float depth = fraction * sums.own_depth[n];
        const auto world = [&](float sum, std::size_t axis) {
            return float((balls_.corner[axis] + double(sum) / sums.mass[n]) * balls_.lattice.edge_m);
        };
        to.metaballs.push_back({world(sums.x[n], 0), world(sums.y[n], 1), world(sums.z[n], 2),
                                float(radius_m), float(depth / (merging_.per_density * radius_m))});
        to.depth_scale.push_back(depth);
    }

    const Merging& merging_;
    const BlockBalls& balls_;
    Sums<4> small_;
    Sums<2> middle_;
    Sums<1> whole_;
};

// The result of merging a range of blocks.
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
    for (const MergedPart& part : parts)
        all.detailed.insert(all.detailed.end(), part.cloud.detailed.begin(), part.cloud.detailed.end());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t p) {
        std::ranges::copy(parts[p].cloud.metaballs, all.metaballs.begin() + std::ptrdiff_t(begin[p]));
        std::ranges::copy(parts[p].cloud.depth_scale, all.depth_scale.begin() + std::ptrdiff_t(begin[p]));
    });
    return all;
}

// Returns the occlusion of the octants of each block, 0..1.
std::vector<OfOctants> hidden_octants(const PreparedCloud& cloud, const VoxelBlocks& blocks,
                                      double per_scale) {
    const std::size_t count = blocks.size();
    std::vector<std::uint64_t> numbers(count);
    std::vector<OfOctants> depths(count);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 16), [&](const auto& range) {
        for (std::size_t b = range.begin(); b != range.end(); ++b) {
            const BlockBalls balls(cloud, blocks, b);
            numbers[b] = balls.runs.front().block;
            depths[b] = balls.octant_depths(per_scale);
        }
    });
    const bool some = std::ranges::any_of(depths, [](const OfOctants& of_block) {
        return std::ranges::any_of(of_block, [](float depth) { return 2 * depth > kVeiled; });
    });
    if (!some) return std::vector<OfOctants>(count);  // covered at most by that
    std::vector<OfOctants> hidden = cover_of_octants(numbers, depths, kHidden);
    for (OfOctants& of_block : hidden)
        for (float& cover : of_block) cover = smoothstep(kVeiled, kHidden, cover);
    return hidden;
}

}  // namespace

std::optional<DetailBlocks> detail_blocks(const PreparedCloud& given, const MetaballCloud& cloud) {
    if (given.visible.empty()) return std::nullopt;
    // The inverse of metaball_normalisation().
    const double radius_voxels =
        std::clamp(std::cbrt(2835.0 / (736.0 * std::numbers::pi * cloud.normalisation)), kMinMetaballRadius,
                   kMaxMetaballRadius);
    std::optional<VoxelBlocks> voxels = voxel_blocks(given, radius_voxels);
    if (!voxels) return std::nullopt;
    DetailBlocks blocks{radius_voxels, std::move(*voxels), {}};
    blocks.hidden = hidden_octants(given, blocks.voxels, 4 / (cloud.normalisation * radius_voxels));
    return blocks;
}

std::optional<MergedCloud> merge_voxels(const PreparedCloud& given, const MetaballCloud& cloud,
                                        const DetailBlocks& blocks, const DetailView& view,
                                        const LevelOfDetailOptions& options) {
    if (!(options.pixels > 0)) return std::nullopt;
    const Merging merging(cloud, blocks.radius_voxels, view, options);
    constexpr std::size_t kAtOnce = 16;  // blocks of 8 x 8 x 8 that one thread looks at
    const std::size_t count = blocks.voxels.size();
    std::vector<MergedPart> parts((count + kAtOnce - 1) / kAtOnce);
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t p) {
        for (std::size_t b = p * kAtOnce; b < std::min(count, (p + 1) * kAtOnce); ++b) {
            const BlockBalls balls(given, blocks.voxels, b);
            const BlockTree tree(merging, balls, blocks.hidden[b]);
            tree.emit(parts[p].cloud);
            if (!given.detailed.empty())
                parts[p].cloud.detailed.resize(parts[p].cloud.metaballs.size(), balls.lattice.detailed);
            parts[p].merges = parts[p].merges || tree.merges();
        }
    });
    if (std::ranges::none_of(parts, &MergedPart::merges)) return std::nullopt;
    return joined(parts);
}

}  // namespace nephos
