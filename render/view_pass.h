// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 2 of D, tile by tile: background, then billboards back to front. Two attachments in 32-bit floats: radiance with
// the clouds' transmittance in alpha, and the distance weighted by what the eye sees of each metaball, which the same
// blending accumulates. Private to the module.

#include <span>

#include "render/cloud_preparation.h"
#include "render/frame_data.h"
#include "render/gpu_pipeline.h"

namespace nephos {

class ViewPass {
  public:
    ViewPass(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& attenuation,
             const vk::raii::Sampler& sampler);

    // The map that the ground wears; in the layout GENERAL and readable by fragment shaders.
    void use_shadow_map(const GpuDevice& gpu, const GpuImage& map, const vk::raii::Sampler& sampler);

    // Draws `balls`, far ones first, and stores the tile's pixels in the picture.
    void draw_tile(const GpuDevice& gpu, const shader::Frame& frame, const Tile& tile,
                   std::span<const shader::ViewBall> balls, Picture& picture);

  private:
    void resize_targets(const GpuDevice& gpu, const Tile& tile);
    void store(const Tile& tile, Picture& picture) const;

    const PipelineLayout* layout_;
    vk::raii::Pipeline background_, splat_;
    Bindings bindings_;
    GpuBuffer frame_, balls_, radiance_pixels_, depth_pixels_;
    GpuImage radiance_, depth_;
};

}  // namespace nephos
