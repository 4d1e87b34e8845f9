// SPDX-License-Identifier: Apache-2.0
#pragma once

// Smooth step functions for all modules (not installed).

#include <algorithm>
#include <type_traits>

namespace nephos {

// Returns 3 t^2 - 2 t^3 for t in 0..1: rises from 0 to 1 with slope 0 at both ends.
template <class T>
constexpr T smooth_blend(T t) {
    return t * t * (3 - 2 * t);
}

// Returns 0 at `low` and before it, 1 at `high` and beyond, smooth_blend() between. `low` may be above
// `high`; they must differ. NaN gives NaN.
template <class T>
constexpr T smoothstep(std::type_identity_t<T> low, std::type_identity_t<T> high, T x) {
    return smooth_blend(std::clamp<T>((x - low) / (high - low), 0, 1));
}

}  // namespace nephos
