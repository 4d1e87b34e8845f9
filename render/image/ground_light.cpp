// SPDX-License-Identifier: Apache-2.0
#include "render/image/ground_light.h"

#include <algorithm>
#include <cmath>

namespace nephos {

GroundLight::Fractions GroundLight::at(const Vec2& place_m) const {
    if (words.empty()) return {};
    const Vec2 texel = glm::clamp((place_m - corner_m) / texel_m - 0.5, 0.0, double(kTexels - 1));
    const Vec2 low = glm::min(glm::floor(texel), double(kTexels - 2)), part = texel - low;
    const std::size_t first = std::size_t(low.y) * kTexels + std::size_t(low.x);
    const auto mixed = [&](auto&& of) {
        const auto row = [&](std::size_t begin) {
            return std::lerp(double(of(words[begin])), double(of(words[begin + 1])), part.x) / 65535;
        };
        return std::lerp(row(first), row(first + kTexels), part.y);
    };
    return {mixed([](std::uint32_t word) { return word & 0xFFFFu; }),
            mixed([](std::uint32_t word) { return word >> 16; })};
}

}  // namespace nephos
