// SPDX-License-Identifier: Apache-2.0
#pragma once

// Uploads the textures of T's billboards, for both Vulkan back-ends. Private to the module.

#include "render/gpu/gpu_resources.h"

namespace nephos {

// Uploads the textures of billboard_textures.h with all levels, readable by shaders.
GpuImage upload_billboard_textures(const GpuDevice& gpu);

}  // namespace nephos
