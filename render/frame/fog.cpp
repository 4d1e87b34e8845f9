// SPDX-License-Identifier: Apache-2.0
#include "render/frame/fog.h"

#include <algorithm>
#include <cmath>

#include "core/noise.h"
#include "core/vec.h"

namespace nephos {
namespace {

constexpr int kCells = 4;  // of the noise along an edge of the cube

double fraction(double value) { return value - std::floor(value); }

// Returns for one sample the position of the eye in the cube, and cubes per metre. The noise drifts with the
// fog.
shader::vec4 place(const Vec3& eye_m, const Vec3& way_m, double per_m) {
    const Vec3 at = per_m * (eye_m - way_m);
    return {float(fraction(at.x)), float(fraction(at.y)), float(fraction(at.z)), float(per_m)};
}

}  // namespace

const std::vector<std::uint32_t>& FogNoise::words(std::uint64_t seed) {
    if (!words_.empty() && seed == seed_) return words_;
    constexpr auto kEdge = std::size_t(shader::kFogVoxels);
    const std::vector<float> values = noise_volume({.seed = std::uint32_t(seed ^ seed >> 32),
                                                    .voxels = int(kEdge),
                                                    .cells = kCells,
                                                    .octaves = 3,
                                                    .persistence = 0.5});
    const auto byte = [&](std::size_t x, std::size_t y, std::size_t z) {
        return std::uint32_t(values[(z * kEdge + y % kEdge) * kEdge + x % kEdge] * 255.0f + 0.5f);
    };
    words_.clear();
    words_.reserve(values.size());
    for (std::size_t z = 0; z < kEdge; ++z)
        for (std::size_t y = 0; y < kEdge; ++y)
            for (std::size_t x = 0; x < kEdge; ++x)
                words_.push_back(byte(x, y, z) | byte(x + 1, y, z) << 8 | byte(x, y + 1, z) << 16 |
                                 byte(x + 1, y + 1, z) << 24);
    seed_ = seed;
    return words_;
}

void set_fog(const Fog& fog, const Vec3& eye_m, double time_s, shader::Shells& data) {
    data.fog = data.fog_coarse = data.fog_fine = data.fog_limits = {};
    if (!(fog.extinction_per_m > 0)) return;
    data.fog = {float(fog.extinction_per_m), float(1 / fog.height_m), float(eye_m.z - fog.base_m),
                float(2 * fog.patchiness)};
    constexpr double kNoFog = 1e-9;  // per metre
    data.fog_limits.x = float(fog.height_m * std::max(0.0, std::log(fog.extinction_per_m / kNoFog)));
    // The finer look-up drifts slower, and its axes are others: patches change their shapes on the way, and
    // have no common period.
    const double per_m = 1 / (kCells * fog.patch_m);
    data.fog_coarse = place(eye_m, time_s * fog.velocity_m_per_s, per_m);
    const auto turned = [](const Vec3& v) { return Vec3{v.y, v.z, v.x}; };
    data.fog_fine = place(turned(eye_m), turned(0.8 * time_s * fog.velocity_m_per_s), 1.618 * per_m);
}

}  // namespace nephos
