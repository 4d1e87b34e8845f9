// SPDX-License-Identifier: Apache-2.0
#include "density/metaballs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/text.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

void check_radius(double radius_cells) {
    if (!(radius_cells >= kMinMetaballRadius && radius_cells <= kMaxMetaballRadius)) {
        throw Error(ErrorCode::usage,
                    "metaball radius of " + number_text(radius_cells, 6) + " voxels: must be 1..8");
    }
}

// A lattice point in reach of a sample point, and the field there.
struct Tap {
    int i, j, k;
    double field;
};

// Lattice points within R of `point` (in voxel edges, voxel centres at +0.5), x fastest, with f > 0.
std::vector<Tap> taps_around(const Vec3& point, double radius) {
    std::vector<Tap> taps;
    const auto first = [&](double p) { return int(std::ceil(p - radius - 0.5)); };
    const auto last = [&](double p) { return int(std::floor(p + radius - 0.5)); };
    for (int k = first(point.z); k <= last(point.z); ++k) {
        for (int j = first(point.y); j <= last(point.y); ++j) {
            for (int i = first(point.x); i <= last(point.x); ++i) {
                const double dx = i + 0.5 - point.x, dy = j + 0.5 - point.y, dz = k + 0.5 - point.z;
                const double field = metaball_field(std::sqrt(dx * dx + dy * dy + dz * dz) / radius);
                if (field > 0) taps.push_back({i, j, k, field});
            }
        }
    }
    return taps;
}

double sum_of_fields(const std::vector<Tap>& taps) {
    double sum = 0;
    for (const Tap& tap : taps) sum += tap.field;
    return sum;
}

// Samples the field at the voxels of fine blocks. Every cell is cut the same way, so refine^3 sets of taps
// serve all voxels.
class Resampler {
  public:
    Resampler(const DensityGrid& grid, int refine, double radius, const Boundaries& boundaries)
        : grid_(OpenvdbAccess::grid(grid)),
          cells_(grid.extent()),
          boundaries_(boundaries),
          refine_(refine),
          reach_(int(std::ceil(radius))),
          side_((kBlock - 1) / refine + 2 + 2 * reach_) {
        for (int pz = 0; pz < refine; ++pz) {
            for (int py = 0; py < refine; ++py) {
                for (int px = 0; px < refine; ++px)
                    add_phase({(px + 0.5) / refine, (py + 0.5) / refine, (pz + 0.5) / refine}, radius);
            }
        }
    }

    // Fine blocks that a cloud cell may reach, in block order.
    std::vector<openvdb::Coord> blocks(const DensityGrid& grid) const {
        std::vector<openvdb::Coord> result;
        for (const Block& block : blocks_of(grid)) {
            if (block.positive_count() == 0) continue;
            const auto along_x = reached(block.origin.x(), cells_.x, boundaries_.x),
                       along_y = reached(block.origin.y(), cells_.y, boundaries_.y),
                       along_z = reached(block.origin.z(), cells_.z, boundaries_.z);
            for (const int z : along_z) {
                for (const int y : along_y) {
                    for (const int x : along_x) result.emplace_back(x, y, z);
                }
            }
        }
        std::ranges::sort(result, {}, block_order);
        result.erase(std::unique(result.begin(), result.end()), result.end());
        return result;
    }

    NewBlock sample(const openvdb::Coord& origin, Extent fine) const {
        const openvdb::Coord corner = first_cell(origin);
        std::vector<float> cells(std::size_t(side_) * std::size_t(side_) * std::size_t(side_));
        if (!gather(corner, cells)) return {};
        auto leaf = uninitialised_leaf(origin);
        float* out = leaf->buffer().data();
        for (int n = 0; n < kBlockVoxels; ++n) {
            const openvdb::Coord voxel = origin + openvdb::Coord(n >> 6, n >> 3 & 7, n & 7);
            const bool inside = voxel.x() < fine.x && voxel.y() < fine.y && voxel.z() < fine.z;
            out[n] = inside ? value(voxel, corner, cells) : 0.0f;
        }
        return NewBlock::from(std::move(leaf));
    }

  private:
    struct Phase {
        std::vector<std::ptrdiff_t> offsets;  // into the gathered cells, from the voxel's own cell
        std::vector<double> fields;
        double sum = 0;
    };

    // Origins along one axis of the fine blocks that the cells of the block at `origin` reach; on a periodic
    // axis an origin may come twice.
    std::vector<int> reached(int origin, int cells, Boundary boundary) const {
        std::vector<int> origins;
        const auto add = [&](int first, int end) {  // cells first .. end - 1
            const int low = std::max(first, 0) * refine_ & ~(kBlock - 1);
            for (int v = low; v < std::min(end, cells) * refine_; v += kBlock) origins.push_back(v);
        };
        const int first = origin - reach_, end = std::min(origin + kBlock, cells) + reach_;
        const bool whole = boundary == Boundary::periodic && end - first >= cells;
        add(whole ? 0 : first, whole ? cells : end);
        if (boundary == Boundary::open || whole) return origins;
        if (first < 0) add(first + cells, cells);
        if (end > cells) add(0, end - cells);
        return origins;
    }

