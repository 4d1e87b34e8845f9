// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/cloud_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

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
    return field.memory_bytes() + 4 * extinction.size() + 2 * (sun_depths.size() + surroundings.size());
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

void light_volumes(std::span<CloudVolume> volumes, const Vec3& to_sun, const CloudLight& light) {
    // Those nearer to the sun first, by the middles of their boxes.
    std::vector<std::size_t> order(volumes.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto towards = [&](std::size_t n) {
        const auto& bricks = volumes[n].field.bricks();
        const Vec3 size(bricks[0], bricks[1], bricks[2]);
        return -glm::dot(to_sun, volumes[n].field.corner_m() + 4 * volumes[n].field.node_m() * size);
    };
    std::ranges::stable_sort(order, {}, towards);
    for (std::size_t k = 0; k < order.size(); ++k) {
        CloudVolume& volume = volumes[order[k]];
        std::vector<float> depths(volume.field.places().size() * kLightNodesOfBrick);
        std::function<float(const Vec3&)> arriving;
        if (k > 0) {
            arriving = [&](const Vec3& point) {
                float depth = 0;
                for (std::size_t m = 0; m < k; ++m) depth += volumes[order[m]].front.depth_at(point);
                return depth;
            };
        }
        volume.front = sweep(volume.field, volume.extinction, to_sun, depths, arriving);
        if (k > 0) {  // what it adds itself
            std::vector<float> own(depths.size());
            volume.front = sweep(volume.field, volume.extinction, to_sun, own);
        }
        volume.sun_depths.assign(depths.size() + 1, 0);
        for (std::size_t i = 0; i < depths.size(); ++i) {
            float depth = depths[i];
            if (light.lighting == Lighting::cfa)
                depth = absorbed_depth(depth, volume.field.extinction_per_m(), light.light_distance_m);
            volume.sun_depths[i] = packed_depth(depth);
        }
    }
}

float sun_depth_at(const CloudVolume& volume, const Vec3& place_m) {
    const CoverageField& field = volume.field;
    const Vec3 cells = (place_m - field.corner_m()) / (2 * field.node_m());
    int brick[3], whole[3];
    float rest[3];
    for (int axis = 0; axis < 3; ++axis) {
        brick[axis] = int(std::floor(cells[axis] / kCells));
        if (brick[axis] < 0 || brick[axis] >= field.bricks()[std::size_t(axis)])
            return glm::dot(volume.front.to_light(), cells) < 0 ? volume.front.depth_at(place_m) : 0.0f;
        const double local = cells[axis] - brick[axis] * kCells;
        whole[axis] = std::min(int(local), kCells - 1);
        rest[axis] = float(local - whole[axis]);
    }
    const std::int32_t number =
        field.table()[(std::size_t(brick[2]) * std::size_t(field.bricks()[1]) + std::size_t(brick[1])) *
                          std::size_t(field.bricks()[0]) +
                      std::size_t(brick[0])];
    if (number < 0) return 0;
    const std::uint16_t* const nodes = &volume.sun_depths[std::size_t(number) * kLightNodesOfBrick];
    float root = 0;
    for (int n = 0; n < 8; ++n) {
        const int o[3] = {n & 1, n >> 1 & 1, n >> 2};
        float weight = 1;
        for (int axis = 0; axis < 3; ++axis) weight *= o[axis] != 0 ? rest[axis] : 1 - rest[axis];
        root += weight * float(nodes[((whole[2] + o[2]) * kLightNodes + whole[1] + o[1]) * kLightNodes + whole[0] +
                                     o[0]]);
    }
    root /= 65535;
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
