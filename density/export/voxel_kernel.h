// SPDX-License-Identifier: Apache-2.0
#pragma once

// SIMD kernels of volume.h (not installed): floats to 8 and 16 bits, and rows of half the voxels. The same bits on every
// machine, with any vector width.

#include <cstddef>
#include <cstdint>

namespace nephos {

// Computes round(clamp(value * factor, 0, most)) of `count` values, halves upwards; most = 255 and 65535.
void to_codes(const float* values, std::size_t count, float factor, std::uint8_t* codes);
void to_codes(const float* values, std::size_t count, float factor, std::uint16_t* codes);

// Computes IEEE halves of value * factor, ties to even, for finite products of at least 0; above 65504 it is 65504.
void to_halves(const float* values, std::size_t count, float factor, std::uint16_t* halves);

// Writes `count` blocks of BC4, 8 bytes each, of four rows of 4 * count values of at least 0: a block's largest and smallest
// value times `to_code`, at most 255, and for each voxel how many sevenths it lies below the largest.
void to_bc4_blocks(const float* a, const float* b, const float* c, const float* d, std::size_t count, float to_code,
                   std::uint8_t* blocks);

// Computes to[i] = the mean of 2 i and 2 i + 1 of the four rows; each has 2 * count values.
void halve_rows(const float* a, const float* b, const float* c, const float* d, std::size_t count, float* to);

}  // namespace nephos
