// SPDX-License-Identifier: Apache-2.0
#pragma once

// 16-bit numbers as shaders unpack them (unpackHalf2x16, unpackUnorm2x16). Private to the module.

#include <algorithm>

#include <Imath/half.h>

#include "render/shared/shared.h"

namespace nephos {

// Packs two half floats, the first in the low bits; rounds to nearest.
inline shader::uint pack_halves(float low, float high) {
    return shader::uint(Imath::half(low).bits()) | shader::uint(Imath::half(high).bits()) << 16;
}

// Returns 0..1 as 0..65535; rounds to nearest.
inline shader::uint unorm16(float value) {
    return shader::uint(std::clamp(value, 0.0f, 1.0f) * 65535.0f + 0.5f);
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
