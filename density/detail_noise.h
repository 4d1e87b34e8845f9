// SPDX-License-Identifier: Apache-2.0
#pragma once

// The noise of detailed density (detail.h): two cubes that tile space, made when the project is built
// (make_detail_noise.cpp) and part of the library. Each is a sum of three octaves of Worley's F1, the distance to the
// nearest of a set of random points (S. Worley 1996, "A cellular texture basis function"), low in the middle of a
// bump, looked up at a place that gradient noise displaces; then equalised: its values are distributed evenly
// over 0..1. Internal to the engine; thread-safe.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace nephos {

inline constexpr int kLargeNoiseVoxels = 128;  // on an edge: bumps of 16, 8 and 4 voxels
inline constexpr int kSmallNoiseVoxels = 64;   // likewise
inline constexpr int kSmallNoiseLevels = 4;    // of half the voxels each, means of eight

// Bytes of a cube in the library, x fastest.
std::span<const std::uint8_t> large_noise_bytes();
std::span<const std::uint8_t> small_noise_bytes();

// The cubes as kernels and shaders read them: a word has the bytes of voxel (x, y, z), of its neighbours in x, in y,
// and in both, around the edge.
struct DetailNoise {
    std::vector<std::uint32_t> large;
    std::vector<std::uint32_t> small;  // its levels one after the other
};
// Returns the one copy of this process.
const DetailNoise& detail_noise();

// Returns the index of the first word of a level in DetailNoise::small.
constexpr std::size_t first_of_level(int level) {
    std::size_t first = 0;
    for (int l = 0; l < level; ++l) {
        const auto edge = std::size_t(kSmallNoiseVoxels >> l);
        first += edge * edge * edge;
    }
    return first;
}

}  // namespace nephos
