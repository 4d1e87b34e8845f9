// SPDX-License-Identifier: Apache-2.0
#include "render/blended/billboard_pass.h"

#include "render/frame/billboard_textures.h"
#include "render/gpu/frame_uploads.h"

namespace nephos {

BillboardPass::BillboardPass(const GpuDevice& gpu, std::span<const vk::Format> attachments,
                             const ShaderVariant& variant)
    : pipeline_(create_graphics_pipeline(gpu, shaders().billboard_vert, shaders().billboard_frag, attachments,
                                         Blend::over, variant)),
      without_depth_(create_graphics_pipeline(gpu, shaders().billboard_vert, shaders().billboard_frag,
                                              attachments, Blend::over, variant, 1)),
      sampler_(create_sampler(gpu, vk::SamplerAddressMode::eClampToEdge)) {}

void BillboardPass::use_clouds(const GpuDevice& gpu, std::span<const shader::ViewCloud> clouds) {
    upload(gpu, clouds_, std::as_bytes(clouds));
}

void BillboardPass::use_billboards(const GpuDevice& gpu, std::span<const shader::ViewBillboard> billboards,
                                   const BillboardPictures* pictures) {
    const std::uint64_t wanted = pictures != nullptr ? pictures->serial : 0;
    if (!billboards.empty() && (textures_.width == 0 || wanted != pictures_)) {
        textures_ = upload_billboard_textures(gpu, pictures);
        pictures_ = wanted;
    }
    upload(gpu, billboards_, std::as_bytes(billboards));
}

vk::DescriptorSet BillboardPass::fill(DescriptorSets& sets, const Resources& resources) const {
    return sets.fill(pipeline_, resources.with({{1, billboards_}, {2, clouds_}, {3, textures_, sampler_}}));
}

}  // namespace nephos
