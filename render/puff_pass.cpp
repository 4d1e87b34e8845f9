// SPDX-License-Identifier: Apache-2.0
#include "render/puff_pass.h"

#include <cstring>

#include "render/half_floats.h"
#include "render/puff_textures.h"

namespace nephos {

// As 16-bit floats: software devices filter bytes to bytes, which adds up where many billboards lie behind
// each other.
GpuImage upload_puff_textures(const GpuDevice& gpu) {
    const std::vector<PuffLevel>& levels = puff_textures();
    constexpr std::uint32_t kLayers = kPuffKinds * kPuffVariants;
    GpuImage image = create_image(gpu, kPuffTexels, kPuffTexels, kLayers, vk::Format::eR16G16Sfloat,
                                  vk::ImageUsageFlagBits::eSampled | vk::ImageUsageFlagBits::eTransferDst,
                                  std::uint32_t(levels.size()));
    std::size_t bytes = 0;
    std::vector<vk::BufferImageCopy> regions;
    for (const PuffLevel& level : levels) {
        const auto side = std::uint32_t(level.side);
        regions.push_back({bytes,
                           0,
                           0,
                           {vk::ImageAspectFlagBits::eColor, std::uint32_t(regions.size()), 0, kLayers},
                           {0, 0, 0},
                           {side, side, 1}});
        bytes += 2 * level.texels.size();
    }
    const GpuBuffer staging =
        create_buffer(gpu, bytes, vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
    std::size_t to = 0;
    for (const PuffLevel& level : levels) {
        for (std::size_t i = 0; i < level.texels.size(); i += 2, to += sizeof(shader::uint)) {
            const shader::uint texel =
                pack_halves(float(level.texels[i]) / 255, float(level.texels[i + 1]) / 255);
            std::memcpy(staging.mapped + to, &texel, sizeof texel);
        }
    }
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        begin_image(commands, image, access::copy_to);
        commands.copyBufferToImage(*staging.buffer, *image.image, vk::ImageLayout::eGeneral, regions);
        image_barrier(commands, image, access::copy_to, access::sample);
    });
    return image;
}

PuffPass::PuffPass(const GpuDevice& gpu, const PipelineLayout& layout,
                   std::span<const vk::Format> attachments, const GpuBuffer& frame,
                   const ShaderVariant& variant)
    : layout_(&layout),
      physical_sky_(variant.physical_sky),
      pipeline_(create_graphics_pipeline(gpu, layout, shaders().puff_vert, shaders().puff_frag, attachments,
                                         Blend::over, variant)),
      without_depth_(create_graphics_pipeline(gpu, layout, shaders().puff_vert, shaders().puff_frag,
                                              attachments, Blend::over, variant, 1)),
      sampler_(create_sampler(gpu, vk::SamplerAddressMode::eClampToEdge)),
      bindings_(create_bindings(gpu, layout)),
      shells_(gpu, bindings_) {
    bind_buffer(gpu, bindings_, 0, frame);
}

void PuffPass::use_sky(const GpuDevice& gpu, const GpuImage& tables, const vk::raii::Sampler& sampler) {
    bind_image(gpu, bindings_, 11, tables, sampler);
}

void PuffPass::use_clouds(const GpuDevice& gpu, std::span<const shader::PuffCloud> clouds) {
    upload(gpu, bindings_, 2, clouds_, std::as_bytes(clouds));
}

void PuffPass::use_puffs(const GpuDevice& gpu, std::span<const shader::Puff> puffs) {
    if (!puffs.empty() && textures_.width == 0) {
        textures_ = upload_puff_textures(gpu);
        for (const std::uint32_t binding : {3u, 4u}) bind_image(gpu, bindings_, binding, textures_, sampler_);
        if (!physical_sky_) bind_image(gpu, bindings_, 11, textures_, sampler_);
    }
    upload(gpu, bindings_, 1, puffs_, std::as_bytes(puffs));
}

void PuffPass::draw(const vk::raii::CommandBuffer& commands, std::uint32_t first, std::uint32_t count,
                    bool depth) const {
    commands.bindPipeline(vk::PipelineBindPoint::eGraphics, depth ? *pipeline_ : *without_depth_);
    commands.bindDescriptorSets(vk::PipelineBindPoint::eGraphics, *layout_->layout, 0, bindings_.set, {});
    commands.draw(6 * count, 1, 6 * first, 0);
}

}  // namespace nephos
