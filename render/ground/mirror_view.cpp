// SPDX-License-Identifier: Apache-2.0
#include "render/ground/mirror_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/frame/frame_data.h"
#include "render/ground/water.h"

namespace nephos {
namespace {

constexpr double kMargin = 1.15;  // of the mirrored view's edges, as a multiple of the camera's
constexpr double kMostReach = 0.6;  // tangent: waves show what stands four times their slope higher, up to this

// Each texel is the mean of up to four of the level before; at odd sizes the last row and column count twice.
void fill_level(MirrorView& view, const MirrorView::Level& fine, const MirrorView::Level& coarse) {
    const auto texel = [&](int x, int y) {
        return &view.texels[4 * std::size_t(fine.first + std::min(y, fine.height - 1) * fine.width +
                                            std::min(x, fine.width - 1))];
    };
    for (int y = 0; y < coarse.height; ++y) {
        for (int x = 0; x < coarse.width; ++x) {
            float* out = &view.texels[4 * std::size_t(coarse.first + y * coarse.width + x)];
            for (int c = 0; c < 4; ++c) {
                out[c] = 0.25f * (texel(2 * x, 2 * y)[c] + texel(2 * x + 1, 2 * y)[c] +
                                  texel(2 * x, 2 * y + 1)[c] + texel(2 * x + 1, 2 * y + 1)[c]);
            }
        }
    }
}

}  // namespace

Camera mirrored_camera(const RenderOptions& options) {
    constexpr double kHalfDegree = std::numbers::pi / 360;
    const Camera& camera = options.camera;
    Camera mirrored = camera;
    mirrored.position_m.z = 2 * options.ground.height_m - camera.position_m.z;
    mirrored.target_m.z = 2 * options.ground.height_m - camera.target_m.z;
    const double height = kMargin * std::tan(camera.vertical_fov_deg * kHalfDegree);
    const double width = height * camera.width / camera.height;
    const bool waves = options.ground.pattern == GroundPattern::water;
    const double slope = waves ? std::sqrt(slope_variance_of_sea(options.water.wind_m_per_s)) : 0;
    const double reach = std::min(4 * slope, kMostReach);
    mirrored.vertical_fov_deg = std::min(170.0, std::atan(height + reach) / kHalfDegree);
    const double shape = (width + 0.5 * reach) / width / ((height + reach) / height);
    const auto pixels = [&](double size) {
        return std::clamp(int(std::lround(size * options.wet_ground.reflection_scale * kMargin)), 1, 16384);
    };
    mirrored.width = pixels(camera.width * shape);
    mirrored.height = pixels(camera.height);
    return mirrored;
}

MirrorView mirror_layout(const Camera& camera) {
    MirrorView view;
    view.frame = camera_frame(camera);
    view.pixels_per_unit = pixels_per_unit(camera, view.frame);
    view.levels.push_back({0, camera.width, camera.height});
    while (view.levels.back().width > 2 && view.levels.back().height > 2 &&
           view.levels.size() < shader::kMirrorLevels) {
        const MirrorView::Level& fine = view.levels.back();
        view.levels.push_back({fine.first + fine.width * fine.height, (fine.width + 1) / 2, (fine.height + 1) / 2});
    }
    return view;
}

std::size_t mirror_texels(const MirrorView& view) {
    const MirrorView::Level& last = view.levels.back();
    return std::size_t(last.first) + std::size_t(last.width) * std::size_t(last.height);
}

MirrorView mirror_view(const Picture& picture, const Camera& camera) {
    MirrorView view = mirror_layout(camera);
    view.texels.resize(4 * mirror_texels(view));
    for (std::size_t i = 0; i < picture.pixels(); ++i) {
        std::copy_n(&picture.beauty[3 * i], 3, &view.texels[4 * i]);
        view.texels[4 * i + 3] = picture.transmittance[i];
    }
    for (std::size_t n = 1; n < view.levels.size(); ++n) fill_level(view, view.levels[n - 1], view.levels[n]);
    return view;
}

}  // namespace nephos
