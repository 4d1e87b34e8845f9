// SPDX-License-Identifier: Apache-2.0
#pragma once

// Fog in the shells of air around the eye (air_shells.h): what render/shading/shells.glsl needs of it. Inhomogeneous
// as S's fog, "by the same procedure as clouds": a cube of the octave noise of core/noise.h, looked up
// twice at two scales that have no common period, and falling off exponentially with height. No Vulkan here.
// Private to the module.

#include <cstdint>
#include <vector>

#include "render/options/options.h"
#include "render/shared/shared.h"

namespace nephos {

// The cube of noise, kFogVoxels on a side, x fastest. Each word has four bytes for 0..1: of the voxel, of its
// neighbours towards x, y, and both; beyond the end the cube begins again.
class FogNoise {
  public:
    const std::vector<std::uint32_t>& words(std::uint64_t seed);

  private:
    std::uint64_t seed_ = 0;
    std::vector<std::uint32_t> words_;
};

// Writes what shells carry of the fog at a time; without fog, zeros.
void set_fog(const Fog& fog, const Vec3& eye_m, double time_s, shader::Shells& data);

}  // namespace nephos
