// SPDX-License-Identifier: Apache-2.0
#pragma once

// Uploads what shaders of both Vulkan back-ends read of a frame beside its splats: the tables of the sky, the textures of
// T's billboards, the shells of air. Private to the module.

#include <cstdint>
#include <span>

#include "render/atmosphere/sky_light.h"
#include "render/frame/air_shells.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/gpu/gpu_resources.h"

namespace nephos {

// The tables of the sky as an image.
class SkyImage {
  public:
    explicit SkyImage(const GpuDevice& gpu);
    bool has(const SkyLight& light) const { return serial_ == light.serial; }
    // Copies the tables unless they are there already.
    void use(const GpuDevice& gpu, const SkyLight& light);
    const GpuImage& image() const { return image_; }  // readable by shaders

  private:
    GpuImage image_;
    std::uint64_t serial_ = 0;
};

// Uploads the textures of billboard_textures.h with all levels, readable by shaders; `pictures`: with those, or null.
GpuImage upload_billboard_textures(const GpuDevice& gpu, const BillboardPictures* pictures);

// Uploads where the rays of a picture end at ground that is not level. Throws Error(usage) for more than shaders see of a
// buffer.
void upload_terrain(const GpuDevice& gpu, GpuBuffer& buffer, std::span<const float> distance_m);

// The shells of air: bindings 13 and 14 of shells.glsl.
class ShellBuffers {
  public:
    // Buffers without shells: descriptors must be there, used or not.
    explicit ShellBuffers(const GpuDevice& gpu);

    // Sets the data that shaders read in later draws; shade() may then be another buffer.
    void use(const GpuDevice& gpu, const AirShells& shells);
    const GpuBuffer& shells() const { return shells_; }
    const GpuBuffer& shade() const { return shade_; }

  private:
    GpuBuffer shells_, shade_;
    std::uint64_t serial_ = 0;  // of what is in shade_
};

}  // namespace nephos
