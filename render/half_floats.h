// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pairs of 16-bit floats as shaders unpack them (unpackHalf2x16). Private to the module.

#include <Imath/half.h>

#include "render/shaders/shared.h"

namespace nephos {

// The first in the low bits; rounds to nearest.
inline shader::uint pack_halves(float low, float high) {
    return shader::uint(Imath::half(low).bits()) | shader::uint(Imath::half(high).bits()) << 16;
}

struct Halves {
    float low, high;
};
inline Halves unpack_halves(shader::uint bits) {
    Imath::half low, high;
    low.setBits(std::uint16_t(bits & 0xFFFF));
    high.setBits(std::uint16_t(bits >> 16));
    return {low, high};
}

}  // namespace nephos
