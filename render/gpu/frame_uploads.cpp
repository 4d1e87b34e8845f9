// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/frame_uploads.h"

#include <span>
#include <vector>

#include "core/error.h"
#include "render/frame/billboard_textures.h"
#include "render/shared/half_floats.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr std::size_t kFloats = std::size_t{4} * shader::kSkyColumns * shader::kSkyRows * shader::kSkyLayers;

}  // namespace

SkyImage::SkyImage(const GpuDevice& gpu)
    : image_(create_image(gpu, shader::kSkyColumns, shader::kSkyRows, shader::kSkyLayers,
                          vk::Format::eR32G32B32A32Sfloat,
                          vk::ImageUsageFlagBits::eSampled | vk::ImageUsageFlagBits::eTransferDst)) {}

void SkyImage::use(const GpuDevice& gpu, const SkyLight& light) {
    if (has(light)) return;
    upload_image(gpu, image_, std::as_bytes(std::span(light.texels).first(kFloats)));
    serial_ = light.serial;
}

// As 16-bit floats: software devices filter bytes to bytes, which adds up where many billboards lie behind
// each other.
GpuImage upload_billboard_textures(const GpuDevice& gpu, const BillboardPictures* pictures) {
    const std::vector<BillboardLevel>& levels = billboard_levels(pictures);
    const auto layers = std::uint32_t(kBillboardLayers + (pictures != nullptr ? pictures->count : 0));
    GpuImage image = create_image(gpu, kBillboardTexels, kBillboardTexels, layers, vk::Format::eR16G16Sfloat,
                                  vk::ImageUsageFlagBits::eSampled | vk::ImageUsageFlagBits::eTransferDst,
                                  std::uint32_t(levels.size()));
    std::vector<shader::uint> texels;
    for (const BillboardLevel& level : levels)
        for (std::size_t i = 0; i < level.texels.size(); i += 2)
            texels.push_back(pack_halves(float(level.texels[i]) / 255, float(level.texels[i + 1]) / 255));
    upload_image(gpu, image, std::as_bytes(std::span(texels)));
    return image;
}

void upload_terrain(const GpuDevice& gpu, GpuBuffer& buffer, std::span<const float> distance_m) {
    const std::size_t most = gpu.properties.limits.maxStorageBufferRange;
    if (distance_m.size_bytes() > most)
        throw Error(ErrorCode::usage, "this Vulkan device draws ground that is not level in pictures of at most " +
                                          std::to_string(most / sizeof(float)) + " pixels, but this one has " +
                                          std::to_string(distance_m.size()) +
                                          ": choose the back-end cpu, or a smaller picture");
    upload(gpu, buffer, std::as_bytes(distance_m));
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
