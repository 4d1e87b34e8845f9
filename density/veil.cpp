// SPDX-License-Identifier: Apache-2.0
#include "density/veil.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/math.h"
#include "core/noise_hash.h"
#include "density/openvdb_access.h"
#include "density/veil_kernel.h"

namespace nephos {
namespace {

constexpr float kLeastDensity = 0x1p-10f;
constexpr int kSampleGroups = 64, kSamplesInGroup = 256;

// Rises smoothly from 0 at an end to 1 at `width`; a step if `width` is 0.
double fade(double from_end, double width) {
    if (from_end <= 0) return 0;
    return width > 0 ? smoothstep(0, width, from_end) : 1;
}

// Samples of q at random places of the frame, wherever the veil lies: 64 places far apart with 256 points
// around each.
std::vector<float> samples_of(const VeilPlan& plan) {
    std::array<double, 3> spread{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        double finest = 0;
        for (const VeilOctavePlan& octave : plan.octaves) finest = std::max(finest, octave.per_m[axis]);
        spread[axis] = std::min(32 / plan.octaves.front().per_m[axis], 0x1p15 / finest);
    }
    std::array<std::vector<float>, 3> from_base;
    for (auto& axis : from_base) axis.resize(kSamplesInGroup);
    std::vector<float> values(std::size_t(kSampleGroups * kSamplesInGroup));
    std::uint32_t draw = plan.octaves.front().seeds[0];
    const auto unit = [&] {
        draw += kAxisStep;
        return mix_bits(draw) * 0x1p-32;
    };
    for (int group = 0; group < kSampleGroups; ++group) {
        VeilPoints points;
        points.count = kSamplesInGroup;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            points.base_m[axis] = spread[axis] * 4096 * unit();
            for (float& at : from_base[axis]) at = float(spread[axis] * (2 * unit() - 1));
            points.from_base_m[axis] = from_base[axis].data();
        }
        veil_sums(plan, points, -std::numeric_limits<float>::infinity(),
                  &values[std::size_t(group * kSamplesInGroup)]);
    }
    return values;
}

// The thresholds: quantiles 1 - coverage and 1 - coverage (1 - softness) of q.
void set_thresholds(VeilPlan& plan, const VeilOptions& options) {
    std::vector<float> values = samples_of(plan);
    std::ranges::sort(values);
    const auto quantile = [&](double fraction) {
        const double last = double(values.size() - 1);
        return values[std::size_t(std::clamp(fraction, 0.0, 1.0) * last)];
    };
    plan.low = quantile(1 - options.coverage);
    plan.high = quantile(1 - options.coverage * (1 - options.softness));
    // A step of some width, so that there is something to divide by.
    const float least = std::max(1e-6f, 1e-6f * std::abs(plan.low));
    plan.high = std::max(plan.high, plan.low + least);
}

// The largest |value| and the largest value of an octave's N, |noise| being at most 1.
struct Reach {
    double low = 0, high = 0;
};

Reach reach_of(const VeilOctave& octave, bool ridged) {
    const double gain = std::abs(octave.gain);
    Reach reach{octave.offset - gain, octave.offset + gain};
    if (!ridged) return reach;
    const double nearest = std::max({0.0, reach.low - octave.crest, octave.crest - reach.high});
    const double farthest = std::max(std::abs(reach.low - octave.crest), std::abs(reach.high - octave.crest));
    return {octave.ridge - farthest, octave.ridge - nearest};
}

bool is_ridged(VeilForm form) { return form == VeilForm::cumulus || form == VeilForm::cirrus; }
bool is_displaced(VeilForm form) { return form == VeilForm::cirrus || form == VeilForm::cirrostratus; }

VeilOctavePlan octave_plan(const VeilOctave& octave, std::uint64_t seed, std::size_t k, double time_s) {
    VeilOctavePlan plan;
    const std::array wavelength{octave.wavelength_m.x, octave.wavelength_m.y, octave.wavelength_m.z};
    const std::array velocity{octave.velocity_m_per_s.x, octave.velocity_m_per_s.y,
                              octave.velocity_m_per_s.z};
    const std::uint32_t own =
        mix_bits(std::uint32_t(seed) + mix_bits(std::uint32_t(seed >> 32) + std::uint32_t(k) * kAxisStep));
    plan.seeds = axis_seeds(own);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        plan.per_m[axis] = 1 / wavelength[axis];
        const double place = mix_bits(plan.seeds[axis] + 1) * 0x1p-16;
        plan.phase[axis] = place - velocity[axis] * time_s / wavelength[axis];
    }
    plan.displacement_m = {float(octave.displacement_m.x), float(octave.displacement_m.y),
                           float(octave.displacement_m.z)};
    plan.weight = float(octave.weight);
    plan.gain = float(octave.gain);
    plan.offset = float(octave.offset);
    plan.ridge = float(octave.ridge);
    plan.crest = float(octave.crest);
    return plan;
}

