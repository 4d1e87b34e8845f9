// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/frame_uploads.h"

#include <cstring>
#include <vector>

#include "render/frame/billboard_textures.h"
#include "render/shared/half_floats.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr std::size_t kBytes =
    std::size_t{4} * sizeof(float) * shader::kSkyColumns * shader::kSkyRows * shader::kSkyLayers;

}  // namespace

SkyImage::SkyImage(const GpuDevice& gpu)
    : image_(create_image(gpu, shader::kSkyColumns, shader::kSkyRows, shader::kSkyLayers,
                          vk::Format::eR32G32B32A32Sfloat,
                          vk::ImageUsageFlagBits::eSampled | vk::ImageUsageFlagBits::eTransferDst)),
      staging_(create_buffer(gpu, kBytes, vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write)) {}

void SkyImage::use(const GpuDevice& gpu, const SkyLight& light) {
    if (has(light)) return;
    write(gpu, staging_, std::as_bytes(std::span(light.texels).first(kBytes / sizeof(float))));
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        begin_image(commands, image_, access::copy_to);
        const vk::BufferImageCopy region(0, 0, 0, {vk::ImageAspectFlagBits::eColor, 0, 0, shader::kSkyLayers},
                                         {0, 0, 0}, {shader::kSkyColumns, shader::kSkyRows, 1});
        commands.copyBufferToImage(*staging_.buffer, *image_.image, vk::ImageLayout::eGeneral, region);
        image_barrier(commands, image_, access::copy_to, access::sample);
    });
    serial_ = light.serial;
}

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

ShellBuffers::ShellBuffers(const GpuDevice& gpu)
    : shells_(create_buffer(gpu, sizeof(shader::Shells), vk::BufferUsageFlagBits::eUniformBuffer,
                            HostAccess::write)) {
    use(gpu, {});
}

void ShellBuffers::use(const GpuDevice& gpu, const AirShells& shells) {
    write(gpu, shells_, shells.data);
    if (shade_.bytes != 0 && shells.serial == serial_) return;
    serial_ = shells.serial;
    upload(gpu, shade_, std::as_bytes(shells.shade));
}

}  // namespace nephos
