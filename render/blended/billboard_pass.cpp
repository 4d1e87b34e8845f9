// SPDX-License-Identifier: Apache-2.0
#include "render/blended/billboard_pass.h"

#include "render/gpu/frame_uploads.h"

namespace nephos {

BillboardPass::BillboardPass(const GpuDevice& gpu, const PipelineLayout& layout,
                             std::span<const vk::Format> attachments, const GpuBuffer& frame,
                             const ShaderVariant& variant)
    : layout_(&layout),
      physical_sky_(variant.physical_sky),
      pipeline_(create_graphics_pipeline(gpu, layout, shaders().billboard_vert, shaders().billboard_frag,
                                         attachments, Blend::over, variant)),
      without_depth_(create_graphics_pipeline(gpu, layout, shaders().billboard_vert, shaders().billboard_frag,
                                              attachments, Blend::over, variant, 1)),
      sampler_(create_sampler(gpu, vk::SamplerAddressMode::eClampToEdge)),
      bindings_(create_bindings(gpu, layout)),
      shells_(gpu, bindings_) {
    bind_buffer(gpu, bindings_, 0, frame);
}

void BillboardPass::use_sky(const GpuDevice& gpu, const GpuImage& tables, const vk::raii::Sampler& sampler) {
    bind_image(gpu, bindings_, 11, tables, sampler);
}

void BillboardPass::use_clouds(const GpuDevice& gpu, std::span<const shader::ViewCloud> clouds) {
    upload(gpu, bindings_, 2, clouds_, std::as_bytes(clouds));
}

void BillboardPass::use_billboards(const GpuDevice& gpu, std::span<const shader::ViewBillboard> billboards) {
    if (!billboards.empty() && textures_.width == 0) {
        textures_ = upload_billboard_textures(gpu);
        for (const std::uint32_t binding : {3u, 4u}) bind_image(gpu, bindings_, binding, textures_, sampler_);
        if (!physical_sky_) bind_image(gpu, bindings_, 11, textures_, sampler_);
    }
    upload(gpu, bindings_, 1, billboards_, std::as_bytes(billboards));
}

void BillboardPass::draw(const vk::raii::CommandBuffer& commands, std::uint32_t first, std::uint32_t count,
                         bool depth) const {
    commands.bindPipeline(vk::PipelineBindPoint::eGraphics, depth ? *pipeline_ : *without_depth_);
    commands.bindDescriptorSets(vk::PipelineBindPoint::eGraphics, *layout_->layout, 0, bindings_.set, {});
    commands.draw(6 * count, 1, 6 * first, 0);
}

}  // namespace nephos
