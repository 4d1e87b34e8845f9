// SPDX-License-Identifier: Apache-2.0
#pragma once

// The vector part of core/noise.h (not installed).

#include <cstddef>

#include "core/noise.h"

namespace nephos {

// As gradient_noise(), of `count` points, without checks.
void noise_points(const float* x, const float* y, const float* z, const NoiseOptions& options,
                  std::size_t count, float* out);

}  // namespace nephos
