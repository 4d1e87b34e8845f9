// SPDX-License-Identifier: Apache-2.0
#pragma once

// The SIMD kernel of core/noise.h (not installed).

#include <cstddef>

#include "core/noise.h"

namespace nephos {

// Evaluates gradient_noise() at `count` points without checking the arguments.
void noise_points(const float* x, const float* y, const float* z, const NoiseOptions& options,
                  std::size_t count, float* out);

}  // namespace nephos
