// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/cloud_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

#include "render/shared/march.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr int kCells = CoverageField::kBrickCells;

std::vector<float> mean_extinction(const CoverageField& field) {
    std::vector<float> result = field.cell_density();
    for (float& number : result) number *= float(field.extinction_per_m());
    return result;
}

std::uint16_t packed_depth(float depth) {
    const float share = std::clamp(depth / kMostMarchedDepth, 0.0f, 1.0f);
    return std::uint16_t(65535 * std::sqrt(share) + 0.5f);
}

// T's absorption as an optical depth: what is left falls off in proportion to the way through density 1.
float absorbed_depth(float depth, double extinction_per_m, double light_distance_m) {
    const double left = 1 - double(depth) / std::max(extinction_per_m * light_distance_m, 1e-30);
    return left > 0 ? float(-std::log(left)) : kMostMarchedDepth;
}

}  // namespace

CloudVolume::CloudVolume(const DetailedVoxels& voxels)
    : field(voxels.density, voxels.setting, voxels.moisture ? &*voxels.moisture : nullptr),
      extinction(mean_extinction(field)) {}

std::size_t CloudVolume::memory_bytes() const {
    return field.memory_bytes() + 4 * (extinction.size() + corner_depths.size()) +
           2 * (sun_depths.size() + own_depths.size() + surroundings.size());
}

double footprint_scale(std::span<const CloudVolume> volumes) {
    double scale = 0;
    for (const CloudVolume& volume : volumes)
        scale = std::max({scale, 1.0, 2 * volume.field.node_m() / double(shader::kFootprintCell_m)});
    return scale;
}

// Ten of the fourteen directions of Lebedev's rule of order 5 (V. I. Lebedev 1976): the axes in the horizontal plane,
// along which sky and ground meet, are left out. Light that is scattered often passes a slab of optical depth tau as
// by diffusion, 1 / (1 + 3/4 (1 - g) tau).
void see_surroundings(CloudVolume& volume, double mean_cosine) {
    const double side = 1 / std::sqrt(3.0);
    const std::array<Vec3, 10> directions{Vec3(0, 0, 1),          Vec3(side, side, side),   Vec3(-side, side, side),
                                          Vec3(side, -side, side), Vec3(-side, -side, side), Vec3(0, 0, -1),
                                          Vec3(side, side, -side), Vec3(-side, side, -side), Vec3(side, -side, -side),
                                          Vec3(-side, -side, -side)};
    constexpr float kAxis = 1.0f / 15, kCorner = 3.0f / 40, kSum = kAxis + 4 * kCorner;
    const std::size_t count = volume.field.places().size() * kLightNodesOfBrick;
    std::array<std::vector<float>, 10> depths;
    tbb::parallel_for(std::size_t{0}, directions.size(), [&](std::size_t n) {
        depths[n].resize(count);
        sweep(volume.field, volume.extinction, directions[n], depths[n]);
    });
    const auto decay = float(0.75 * (1 - mean_cosine));
    volume.surroundings.assign(count + 1, 0);
    tbb::parallel_for(std::size_t{0}, volume.field.places().size(), [&](std::size_t brick) {
        for (std::size_t i = brick * kLightNodesOfBrick; i < (brick + 1) * kLightNodesOfBrick; ++i) {
            const auto seen = [&](std::size_t first) {
                float sum = 0;
                for (std::size_t n = first; n < first + 5; ++n)
                    sum += (n == first ? kAxis : kCorner) / (1 + decay * depths[n][i]);
                return unsigned(255 * sum / kSum + 0.5f);
            };
            volume.surroundings[i] = std::uint16_t(seen(0) | seen(5) << 8);
        }
    });
}

namespace {

// Whether the line from a point towards the light passes the box of a field's bricks.
bool looks_through(const CoverageField& field, const Vec3& place_m, const Vec3& to_light) {
    double begin = 0, end = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        const double low = field.corner_m()[axis] - place_m[axis],
                     high = low + 2 * kCells * field.node_m() * field.bricks()[std::size_t(axis)];
        if (to_light[axis] == 0) {
            if (low > 0 || high < 0) return false;
            continue;
        }
        const double a = low / to_light[axis], b = high / to_light[axis];
        begin = std::max(begin, std::min(a, b));
        end = std::min(end, std::max(a, b));
    }
    return begin < end;
}

// Interpolates between the corners of a cube of a table with rows of `width` and planes of `plane` numbers.
template <class Number>
float trilinear(const Number* corner, std::size_t width, std::size_t plane, const float (&rest)[3]) {
    float sum = 0;
    for (std::size_t n = 0; n < 8; ++n) {
        const std::size_t o[3] = {n & 1, n >> 1 & 1, n >> 2};
        float weight = 1;
        for (std::size_t axis = 0; axis < 3; ++axis) weight *= o[axis] != 0 ? rest[axis] : 1 - rest[axis];
        sum += weight * float(corner[o[2] * plane + o[1] * width + o[0]]);
    }
    return sum;
}

}  // namespace

