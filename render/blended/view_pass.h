// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 2 of D, part by part: background, then metaballs, billboards and shells of air back to front. Two
// attachments in 32-bit floats: radiance with the clouds' transmittance in alpha, and the distance weighted
// by what the eye sees of each metaball, which the same blending accumulates. Private to the module.

#include "render/blended/billboard_pass.h"
#include "render/frame/frame_data.h"
#include "render/frame/view_sorting.h"
#include "render/gpu/frame_uploads.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/image/picture.h"

namespace nephos {

class ViewPass {
  public:
    ViewPass(const GpuDevice& gpu, const ShaderVariant& variant);

    // Sets what later draws read, by the numbers in the shaders: attenuation textures (3), the shadow map of the
    // ground (4), tables of the sky (11; any image with the gradient) and the scattering table (12).
    void use(const Resources& resources);
    // Sets the air between the clouds, in front of what `order` has; for a pass made for shells.
    void use_shells(const GpuDevice& gpu, const AirShells& shells, const ViewSortedSplats& order);

    // Sets where rays end at ground that is not level (TerrainView::distance_m); for a pass made for terrain.
    void use_terrain(const GpuDevice& gpu, std::span<const float> distance_m);

    // Draws one part and stores its pixels in the picture.
    void draw_part(const GpuDevice& gpu, const shader::FrameUniforms& frame, const PicturePart& part,
                   const ViewSortedSplats& order, Picture& picture);

  private:
    void resize_targets(const GpuDevice& gpu, const PicturePart& part);
    void draw_background(const GpuDevice& gpu, vk::Extent2D area);
    void draw_splats(const GpuDevice& gpu, vk::Extent2D area, const ViewSortedSplats& order);
    void draw_batch(const GpuDevice& gpu, vk::Extent2D area, const ViewSortedSplats& order,
                    std::span<const Run> runs);
    void read_back(const GpuDevice& gpu, vk::Extent2D area) const;

    Pipeline background_, splat_, integrated_splat_, shell_;
    DescriptorSets sets_;
    Resources resources_;
    GpuBuffer frame_, balls_, terrain_, radiance_pixels_, depth_pixels_;
    GpuImage radiance_, depth_;
    BillboardPass billboards_;
    ShellBuffers shells_;
    std::vector<Run> runs_;  // between and with the shells in use; empty without shells
};

}  // namespace nephos
