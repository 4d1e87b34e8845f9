// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/vdb_foreign.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <vector>

#include <openvdb/tools/Interpolation.h>

#include "core/text.h"
#include "density/metaballs.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

constexpr double kTolerance = 1e-5;                  // relative, for "along an axis" and "a cube"
constexpr int kMaxVoxels = kMaxExtent * kMaxRefine;  // along one axis

// Index space to metres, x east, y north, z up; column c is one index step along axis c.
struct Affine {
    std::array<Vec3d, 3> columns;
    Vec3d shift;

    Vec3d operator()(const Vec3d& index) const {
        return columns[0] * index[0] + columns[1] * index[1] + columns[2] * index[2] + shift;
    }
};

Affine affine_of(const ForeignGrid& foreign) {
    const openvdb::math::Transform& transform = foreign.grid->transform();
    if (!transform.isLinear())
        throw std::runtime_error("its transform is not linear (a frustum), which is not supported");
    const auto to_ours = [&](const Vec3d& v) {
        const Vec3d m = v * foreign.metres_per_unit;
        return foreign.y_up ? Vec3d(m.x(), -m.z(), m.y()) : m;
    };
    Affine affine;
    // As the file has it: differences of places would lose the digits that the shift takes.
    const openvdb::Mat4d matrix = transform.baseMap()->getAffineMap()->getMat4();  // of row vectors
    const auto row = [&](int n) { return to_ours(Vec3d(matrix(n, 0), matrix(n, 1), matrix(n, 2))); };
    for (int c = 0; c < 3; ++c) affine.columns[std::size_t(c)] = row(c);
    affine.shift = row(3);
    for (const Vec3d& v : {affine.columns[0], affine.columns[1], affine.columns[2], affine.shift}) {
        if (!std::isfinite(v.x()) || !std::isfinite(v.y()) || !std::isfinite(v.z())) {
            throw std::runtime_error("its transform has values that are not finite");
        }
    }
    const double volume = affine.columns[0].dot(affine.columns[1].cross(affine.columns[2]));
    if (!(std::abs(volume) > 0) || !std::isfinite(volume))
        throw std::runtime_error("its transform is singular");
    return affine;
}

// For each of our axes the file's index axis along it, whether it runs the same way, and the edge of a voxel.
struct AxisMap {
    std::array<int, 3> axis{};
    std::array<bool, 3> same{};
    std::array<double, 3> edge{};

    bool are_alike(std::size_t a, std::size_t b) const {
        return std::abs(edge[a] - edge[b]) <= kTolerance * edge[a];
    }
};

// Returns false where an index axis lies along none of ours.
bool axis_map_of(const Affine& affine, AxisMap& map) {
    std::array<bool, 3> taken{};
    for (int c = 0; c < 3; ++c) {
        const Vec3d& column = affine.columns[std::size_t(c)];
        int r = 0;
        for (int other = 1; other < 3; ++other)
            if (std::abs(column[other]) > std::abs(column[r])) r = other;
        const double along = std::abs(column[r]), rest = column.lengthSqr() - along * along;
        if (rest > kTolerance * kTolerance * along * along) return false;
        map.axis[std::size_t(r)] = c;
        map.same[std::size_t(r)] = column[r] > 0;
        map.edge[std::size_t(r)] = along;
        taken[std::size_t(r)] = true;
    }
    return taken[0] && taken[1] && taken[2];
}

Extent checked_extent(std::array<double, 3> size) {
    for (double n : size) {
        if (!(n >= 1 && n <= kMaxVoxels)) {
            throw std::runtime_error("its bounds of " + std::to_string(size[0]) + " x " +
                                     std::to_string(size[1]) + " x " + std::to_string(size[2]) +
                                     " voxels are too large: at most " + std::to_string(kMaxVoxels) +
                                     " on each axis");
        }
    }
    return {int(size[0]), int(size[1]), int(size[2])};
}

// Values as a fog volume has them: inactive ones 0, none below 0. Counts the voxels that it changed.
class Sanitiser {
  public:
    float operator()(float value, std::uint64_t voxels = 1) {
        if (!std::isfinite(value)) throw std::runtime_error("it has a density that is not a finite number");
        if (value < 0) negative_ += voxels;
        return std::max(value, 0.0f);
    }
    std::uint64_t negative() const { return negative_; }

