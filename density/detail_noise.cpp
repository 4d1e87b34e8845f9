// SPDX-License-Identifier: Apache-2.0
#include "density/detail_noise.h"

// NEPHOS_DETAIL_NOISE_FILE is what make_detail_noise wrote; the assembler copies it into the library.
__asm__(
    ".section .rodata\n"
    ".balign 16\n"
    "nephos_detail_noise_bytes:\n"
    ".incbin \"" NEPHOS_DETAIL_NOISE_FILE "\"\n"
    ".previous\n");
extern "C" const std::uint8_t nephos_detail_noise_bytes[] __attribute__((visibility("hidden")));

namespace nephos {
namespace {

constexpr std::size_t cubed(int edge) { return std::size_t(edge) * std::size_t(edge) * std::size_t(edge); }

void append_words(std::span<const std::uint8_t> bytes, int edge, std::vector<std::uint32_t>& words) {
    const auto n = std::size_t(edge);
    const auto at = [&](std::size_t x, std::size_t y, std::size_t z) {
        return std::uint32_t(bytes[(z * n + y % n) * n + x % n]);
    };
    for (std::size_t z = 0; z < n; ++z)
        for (std::size_t y = 0; y < n; ++y)
            for (std::size_t x = 0; x < n; ++x)
                words.push_back(at(x, y, z) | at(x + 1, y, z) << 8 | at(x, y + 1, z) << 16 |
                                at(x + 1, y + 1, z) << 24);
}

std::vector<std::uint8_t> halved(std::span<const std::uint8_t> bytes, int edge) {
    const auto n = std::size_t(edge), half = n / 2;
    std::vector<std::uint8_t> result;
    for (std::size_t z = 0; z < half; ++z) {
        for (std::size_t y = 0; y < half; ++y) {
            for (std::size_t x = 0; x < half; ++x) {
                unsigned sum = 4;
                for (std::size_t c = 0; c < 8; ++c)
                    sum += bytes[((2 * z + (c >> 2)) * n + 2 * y + (c >> 1 & 1)) * n + 2 * x + (c & 1)];
                result.push_back(std::uint8_t(sum / 8));
            }
        }
    }
    return result;
}

}  // namespace

std::span<const std::uint8_t> large_noise_bytes() {
    return {nephos_detail_noise_bytes, cubed(kLargeNoiseVoxels)};
}

std::span<const std::uint8_t> small_noise_bytes() {
    return {nephos_detail_noise_bytes + cubed(kLargeNoiseVoxels), cubed(kSmallNoiseVoxels)};
}

const DetailNoise& detail_noise() {
    static const DetailNoise noise = [] {
        DetailNoise result;
        append_words(large_noise_bytes(), kLargeNoiseVoxels, result.large);
        const auto first = small_noise_bytes();
        std::vector<std::uint8_t> level(first.begin(), first.end());
        for (int l = 0; l < kSmallNoiseLevels; ++l) {
            append_words(level, kSmallNoiseVoxels >> l, result.small);
            level = halved(level, kSmallNoiseVoxels >> l);
        }
        return result;
    }();
    return noise;
}

}  // namespace nephos
