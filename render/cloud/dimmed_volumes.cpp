// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/dimmed_volumes.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

namespace nephos {
namespace {

constexpr int kCells = CoverageField::kBrickCells;

Vec3 place_of_corner(const CoverageField& field, std::size_t brick, std::size_t corner) {
    const auto& bricks = field.bricks();
    const std::int32_t at = field.places()[brick];
    const Vec3 first(at % bricks[0], at / bricks[0] % bricks[1], at / bricks[0] / bricks[1]);
    const Vec3 node(corner % kLightNodes, corner / kLightNodes % kLightNodes,
                    corner / kLightNodes / kLightNodes);
    return field.corner_m() + 2 * field.node_m() * (double(kCells) * first + node);
}

// Adds to a number of CloudVolume::sun_depths.
std::uint16_t deeper(std::uint16_t packed, float more) {
    const float root = float(packed) / 65535;
    const float share = std::min(root * root + more / kMostMarchedDepth, 1.0f);
    return std::uint16_t(65535 * std::sqrt(share) + 0.5f);
}

}  // namespace

void dim_volumes(std::span<CloudVolume> volumes, const DepthOfOthers& depth_at) {
    for (CloudVolume& volume : volumes) {
        if (volume.own_depths.empty())
            volume.own_depths.assign(volume.sun_depths.begin(), volume.sun_depths.end() - 1);
        const bool diffuses = !volume.diffuse.upwards.empty();
        tbb::parallel_for(std::size_t{0}, volume.field.places().size(), [&](std::size_t brick) {
            for (std::size_t corner = 0; corner < kLightNodesOfBrick; ++corner) {
                const float depth = depth_at(place_of_corner(volume.field, brick, corner));
                if (depth <= 0) continue;
                const std::size_t i = brick * kLightNodesOfBrick + corner;
                volume.sun_depths[i] = deeper(volume.sun_depths[i], depth);
                if (!diffuses) continue;
                std::uint16_t& light =
                    volume.diffuse.upwards[i];  // the root of the fluence in the lower byte
                const float root = float(light & 255u) * std::exp(-0.5f * depth);
                light = std::uint16_t((light & 0xff00u) | unsigned(root + 0.5f));
            }
        });
    }
}

}  // namespace nephos