VeilPlan plan_of(const VeilOptions& options, double time_s) {
    VeilPlan plan;
    plan.repeats = options.period_m.x > 0;
    const Rotation fibres = rotation_of_degrees(options.direction_deg);
    plan.ridged = is_ridged(options.form);
    plan.displaced = is_displaced(options.form);
    const std::vector<VeilOctave> octaves = veil_octaves(options);
    double weights = 0;
    for (std::size_t k = 0; k < octaves.size(); ++k) {
        plan.octaves.push_back(octave_plan(octaves[k], options.seed, k, time_s));
        const Vec3& wavelength = octaves[k].wavelength_m;
        if (plan.repeats) {
            plan.octaves.back().lattice = veil_lattice({wavelength.x, wavelength.y}, fibres, options.period_m);
        }
        const Reach reach = reach_of(octaves[k], plan.ridged);
        weights += std::abs(octaves[k].weight) * std::max(std::abs(reach.low), std::abs(reach.high));
    }
    double most = 1e-4 * weights;  // what roundings may come to, amply
    for (std::size_t k = octaves.size(); k-- > 0;) {
        plan.octaves[k].most_after = float(most);
        const Reach reach = reach_of(octaves[k], plan.ridged);
        most += std::max(octaves[k].weight * reach.low, octaves[k].weight * reach.high);
    }
    return plan;
}

// The state shared by all blocks of voxels.
struct VeilField {
    VeilPlan plan;
    Extent extent;
    double cell_m = 0;
    Rotation along;                       // direction of the fibres
    double east_m = 0, north_m = 0;       // of the lattice's corner from the point that the wind carries
    std::vector<float> by_x, by_y, by_z;  // weights 0..1 of columns and levels
    std::vector<double> up_m, behind_m;   // of levels: height above the base, and displacement along
    float sheet = 0;
    VeilArea area;
    bool is_limited = false;  // by the area
    Rotation of_area;
    double area_x_m = 0, area_y_m = 0;  // of its centre from the lattice's corner
    Vec2 period_m{0, 0};                // as VeilOptions::period_m
};

std::vector<float> side_weights(int cells, double cell_m, double margin_m) {
    std::vector<float> weights;
    for (int n = 0; n < cells; ++n) {
        const double in = (std::min(n, cells - 1 - n) + 0.5) * cell_m;
        weights.push_back(float(fade(in, margin_m)));
    }
    return weights;
}

