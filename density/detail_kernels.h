// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the kernels of detail-inl.h read of a CoverageField and of the noise. Internal to the engine.

#include <array>
#include <cstdint>

#include "density/detail.h"
#include "density/detail_noise.h"

namespace nephos {

// Returns the coordinates of an index in CoverageField::table(), x fastest. `size`: CoverageField::bricks().
inline std::array<int, 3> brick_at(std::int32_t index, const std::array<int, 3>& size) {
    return {index % size[0], index / size[0] % size[1], index / size[0] / size[1]};
}

struct DetailKernel {
    const std::uint8_t* nodes = nullptr;
    const std::int32_t* table = nullptr;
    const std::uint8_t* cells = nullptr;
    const std::uint32_t *large_noise = nullptr, *small_noise = nullptr;
    const ErosionConstants* erosion = nullptr;
    std::array<int, 3> bricks{};
    // The first of ErosionConstants::bands, one number of all of them after the other: as many as fit into a vector.
    static constexpr std::size_t kBands = 16;
    std::array<std::array<float, kBands>, 4> bands{};
    float node_m = 1, extinction_per_m = 0;
    std::array<double, 3> corner_m{};

    DetailKernel() = default;
    // `field` must outlive it.
    explicit DetailKernel(const CoverageField& field);
};

}  // namespace nephos
