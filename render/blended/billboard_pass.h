// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's billboards on the device: their textures, buffers and pipeline. The view pass draws them between its
// metaballs. Private to the module.

#include <span>

#include "render/gpu/frame_uploads.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/shared/shared.h"

namespace nephos {

class BillboardPass {
  public:
    // `attachments` are those of the view pass.
    BillboardPass(const GpuDevice& gpu, std::span<const vk::Format> attachments,
                  const ShaderVariant& variant);

    // Sets the clouds of later draws.
    void use_clouds(const GpuDevice& gpu, std::span<const shader::ViewCloud> clouds);
    // Sets the billboards of later draws, and the pictures that they may have, or null. Textures are generated with the
    // first billboard. Precondition: the device draws nothing of this pass.
    void use_billboards(const GpuDevice& gpu, std::span<const shader::ViewBillboard> billboards,
                        const BillboardPictures* pictures);

    // Returns the pipeline that draws 6 vertices for each billboard. Without `depth` only the first attachment is
    // drawn to.
    const Pipeline& pipeline(bool depth) const { return depth ? pipeline_ : without_depth_; }
    // Returns a set for either, with clouds and at least one billboard in use; `resources`: those of the view pass.
    vk::DescriptorSet fill(DescriptorSets& sets, const Resources& resources) const;

  private:
    Pipeline pipeline_, without_depth_;
    vk::raii::Sampler sampler_;
    GpuBuffer billboards_, clouds_;
    GpuImage textures_;
    std::uint64_t pictures_ = 0;  // BillboardPictures::serial of these; 0: none
};

}  // namespace nephos