VeilField field_of(const VeilOptions& options, const Wind& wind, const Extent& extent,
                   const Placement& placement, double time_s) {
    VeilField field;
    field.plan = plan_of(options, time_s);
    const VeilThresholds thresholds = veil_thresholds(options);
    field.plan.low = thresholds.low;
    field.plan.high = thresholds.high;
    field.extent = extent;
    field.cell_m = placement.cell_size_m;
    field.along = rotation_of_degrees(options.direction_deg);
    const Vec3 carried = wind_displacement_m(wind, options.top_m, time_s);
    field.east_m = placement.origin_m.x - carried.x;
    field.north_m = placement.origin_m.y - carried.y;
    field.by_x = side_weights(extent.x, field.cell_m, options.margin_m);
    field.by_y = side_weights(extent.y, field.cell_m, options.margin_m);
    const double depth = options.top_m - options.base_m;
    for (int k = 0; k < extent.z; ++k) {
        const double z = placement.origin_m.z + (k + 0.5) * field.cell_m;
        field.by_z.push_back(float(fade(z - options.base_m, options.soft_base_m) *
                                   fade(options.top_m - z, options.soft_top_m)));
        const double fallen = std::max(0.0, (options.top_m - z) / depth);
        field.up_m.push_back(z - options.base_m);
        field.behind_m.push_back(options.fallstreak_m * fallen * fallen);
    }
    field.sheet = float(options.sheet);
    field.area = options.area;
    field.is_limited = std::isfinite(options.area.semi_a_m) || std::isfinite(options.area.semi_b_m);
    field.of_area = rotation_of_degrees(options.area.yaw_deg);
    field.period_m = options.period_m;
    field.area_x_m = options.area.x_m + (options.area.carried ? carried.x : 0) - placement.origin_m.x;
    field.area_y_m = options.area.y_m + (options.area.carried ? carried.y : 0) - placement.origin_m.y;
    return field;
}

// The weight of a column by the area.
float area_weight(const VeilField& field, int i, int j) {
    if (!field.is_limited) return 1;
    double east = (i + 0.5) * field.cell_m - field.area_x_m, north = (j + 0.5) * field.cell_m - field.area_y_m;
    if (field.period_m.x > 0) {  // from the nearest image of the centre
        east = std::remainder(east, field.period_m.x);
        north = std::remainder(north, field.period_m.y);
    }
    const double a = (east * field.of_area.cos + north * field.of_area.sin) / field.area.semi_a_m,
                 b = (north * field.of_area.cos - east * field.of_area.sin) / field.area.semi_b_m;
    return float(fade(1 - std::sqrt(a * a + b * b), field.area.softness));
}

// The voxels of a block whose weight is above 0, side by side.
struct BlockPoints {
    std::array<std::array<float, kBlockVoxels>, 3> from_base_m;
    std::array<float, kBlockVoxels> weight;
    std::array<std::uint16_t, kBlockVoxels> offset;  // in the leaf
    std::array<double, 3> base_m;
    std::size_t count = 0;

    void add(int leaf_voxel, float voxel_weight, double along, double across, double up) {
        from_base_m[0][count] = float(along);
        from_base_m[1][count] = float(across);
        from_base_m[2][count] = float(up);
        weight[count] = voxel_weight;
        offset[count++] = std::uint16_t(leaf_voxel);
    }
    // Pads the points to a multiple of the kernel's lanes; results of the padding are ignored.
    std::size_t padded() {
        const std::size_t whole = (count + kVeilLanes - 1) / kVeilLanes * kVeilLanes;
        for (std::size_t n = count; n < whole; ++n) {
            for (auto& axis : from_base_m) axis[n] = axis[0];
        }
        return whole;
    }
};

void collect(const VeilField& field, const openvdb::Coord& origin, BlockPoints& points) {
    const Rotation& r = field.along;
    const auto z0 = std::size_t(origin.z());
    const double east = field.east_m + (origin.x() + 0.5) * field.cell_m;
    const double north = field.north_m + (origin.y() + 0.5) * field.cell_m;
    points.base_m = {east * r.cos + north * r.sin + field.behind_m[z0], north * r.cos - east * r.sin,
                     field.up_m[z0]};
    points.count = 0;
    const int nx = std::min(kBlock, field.extent.x - origin.x()),
              ny = std::min(kBlock, field.extent.y - origin.y());
    const int nz = std::min(kBlock, field.extent.z - origin.z());
    for (int x = 0; x < nx; ++x) {
        for (int y = 0; y < ny; ++y) {
            const float side = field.by_x[std::size_t(origin.x() + x)] *
                               field.by_y[std::size_t(origin.y() + y)] *
                               area_weight(field, origin.x() + x, origin.y() + y);
            const double dx = x * field.cell_m, dy = y * field.cell_m;
            const double along = dx * r.cos + dy * r.sin, across = dy * r.cos - dx * r.sin;
            for (int z = 0; z < nz; ++z) {
                const std::size_t level = z0 + std::size_t(z);
                const float weight = side * field.by_z[level];
                if (weight < kLeastDensity) continue;
                points.add(leaf_offset(x, y, z), weight, along + (field.behind_m[level] - field.behind_m[z0]),
                           across, field.up_m[level] - field.up_m[z0]);
            }
        }
    }
}