  private:
    std::uint64_t negative_ = 0;
};

// The same voxels at other indices.
class Permuter {
  public:
    Permuter(const CoordBBox& bounds, const AxisMap& map, const DensityReceiver& receiver)
        : bounds_(bounds), map_(map), receiver_(receiver), work_(0.0f), voxels_(work_) {}
    Permuter(const Permuter&) = delete;
    Permuter& operator=(const Permuter&) = delete;
    ~Permuter() { work_.root().clear(); }  // by this thread alone, as in serial_tree.h

    ForeignResult run(const FloatTree& tree) {
        const bool blocks_stay =
            map_.axis == std::array<int, 3>{0, 1, 2} && map_.same == std::array<bool, 3>{true, true, true} &&
            ((bounds_.min().x() | bounds_.min().y() | bounds_.min().z()) & (kBlock - 1)) == 0;
        for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) {
            if (blocks_stay) {
                send_whole(*leaf);
            } else {
                for (auto voxel = leaf->cbeginValueOn(); voxel; ++voxel) {
                    const float value = sanitise_(*voxel);
                    if (value > 0 && bounds_.isInside(voxel.getCoord()))
                        voxels_.setValueOnly(moved(voxel.getCoord()), value);
                }
            }
        }
        auto tile = tree.cbeginValueOn();
        tile.setMaxDepth(FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile) {
            CoordBBox box = tile.getBoundingBox();
            box.intersect(bounds_);
            move_tile(box, sanitise_(*tile, box.volume()));  // that of an empty box is 0
        }
        for (auto leaf = work_.cbeginLeaf(); leaf; ++leaf)
            receiver_.leaf(leaf->origin(), leaf->buffer().data());
        return {false, sanitise_.negative(), map_.edge[2]};
    }

  private:
    Coord moved(const Coord& c) const {
        Coord result;
        for (int r = 0; r < 3; ++r) {
            const int a = map_.axis[std::size_t(r)];
            result[r] = map_.same[std::size_t(r)] ? c[a] - bounds_.min()[a] : bounds_.max()[a] - c[a];
        }
        return result;
    }

    void send_whole(const FloatLeaf& leaf) {
        float values[kBlockVoxels];
        bool any = false;
        if (bounds_.isInside(leaf.getNodeBoundingBox()) && take_plain(leaf, values, any)) {
            if (any) receiver_.leaf(leaf.origin() - bounds_.min(), values);
            return;
        }
        std::fill_n(values, kBlockVoxels, 0.0f);
        for (auto voxel = leaf.cbeginValueOn(); voxel; ++voxel) {
            const float value = sanitise_(*voxel);
            if (!bounds_.isInside(voxel.getCoord())) continue;
            values[voxel.pos()] = value;
            any = any || value > 0;
        }
        if (any) receiver_.leaf(leaf.origin() - bounds_.min(), values);
    }

    // Copies the active values; false where one of them is negative or no number, which are counted one by one. Without
    // branches, so that the compiler makes vectors of it: nearly all leaves are such.
    static bool take_plain(const FloatLeaf& leaf, float (&values)[kBlockVoxels], bool& any) {
        const float* from = leaf.buffer().data();
        bool plain = true, positive = false;
        for (int n = 0; n < kBlockVoxels; n += 64) {
            const auto active = leaf.valueMask().getWord<std::uint64_t>(openvdb::Index(n / 64));
            for (int bit = 0; bit < 64; ++bit) {
                const float value = (active >> bit & 1) != 0 ? from[n + bit] : 0.0f;
                plain &= value >= 0 && value <= std::numeric_limits<float>::max();
                positive |= value > 0;
                values[n + bit] = value;
            }
        }
        any = positive;
        return plain;
    }

    // Cuts a tile along our blocks: whole ones stay tiles, the rest becomes voxels.
    void move_tile(const CoordBBox& box, float value) {
        if (value == 0 || box.empty()) return;
        const Coord a = moved(box.min()), b = moved(box.max());
        const CoordBBox target(Coord::minComponent(a, b), Coord::maxComponent(a, b));
        const Coord first = target.min() & ~(kBlock - 1);
        for (int z = first.z(); z <= target.max().z(); z += kBlock) {
            for (int y = first.y(); y <= target.max().y(); y += kBlock) {
                for (int x = first.x(); x <= target.max().x(); x += kBlock) {
                    CoordBBox block = CoordBBox::createCube({x, y, z}, kBlock);
                    if (target.isInside(block)) {
                        receiver_.tile(block.min(), value);
                        continue;
                    }
                    block.intersect(target);
                    for (auto c = block.begin(); c; ++c) voxels_.setValueOnly(*c, value);
                }
            }
        }
    }

    const CoordBBox bounds_;
    const AxisMap map_;
    const DensityReceiver& receiver_;
    FloatTree work_;
    openvdb::tree::ValueAccessor<FloatTree, false>
        voxels_;  // false: not known to the tree, as in serial_tree.h
    Sanitiser sanitise_;
};