    void add_phase(const Vec3& point, double radius) {
        const auto taps = taps_around(point, radius);
        Phase phase;
        for (const Tap& tap : taps) {
            phase.offsets.push_back((std::ptrdiff_t(tap.k) * side_ + tap.j) * side_ + tap.i);
            phase.fields.push_back(tap.field);
        }
        phase.sum = sum_of_fields(taps);
        phases_.push_back(std::move(phase));
    }

    openvdb::Coord first_cell(const openvdb::Coord& origin) const {
        return openvdb::Coord(origin.x() / refine_, origin.y() / refine_, origin.z() / refine_)
            .offsetBy(-reach_);
    }

    bool gather(const openvdb::Coord& corner, std::vector<float>& cells) const {
        auto voxels = grid_.getConstAccessor();
        bool any = false;
        float* out = cells.data();
        for (int z = 0; z < side_; ++z) {
            const int k = repeated(corner.z() + z, cells_.z, boundaries_.z);
            for (int y = 0; y < side_; ++y) {
                const int j = repeated(corner.y() + y, cells_.y, boundaries_.y);
                for (int x = 0; x < side_; ++x) {
                    *out = voxels.getValue({repeated(corner.x() + x, cells_.x, boundaries_.x), j, k});
                    any = any || *out > 0;
                    ++out;
                }
            }
        }
        return any;
    }

    float value(const openvdb::Coord& voxel, const openvdb::Coord& corner,
                const std::vector<float>& cells) const {
        const int px = voxel.x() % refine_, py = voxel.y() % refine_, pz = voxel.z() % refine_;
        const Phase& phase = phases_[std::size_t((pz * refine_ + py) * refine_ + px)];
        const openvdb::Coord cell =
            openvdb::Coord(voxel.x() / refine_, voxel.y() / refine_, voxel.z() / refine_) - corner;
        const float* own = cells.data() + (std::ptrdiff_t(cell.z()) * side_ + cell.y()) * side_ + cell.x();
        double sum = 0;
        for (std::size_t n = 0; n < phase.offsets.size(); ++n)
            sum += double(own[phase.offsets[n]]) * phase.fields[n];
        return float(sum / phase.sum);
    }

    const FloatGrid& grid_;
    const Extent cells_;
    const Boundaries boundaries_;
    const int refine_;
    const int reach_;  // cells that a tap may lie away
    const int side_;   // of the cube of cells that one fine block needs
    std::vector<Phase> phases_;
};

}  // namespace

// In w = 1 - a^2 the polynomial is w^2 (5 + 4 w) / 9: the same values without cancellation at the rim.
double metaball_field(double a) {
    if (!(a < 1)) return 0;
    const double w = 1 - a * a;
    return w * w * (5 + 4 * w) / 9;
}

double metaball_normalisation(double radius_cells) {
    return 2835.0 / (736.0 * std::numbers::pi * radius_cells * radius_cells * radius_cells);
}

std::vector<Metaball> metaballs(const DensityGrid& grid, double radius_cells) {
    check_radius(radius_cells);
    const auto blocks = blocks_of(grid);
    std::vector<std::size_t> first(blocks.size() + 1, 0);
    for (std::size_t n = 0; n < blocks.size(); ++n) {
        first[n + 1] = first[n] + std::size_t(blocks[n].positive_count());
    }
    const Vec3 origin = grid.placement().origin_m;
    const double size = grid.placement().cell_size_m;
    std::vector<Metaball> balls(first.back());
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t n) {
        const Block& block = blocks[n];
        Metaball* out = balls.data() + first[n];
        for (int xyz = 0; xyz < kBlockVoxels; ++xyz) {  // x fastest
            const int x = xyz & 7, y = xyz >> 3 & 7, z = xyz >> 6;
            const float q = block.value(leaf_offset(x, y, z));
            if (!(q > 0)) continue;
            *out++ = {float(origin.x + (block.origin.x() + x + 0.5) * size),
                      float(origin.y + (block.origin.y() + y + 0.5) * size),
                      float(origin.z + (block.origin.z() + z + 0.5) * size), float(radius_cells * size), q};
        }
    });
    return balls;
}

DensityGrid resample(const DensityGrid& grid, int refine, double radius_cells, const Boundaries& boundaries) {
    check_radius(radius_cells);
    if (refine < 1 || refine > kMaxRefine) {
        throw Error(ErrorCode::usage,
                    "refinement of " + std::to_string(refine) + " voxels per cell: must be 1..8");
    }
    const Extent coarse = grid.extent();
    if (std::int64_t{std::max({coarse.x, coarse.y, coarse.z})} * refine >
        std::numeric_limits<int>::max() - kBlock) {
        throw Error(ErrorCode::usage,
                    "a refinement of " + std::to_string(refine) + " gives too many voxels on an axis");
    }
    const Extent fine{coarse.x * refine, coarse.y * refine, coarse.z * refine};
    const Resampler resampler(grid, refine, radius_cells, boundaries);
    const auto origins = resampler.blocks(grid);
    std::vector<NewBlock> blocks(origins.size());
    tbb::parallel_for(std::size_t{0}, origins.size(),
                      [&](std::size_t n) { blocks[n] = resampler.sample(origins[n], fine); });
    TreeBuilder builder;
    for (std::size_t n = 0; n < blocks.size(); ++n) blocks[n].move_to(builder, origins[n]);
    Placement placement = grid.placement();
    placement.cell_size_m /= refine;
    return builder.finish(fine, placement);
}

}  // namespace nephos