float density_of(const VeilField& field, float q, float weight) {
    const float pattern = smoothstep(field.plan.low, field.plan.high, q);
    const float density = (field.sheet + (1 - field.sheet) * pattern) * weight;
    return density < kLeastDensity ? 0.0f : density;
}

NewBlock make_block(const VeilField& field, const openvdb::Coord& origin) {
    BlockPoints block;
    collect(field, origin, block);
    if (block.count == 0) return {};
    VeilPoints points;
    points.base_m = block.base_m;
    points.count = block.padded();
    for (std::size_t axis = 0; axis < 3; ++axis) points.from_base_m[axis] = block.from_base_m[axis].data();
    std::array<float, kBlockVoxels> sums;
    veil_sums(field.plan, points, field.plan.low, sums.data());
    auto leaf = uninitialised_leaf(origin);
    float* out = leaf->buffer().data();
    std::fill_n(out, kBlockVoxels, 0.0f);
    for (std::size_t n = 0; n < block.count; ++n)
        out[block.offset[n]] = density_of(field, sums[n], block.weight[n]);
    return NewBlock::from(std::move(leaf));
}

}  // namespace

VeilThresholds veil_thresholds(const VeilOptions& options) {
    VeilOptions endless = options;  // quantiles of the noise, not of one period of it
    endless.period_m = {0, 0};
    VeilPlan plan = plan_of(endless, 0);
    set_thresholds(plan, options);
    return {plan.low, plan.high};
}

Vec3 wind_displacement_m(const Wind& wind, double height_m, double time_s) {
    // Times at which the wind changes its course, and both ends; between two of them it is linear.
    std::vector<double> times{std::min(0.0, time_s), std::max(0.0, time_s)};
    for (const WindKeyframe& key : wind.keyframes) {
        if (key.time_s > times.front() && key.time_s < std::max(0.0, time_s)) times.push_back(key.time_s);
    }
    std::ranges::sort(times);
    Vec3 way{};
    for (std::size_t n = 1; n < times.size(); ++n) {
        const Velocity from = wind_at(wind, height_m, times[n - 1]), to = wind_at(wind, height_m, times[n]);
        const double half = (times[n] - times[n - 1]) / 2;
        way.x += (from.east_m_per_s + to.east_m_per_s) * half;
        way.y += (from.north_m_per_s + to.north_m_per_s) * half;
    }
    return time_s < 0 ? Vec3{-way.x, -way.y, 0} : way;
}

DensityGrid veil_density(const VeilOptions& options, const Wind& wind, const Extent& extent,
                         const Placement& placement, double time_s) {
    check(options, extent, placement);
    if (!std::isfinite(time_s) || std::abs(time_s) > 1e9) {
        throw Error(ErrorCode::usage, "the time of a veil is beyond 1e9 s");
    }
    const VeilField field = field_of(options, wind, extent, placement, time_s);
    const auto blocks_along = [](int n) { return (n + kBlock - 1) / kBlock; };
    const int bx = blocks_along(extent.x), by = blocks_along(extent.y), bz = blocks_along(extent.z);
    TreeBuilder builder;
    std::vector<NewBlock> level(std::size_t(bx) * std::size_t(by));
    for (int z = 0; z < bz; ++z) {
        const auto origin = [&](std::size_t n) {
            return openvdb::Coord(int(n) % bx * kBlock, int(n) / bx * kBlock, z * kBlock);
        };
        tbb::parallel_for(std::size_t{0}, level.size(),
                          [&](std::size_t n) { level[n] = make_block(field, origin(n)); });
        for (std::size_t n = 0; n < level.size(); ++n) level[n].move_to(builder, origin(n));
    }
    return builder.finish(extent, placement);
}

}  // namespace nephos
