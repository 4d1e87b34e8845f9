// SPDX-License-Identifier: Apache-2.0
#pragma once

// Fog in the shells of air around the eye (air_shells.h): its parameters for render/shading/shells.glsl and
// shells-inl.h. Inhomogeneous as S's fog, "by the same procedure as clouds": a cube of the octave noise of
// core/noise.h, sampled at two scales without a common period, and an exponential fall-off with height.
// Private to the module.

#include <cstdint>
#include <vector>

#include "render/options/options.h"
#include "render/shared/shared.h"

namespace nephos {

// The cube of noise, kFogVoxels on a side, x fastest, periodic; cached by seed. Each word has four bytes for
// 0..1: of the voxel and of its neighbours along x, along y, and along both. Not thread-safe.
class FogNoise {
  public:
    const std::vector<std::uint32_t>& words(std::uint64_t seed);

  private:
    std::uint64_t seed_ = 0;
    std::vector<std::uint32_t> words_;
};

// Writes the fog's parameters at a time to `data`; without fog, zeros.
void set_fog(const Fog& fog, const Vec3& eye_m, double time_s, shader::Shells& data);

}  // namespace nephos
