// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/billboard_image.h"

#include <cstring>
#include <vector>

#include "render/frame/billboard_textures.h"
#include "render/shared/half_floats.h"
#include "render/shared/shared.h"

namespace nephos {

// As 16-bit floats: software devices filter bytes to bytes, which adds up where many billboards lie behind
// each other.
GpuImage upload_billboard_textures(const GpuDevice& gpu) {
    const std::vector<BillboardLevel>& levels = billboard_textures();
    constexpr std::uint32_t kLayers = kBillboardKinds * kBillboardVariants;
    GpuImage image = create_image(gpu, kBillboardTexels, kBillboardTexels, kLayers, vk::Format::eR16G16Sfloat,
                                  vk::ImageUsageFlagBits::eSampled | vk::ImageUsageFlagBits::eTransferDst,
                                  std::uint32_t(levels.size()));
    std::size_t bytes = 0;
    std::vector<vk::BufferImageCopy> regions;
    for (const BillboardLevel& level : levels) {
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
    for (const BillboardLevel& level : levels) {
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

}  // namespace nephos
