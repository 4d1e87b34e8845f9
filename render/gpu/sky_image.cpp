// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/sky_image.h"

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

}  // namespace nephos