void light_volumes(std::span<CloudVolume> volumes, const Vec3& to_sun, const CloudLight& light) {
    // First each by itself, then what the others add.
    std::vector<std::vector<float>> depths(volumes.size());
    tbb::parallel_for(std::size_t{0}, volumes.size(), [&](std::size_t n) {
        CloudVolume& volume = volumes[n];
        const auto& bricks = volume.field.bricks();
        depths[n].resize(volume.field.places().size() * kLightNodesOfBrick);
        volume.own_depths.resize(volumes.size() == 1 ? 0 : depths[n].size());
        volume.corner_depths.resize(std::size_t(bricks[0] + 1) * std::size_t(bricks[1] + 1) * std::size_t(bricks[2] + 1));
        volume.to_sun = to_sun;
        volume.front = sweep(volume.field, volume.extinction, to_sun, depths[n], volume.corner_depths);
        for (std::size_t i = 0; i < volume.own_depths.size(); ++i) volume.own_depths[i] = packed_depth(depths[n][i]);
    });
    for (std::size_t n = 0; n < volumes.size(); ++n) {
        CloudVolume& volume = volumes[n];
        volume.sun_depths.assign(depths[n].size() + 1, 0);
        const auto& bricks = volume.field.bricks();
        tbb::parallel_for(std::size_t{0}, volume.field.places().size(), [&](std::size_t brick) {
            const std::int32_t at = volume.field.places()[brick];
            const Vec3 corner(at % bricks[0], at / bricks[0] % bricks[1], at / bricks[0] / bricks[1]);
            for (std::size_t i = 0; i < kLightNodesOfBrick; ++i) {
                const Vec3 node(i % kLightNodes, i / kLightNodes % kLightNodes, i / kLightNodes / kLightNodes);
                const Vec3 place = volume.field.corner_m() + 2 * volume.field.node_m() * (double(kCells) * corner + node);
                float depth = depths[n][brick * kLightNodesOfBrick + i];
                for (std::size_t m = 0; m < volumes.size(); ++m)
                    if (m != n) depth += sun_depth_at(volumes[m], place);
                if (light.lighting == Lighting::cfa)
                    depth = absorbed_depth(depth, volume.field.extinction_per_m(), light.light_distance_m);
                volume.sun_depths[brick * kLightNodesOfBrick + i] = packed_depth(depth);
            }
        });
    }
}

float sun_depth_at(const CloudVolume& volume, const Vec3& place_m) {
    const CoverageField& field = volume.field;
    if (!looks_through(field, place_m, volume.to_sun)) return 0;
    const auto& bricks = field.bricks();
    const Vec3 cells = (place_m - field.corner_m()) / (2 * field.node_m());
    std::size_t brick[3];
    double local[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double at = std::floor(cells[axis] / kCells);
        if (at < 0 || at >= bricks[std::size_t(axis)]) return volume.front.depth_at(place_m);
        brick[axis] = std::size_t(at);
        local[axis] = cells[axis] - at * kCells;
    }
    const auto x = std::size_t(bricks[0]), y = std::size_t(bricks[1]);
    const std::int32_t number = field.table()[(brick[2] * y + brick[1]) * x + brick[0]];
    float rest[3];
    if (number < 0) {
        for (int axis = 0; axis < 3; ++axis) rest[axis] = float(local[axis] / kCells);
        return trilinear(&volume.corner_depths[(brick[2] * (y + 1) + brick[1]) * (x + 1) + brick[0]], x + 1,
                         (x + 1) * (y + 1), rest);
    }
    std::size_t whole[3];
    for (int axis = 0; axis < 3; ++axis) {
        whole[axis] = std::size_t(std::min(int(local[axis]), kCells - 1));
        rest[axis] = float(local[axis] - double(whole[axis]));
    }
    const std::vector<std::uint16_t>& depths = volume.own_depths.empty() ? volume.sun_depths : volume.own_depths;
    const float root =
        trilinear(&depths[std::size_t(number) * kLightNodesOfBrick + (whole[2] * kLightNodes + whole[1]) * kLightNodes +
                          whole[0]],
                  kLightNodes, std::size_t(kLightNodes) * kLightNodes, rest) /
        65535;
    return root * root * kMostMarchedDepth;
}

void cast_shadows(std::span<const CloudVolume> volumes, const ShadowFrame& frame, int size,
                  std::span<float> shadow) {
    // Where lines leave the world of clouds: as far down the light as no cloud reaches.
    tbb::parallel_for(0, size, [&](int row) {
        for (int column = 0; column < size; ++column) {
            const Vec3 point = frame.origin_m + (column + 0.5) / size * frame.u_axis_m +
                               (row + 0.5) / size * frame.v_axis_m;
            float depth = 0;
            for (const CloudVolume& volume : volumes) depth += volume.front.depth_at(point);
            shadow[std::size_t(row) * std::size_t(size) + std::size_t(column)] *= std::exp(-depth);
        }
    });
}

}  // namespace nephos
