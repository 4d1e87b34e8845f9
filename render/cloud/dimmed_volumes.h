// SPDX-License-Identifier: Apache-2.0
#pragma once

// Sunlight that volumes lose by their place (Splats::in_voxels), beside what stands between them and the sun: T's absorption
// leaves the light of the sky alone. Of the light that is scattered once and of that which diffuses, each place keeps
// exp(-depth). It is no shade: what the volume casts on anything else stays. Private to the module.

#include <span>

#include "render/cloud/cloud_volume.h"

namespace nephos {

// Adds an optical depth at each place to the light of volumes. Once after each light_volumes(). Parallel; the same for any
// number of threads.
void dim_volumes(std::span<CloudVolume> volumes, const DepthOfOthers& depth_at);

}  // namespace nephos
