// SPDX-License-Identifier: Apache-2.0
#pragma once

// The tables of the sky on the device. Private to the module.

#include "render/atmosphere/sky_light.h"
#include "render/gpu/gpu_resources.h"

namespace nephos {

class SkyImage {
  public:
    explicit SkyImage(const GpuDevice& gpu);
    bool has(const SkyLight& light) const { return serial_ == light.serial; }
    // Copies the tables unless they are there already.
    void use(const GpuDevice& gpu, const SkyLight& light);
    const GpuImage& image() const { return image_; }  // readable by shaders

  private:
    GpuImage image_;
    GpuBuffer staging_;
    std::uint64_t serial_ = 0;
};

}  // namespace nephos
