// SPDX-License-Identifier: Apache-2.0
#include "render/blended/attenuation_texture.h"

#include <algorithm>
#include <cmath>

#include "render/shared/shared.h"

namespace nephos {

float attenuation_depth_scale(int layer) {
    const float step = float(layer) / float(shader::kAttenuationLevels - 1);
    return shader::kMaxDepthScale * step * step * step;
}

std::vector<float> attenuation_textures() {
    constexpr int kTexels = int(shader::kAttenuationTexels);
    std::vector<float> texels;
    texels.reserve(2 * shader::kAttenuationLevels * kTexels * kTexels);
    for (int layer = 0; layer < int(shader::kAttenuationLevels); ++layer) {
        const float here = attenuation_depth_scale(layer), next = attenuation_depth_scale(layer + 1);
        for (int j = 0; j < kTexels; ++j) {
            for (int i = 0; i < kTexels; ++i) {
                const float x = float(i) / float(kTexels - 1), y = float(j) / float(kTexels - 1);
                const float w = std::max(0.0f, 1.0f - x * x - y * y);
                for (const float depth_scale : {here, next})
                    texels.push_back(-std::expm1(-depth_scale * shader::line_integral(w, std::sqrt(w))));
            }
        }
    }
    return texels;
}

}  // namespace nephos
