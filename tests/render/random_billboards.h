// SPDX-License-Identifier: Apache-2.0
#pragma once

// Billboards of two clouds, scattered at random.

#include <cstdint>
#include <random>
#include <vector>

#include "render/cloud/splats.h"

namespace nephos::test {

inline const std::vector<BillboardCloud> kBillboardClouds{{{-400, 0, 1000}, 600, 1400},
                                                          {{400, 100, 1000}, 700, 1300}};

inline Splats scene_of(const std::vector<BillboardCloud>& clouds,
                       const std::vector<CloudBillboard>& billboards) {
    Splats splats;
    splats.clouds = clouds;
    splats.billboards = billboards;
    return splats;
}

inline std::vector<CloudBillboard> random_billboards(unsigned seed, int count, std::uint32_t clouds) {
    std::mt19937 engine(seed);
    const auto uniform = [&](double min, double max) {
        return min + (max - min) * (engine() / 4294967296.0);
    };
    std::vector<CloudBillboard> result;
    for (int i = 0; i < count; ++i) {
        CloudBillboard billboard;
        billboard.centre_m = {uniform(-900, 900), uniform(-900, 900), uniform(600, 1400)};
        billboard.width_m = float(uniform(50, 300));
        billboard.height_m = float(uniform(50, 300));
        billboard.sun_absorbed = float(uniform(0, 1));
        billboard.opacity = float(uniform(0.2, 1));
        billboard.texture = BillboardTexture(engine() % 3);
        billboard.variant = std::uint32_t(engine());
        billboard.cloud = std::uint32_t(engine()) % clouds;
        result.push_back(billboard);
    }
    return result;
}

}  // namespace nephos::test
