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
    // `attachments` are those of the view pass, `frame` its buffer of shader::Frame.
    BillboardPass(const GpuDevice& gpu, const PipelineLayout& layout, std::span<const vk::Format> attachments,
                  const GpuBuffer& frame, const ShaderVariant& variant);

    // Tables of the physical sky; readable by shaders.
    void use_sky(const GpuDevice& gpu, const GpuImage& tables, const vk::raii::Sampler& sampler);
    // scattering_table.h, of the fog
    void use_scattering(const GpuDevice& gpu, const GpuBuffer& table) {
        bind_buffer(gpu, bindings_, 12, table);
    }
    // The air between the billboards; see frame_uploads.h.
    void use_shells(const GpuDevice& gpu, const AirShells& shells) { shells_.use(gpu, bindings_, shells); }

    // Sets the clouds of later draws. Textures are generated with the first billboard.
    void use_clouds(const GpuDevice& gpu, std::span<const shader::ViewCloud> clouds);
    void use_billboards(const GpuDevice& gpu, std::span<const shader::ViewBillboard> billboards);

    // Draws some of the billboards in use; inside of a rendering into the attachments. Without `depth` only
    // the first attachment is drawn to.
    void draw(const vk::raii::CommandBuffer& commands, std::uint32_t first, std::uint32_t count,
              bool depth) const;

  private:
    const PipelineLayout* layout_;
    bool physical_sky_;
    vk::raii::Pipeline pipeline_, without_depth_;
    vk::raii::Sampler sampler_;
    Bindings bindings_;
    GpuBuffer billboards_, clouds_;
    GpuImage textures_;
    ShellBuffers shells_;
};

}  // namespace nephos
