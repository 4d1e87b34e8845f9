// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "render/terrain/terrain_caster.h"

namespace nephos {
namespace {

constexpr float kApart = 1.12f;  // ratio of distances at which there is an edge

// Rows and columns of eight queens: even in both.
constexpr std::array<std::array<double, 2>, 8> kPoints{
    {{0.5, 4.5}, {1.5, 1.5}, {2.5, 5.5}, {3.5, 7.5}, {4.5, 2.5}, {5.5, 0.5}, {6.5, 3.5}, {7.5, 6.5}}};

bool apart(float a, float b) { return a > kApart * b || b > kApart * a; }

struct Neighbourhood {
    std::array<std::size_t, 9> pixel{};
    std::array<float, 9> distance{};  // the pixel itself first
    std::size_t count = 0;
};

Neighbourhood around(const TerrainView& view, int x, int y) {
    Neighbourhood all;
    const auto add = [&](int column, int row) {
        if (column < 0 || row < 0 || column >= view.width || row >= view.height) return;
        const std::size_t n = std::size_t(row) * std::size_t(view.width) + std::size_t(column);
        all.pixel[all.count] = n;
        all.distance[all.count++] = view.distance_m[n];
    };
    add(x, y);
    for (const auto& [i, j] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}}) add(x + i, y + j);
    return all;
}

}  // namespace

void smooth_edges(const HeightMap& map, const RenderOptions& options, double bend, const TerrainView& view, Picture& picture) {
    const std::vector<float> beauty = picture.beauty, transmittance = picture.transmittance;
    const TerrainCaster caster(map, options, bend);
    tbb::parallel_for(0, view.height, [&](int y) {
        for (int x = 0; x < view.width; ++x) {
            const Neighbourhood near = around(view, x, y);
            const float own = near.distance[0];
            const std::size_t direct = std::min<std::size_t>(near.count, 5);
            if (std::none_of(&near.distance[1], &near.distance[direct], [&](float each) { return apart(own, each); })) continue;
            std::array<float, 9> weight{};
            for (const auto& point : kPoints) {
                const float seen = caster.distance(x + point[0] / 8, y + point[1] / 8);
                // The pixel itself unless a neighbour is nearer to what is seen.
                std::size_t best = 0;
                const auto from = [&](std::size_t n) { return std::abs(std::log(near.distance[n] / seen)); };
                if (apart(own, seen))
                    for (std::size_t n = 1; n < near.count; ++n)
                        if (from(n) < from(best)) best = n;
                weight[best] += 1.0f / float(kPoints.size());
            }
            std::array<float, 4> sum{};
            for (std::size_t n = 0; n < near.count; ++n) {
                for (std::size_t c = 0; c < 3; ++c) sum[c] += weight[n] * beauty[3 * near.pixel[n] + c];
                sum[3] += weight[n] * transmittance[near.pixel[n]];
            }
            std::copy_n(sum.begin(), 3, &picture.beauty[3 * near.pixel[0]]);
            picture.transmittance[near.pixel[0]] = sum[3];
        }
    });
}

}  // namespace nephos