// Gives samplers the values as a fog volume has them: inactive ones 0.
struct ActiveValues {
    using ValueType = float;
    FloatGrid::ConstUnsafeAccessor voxels;

    float getValue(const Coord& c) const {
        float value = 0;
        return voxels.probeValue(c, value) ? value : 0.0f;
    }
};

// Samples on cubes whose edge is the file's shortest voxel edge: trilinear ones, of a mask the nearest voxel's.
class Skewed {
  public:
    Skewed(const ForeignGrid& foreign, const Affine& affine) : foreign_(foreign), affine_(affine) {
        edge_ =
            std::min({affine.columns[0].length(), affine.columns[1].length(), affine.columns[2].length()});
        Vec3d high;
        world_box(foreign.bounds, 0.5, low_, high);
        const Vec3d size = (high - low_) / edge_;
        extent_ = checked_extent({std::max(1.0, std::ceil(size.x() - kTolerance)),
                                  std::max(1.0, std::ceil(size.y() - kTolerance)),
                                  std::max(1.0, std::ceil(size.z() - kTolerance))});
    }

    ForeignResult run(const DensityReceiver& receiver) {
        receiver.begin(extent_, {{low_.x(), low_.y(), low_.z()}, edge_});
        const ActiveValues values_in_file{foreign_.grid->getConstUnsafeAccessor()};
        Sanitiser sanitise;
        for (const Coord& origin : blocks()) {
            float values[kBlockVoxels] = {};
            bool any = false;
            for (int n = 0; n < kBlockVoxels; ++n) {
                const Coord voxel = origin + Coord(n >> 6, n >> 3 & 7, n & 7);
                if (voxel.x() >= extent_.x || voxel.y() >= extent_.y || voxel.z() >= extent_.z) continue;
                const Vec3d world = low_ + (voxel.asVec3d() + Vec3d(0.5)) * edge_;
                const Vec3d index = foreign_.grid->transform().worldToIndex(to_file(world));
                values[n] =
                    sanitise(foreign_.is_mask ? openvdb::tools::PointSampler::sample(values_in_file, index)
                                              : openvdb::tools::BoxSampler::sample(values_in_file, index));
                any = any || values[n] > 0;
            }
            if (any) receiver.leaf(origin, values);
        }
        return {true, sanitise.negative(), edge_};
    }

  private:
    Vec3d to_file(const Vec3d& metres) const {
        const Vec3d m = metres / foreign_.metres_per_unit;
        return foreign_.y_up ? Vec3d(m.x(), m.z(), -m.y()) : m;
    }

    // Smallest box of our axes around a box of the file's voxels, `margin` voxels wider on each side.
    void world_box(const CoordBBox& box, double margin, Vec3d& low, Vec3d& high) const {
        for (int corner = 0; corner < 8; ++corner) {
            Vec3d index;
            for (int a = 0; a < 3; ++a)
                index[a] = corner >> a & 1 ? box.max()[a] + margin : box.min()[a] - margin;
            const Vec3d world = affine_(index);
            low = corner == 0 ? world : openvdb::math::minComponent(low, world);
            high = corner == 0 ? world : openvdb::math::maxComponent(high, world);
        }
    }

    // Tells values that are not 0, no numbers among them.
    static bool has_values(const FloatLeaf& leaf) {
        return std::ranges::any_of(std::span(leaf.buffer().data(), kBlockVoxels),
                                   [](float value) { return value != 0; });
    }

    // Our blocks that a leaf or tile of the file reaches, each once, in block order. Throws std::runtime_error where their
    // voxels take more than is allowed, before any is sampled.
    std::vector<Coord> blocks() const {
        std::vector<Coord> result;
        const std::size_t most = foreign_.memory_bytes / (kBlockVoxels * sizeof(float));
        std::size_t full = most;  // with some of them twice
        const auto keep_each_once = [&] {
            std::ranges::sort(result, {}, block_order);
            result.erase(std::unique(result.begin(), result.end()), result.end());
        };
        const auto add = [&](CoordBBox box) {
            box.intersect(foreign_.bounds);
            if (box.empty()) return;
            Vec3d low, high;
            world_box(box, 1.0, low, high);
            std::array<int, 3> first{}, last{};
            const int size[] = {extent_.x, extent_.y, extent_.z};
            for (int a = 0; a < 3; ++a) {
                first[std::size_t(a)] =
                    std::max(0, int(std::floor((low[a] - low_[a]) / edge_))) & ~(kBlock - 1);
                last[std::size_t(a)] = std::min(size[a] - 1, int(std::ceil((high[a] - low_[a]) / edge_)));
            }
            for (int z = first[2]; z <= last[2]; z += kBlock) {
                for (int y = first[1]; y <= last[1]; y += kBlock) {
                    for (int x = first[0]; x <= last[0]; x += kBlock) result.emplace_back(x, y, z);
                }
            }
            if (result.size() <= full) return;
            keep_each_once();
            full = std::max(most, 2 * result.size());
            if (result.size() > most)
                throw std::runtime_error(
                    "cannot read: its voxels are no cubes along the axes, and cubes of " +
                    number_text(edge_, 6) + " m, " + std::to_string(extent_.x) + " x " +
                    std::to_string(extent_.y) + " x " + std::to_string(extent_.z) +
                    " in all, take more than the memory that is allowed");
        };
        const FloatTree& tree = foreign_.grid->tree();
        for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
            if (!foreign_.is_mask || has_values(*leaf)) add(leaf->getNodeBoundingBox());
        auto tile = tree.cbeginValueOn();
        tile.setMaxDepth(FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
        for (; tile; ++tile)
            if (!foreign_.is_mask || *tile != 0) add(tile.getBoundingBox());
        keep_each_once();
        return result;
    }

    const ForeignGrid& foreign_;
    const Affine& affine_;
    double edge_ = 0;
    Vec3d low_;
    Extent extent_;
};

}  // namespace

ForeignResult convert_foreign(const ForeignGrid& foreign, const DensityReceiver& receiver) {
    const Affine affine = affine_of(foreign);
    AxisMap map;
    const bool are_along = axis_map_of(affine, map) && map.are_alike(0, 1);
    const bool are_cubes = are_along && map.are_alike(0, 2);
    if (!are_cubes && !(are_along && foreign.is_mask)) return Skewed(foreign, affine).run(receiver);
    map.edge[1] = map.edge[0];  // but for rounding
    if (are_cubes) map.edge[2] = map.edge[0];
    std::array<double, 3> size{};
    Vec3d low = affine(foreign.bounds.min().asVec3d());
    low = openvdb::math::minComponent(low, affine(foreign.bounds.max().asVec3d()));
    for (std::size_t r = 0; r < 3; ++r) {
        size[r] = double(foreign.bounds.max()[map.axis[r]]) - double(foreign.bounds.min()[map.axis[r]]) + 1;
        low[int(r)] -= map.edge[r] / 2;  // from the centre of the lowest voxel to its corner
    }
    receiver.begin(checked_extent(size), {{low.x(), low.y(), low.z()}, map.edge[0]});
    return Permuter(foreign.bounds, map, receiver).run(foreign.grid->tree());
}

}  // namespace nephos
