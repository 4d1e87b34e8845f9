// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/gpu_resources.h"

#include <algorithm>
#include <exception>
#include <initializer_list>
#include <vector>

#include "core/error.h"

namespace nephos {
namespace {

using MemoryFlags = vk::MemoryPropertyFlags;
using Memory = vk::MemoryPropertyFlagBits;

// Kinds that want a feature of the device that nobody has switched on.
constexpr MemoryFlags kForbidden = Memory::eDeviceCoherentAMD | Memory::eDeviceUncachedAMD;

// Allocates from the first kind of memory with one of `wishes`, best first, that is not full: the part of a
// card's memory that the processor can access may be small.
vk::raii::DeviceMemory allocate(const GpuDevice& gpu, const vk::MemoryRequirements& needs,
                                std::initializer_list<MemoryFlags> wishes, bool* cached = nullptr) {
    std::exception_ptr full;
    for (const MemoryFlags wish : wishes) {
        for (std::uint32_t i = 0; i < gpu.memory.memoryTypeCount; ++i) {
            const MemoryFlags kind = gpu.memory.memoryTypes[i].propertyFlags;
            if ((needs.memoryTypeBits >> i & 1u) == 0 || (kind & wish) != wish || (kind & kForbidden))
                continue;
            try {
                if (cached != nullptr) *cached = bool(kind & Memory::eHostCached);
                return {gpu.device, vk::MemoryAllocateInfo(needs.size, i)};
            } catch (const vk::OutOfDeviceMemoryError&) {
                full = std::current_exception();
            }
        }
    }
    if (full) std::rethrow_exception(full);
    throw Error(ErrorCode::gpu, "the Vulkan device has no memory of the kind that is needed");
}

// Returns the kinds of memory for a buffer, best first; one that is only copied from need not be on the card.
std::initializer_list<MemoryFlags> wishes_for(HostAccess access, vk::BufferUsageFlags usage) {
    static constexpr MemoryFlags kSeen = Memory::eHostVisible | Memory::eHostCoherent;
    static constexpr std::initializer_list<MemoryFlags> kWrite{kSeen | Memory::eDeviceLocal, kSeen},
        kStage{kSeen}, kRead{kSeen | Memory::eHostCached, kSeen}, kNone{Memory::eDeviceLocal, MemoryFlags{}};
    if (access == HostAccess::read) return kRead;
    if (access == HostAccess::none) return kNone;
    return usage == vk::BufferUsageFlagBits::eTransferSrc ? kStage : kWrite;
}

vk::ImageSubresourceRange all_of(const GpuImage& image) {
    return {vk::ImageAspectFlagBits::eColor, 0, image.levels, 0, image.layers};
}

}  // namespace

GpuBuffer create_buffer(const GpuDevice& gpu, std::size_t bytes, vk::BufferUsageFlags usage,
                        HostAccess access) {
    GpuBuffer buffer;
    buffer.bytes = bytes;
    buffer.buffer = vk::raii::Buffer(gpu.device, vk::BufferCreateInfo({}, bytes, usage));
    const vk::MemoryRequirements needs = buffer.buffer.getMemoryRequirements();
    bool cached = false;
    buffer.memory = allocate(gpu, needs, wishes_for(access, usage), &cached);
    buffer.buffer.bindMemory(*buffer.memory, 0);
    if (access == HostAccess::none) return buffer;
    // A buffer for writing may be in a card's memory, which the processor reads uncached.
    buffer.readable = access == HostAccess::read || (gpu.unified_memory && cached);
    buffer.mapped = static_cast<std::byte*>(buffer.memory.mapMemory(0, VK_WHOLE_SIZE));
    return buffer;
}

void write(const GpuDevice& gpu, const GpuBuffer& buffer, std::span<const std::byte> bytes) {
    std::ranges::copy(bytes, buffer.mapped);
    gpu.uploaded_bytes += bytes.size();
}

void make_storage(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes, vk::BufferUsageFlags more) {
    constexpr vk::BufferUsageFlags kUsage = vk::BufferUsageFlagBits::eStorageBuffer |
                                            vk::BufferUsageFlagBits::eTransferSrc |
                                            vk::BufferUsageFlagBits::eTransferDst;
    buffer = {};  // the old one goes before the new one comes
    buffer = create_buffer(gpu, bytes, kUsage | more, HostAccess::none);
}

void reserve_storage(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes) {
    if (buffer.bytes < bytes) make_storage(gpu, buffer, bytes);
}

void upload_staged(const GpuDevice& gpu, const GpuBuffer& to, std::span<const std::byte> bytes) {
    if (bytes.empty()) return;
    const GpuBuffer staging =
        create_buffer(gpu, bytes.size(), vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
    write(gpu, staging, bytes);
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        full_barrier(commands);
        commands.copyBuffer(*staging.buffer, *to.buffer, vk::BufferCopy(0, 0, bytes.size()));
        full_barrier(commands);
    });
}

void download_staged(const GpuDevice& gpu, const GpuBuffer& from, std::span<std::byte> bytes) {
    if (bytes.empty()) return;
    const GpuBuffer staging =
        create_buffer(gpu, bytes.size(), vk::BufferUsageFlagBits::eTransferDst, HostAccess::read);
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        full_barrier(commands);
        commands.copyBuffer(*from.buffer, *staging.buffer, vk::BufferCopy(0, 0, bytes.size()));
        buffer_barrier(commands, staging, access::copy_to, access::host);
    });
    std::ranges::copy(std::span(staging.mapped, bytes.size()), bytes.begin());
}

void reserve_copy(const GpuDevice& gpu, GpuBuffer& copy, std::size_t bytes) {
    if (copy.bytes >= bytes) return;
    copy = {};
    copy = create_buffer(gpu, bytes, vk::BufferUsageFlagBits::eTransferDst, HostAccess::read);
}

const std::byte* read_back(const GpuDevice& gpu, const GpuBuffer& buffer, std::size_t bytes,
                           GpuBuffer& copy) {
    if (buffer.readable) return buffer.mapped;
    reserve_copy(gpu, copy, bytes);
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        buffer_barrier(commands, buffer, access::compute, access::copy_from);
        commands.copyBuffer(*buffer.buffer, *copy.buffer, vk::BufferCopy(0, 0, bytes));
        buffer_barrier(commands, copy, access::copy_to, access::host);
    });
    return copy.mapped;
}

GpuImage create_image(const GpuDevice& gpu, std::uint32_t width, std::uint32_t height, std::uint32_t layers,
                      vk::Format format, vk::ImageUsageFlags usage, std::uint32_t levels) {
    GpuImage image;
    image.format = format;
    image.width = width;
    image.height = height;
    image.layers = layers;
    image.levels = levels;
    image.image = vk::raii::Image(
        gpu.device,
        vk::ImageCreateInfo({}, vk::ImageType::e2D, format, vk::Extent3D(width, height, 1), levels, layers,
                            vk::SampleCountFlagBits::e1, vk::ImageTiling::eOptimal, usage));
    const vk::MemoryRequirements needs = image.image.getMemoryRequirements();
    image.memory = allocate(gpu, needs, {Memory::eDeviceLocal, MemoryFlags{}});
    image.image.bindMemory(*image.memory, 0);
    const vk::ImageViewType kind = layers > 1 ? vk::ImageViewType::e2DArray : vk::ImageViewType::e2D;
    image.view = vk::raii::ImageView(
        gpu.device, vk::ImageViewCreateInfo({}, *image.image, kind, format, {}, all_of(image)));
    return image;
}

namespace {

void barrier(const vk::raii::CommandBuffer& commands, const GpuImage& image, const GpuAccess& before,
             const GpuAccess& after, vk::ImageLayout old_layout) {
    const vk::ImageMemoryBarrier2 change(before.stages, before.kinds, after.stages, after.kinds, old_layout,
                                         vk::ImageLayout::eGeneral, VK_QUEUE_FAMILY_IGNORED,
                                         VK_QUEUE_FAMILY_IGNORED, *image.image, all_of(image));
    commands.pipelineBarrier2(vk::DependencyInfo().setImageMemoryBarriers(change));
}

}  // namespace

void begin_image(const vk::raii::CommandBuffer& commands, const GpuImage& image, const GpuAccess& after) {
    barrier(commands, image, {after.stages, {}}, after, vk::ImageLayout::eUndefined);
}

void image_barrier(const vk::raii::CommandBuffer& commands, const GpuImage& image, const GpuAccess& before,
                   const GpuAccess& after) {
    barrier(commands, image, before, after, vk::ImageLayout::eGeneral);
}

void buffer_barrier(const vk::raii::CommandBuffer& commands, const GpuBuffer& buffer, const GpuAccess& before,
                    const GpuAccess& after) {
    const vk::BufferMemoryBarrier2 change(before.stages, before.kinds, after.stages, after.kinds,
                                          VK_QUEUE_FAMILY_IGNORED, VK_QUEUE_FAMILY_IGNORED, *buffer.buffer, 0,
                                          VK_WHOLE_SIZE);
    commands.pipelineBarrier2(vk::DependencyInfo().setBufferMemoryBarriers(change));
}

void full_barrier(const vk::raii::CommandBuffer& commands) {
    const vk::MemoryBarrier2 change(vk::PipelineStageFlagBits2::eAllCommands,
                                    vk::AccessFlagBits2::eMemoryWrite,
                                    vk::PipelineStageFlagBits2::eAllCommands,
                                    vk::AccessFlagBits2::eMemoryRead | vk::AccessFlagBits2::eMemoryWrite);
    commands.pipelineBarrier2(vk::DependencyInfo().setMemoryBarriers(change));
}

void upload_image(const GpuDevice& gpu, const GpuImage& image, std::span<const std::byte> texels) {
    std::size_t texels_of_all = 0;
    for (std::uint32_t level = 0; level < image.levels; ++level)
        texels_of_all += std::size_t(image.width >> level) * (image.height >> level) * image.layers;
    const std::size_t texel_bytes = texels.size() / texels_of_all;
    std::vector<vk::BufferImageCopy> regions;
    std::size_t begin = 0;
    for (std::uint32_t level = 0; level < image.levels; ++level) {
        const std::uint32_t width = image.width >> level, height = image.height >> level;
        regions.push_back({begin,
                           0,
                           0,
                           {vk::ImageAspectFlagBits::eColor, level, 0, image.layers},
                           {0, 0, 0},
                           {width, height, 1}});
        begin += texel_bytes * width * height * image.layers;
    }
    const GpuBuffer staging =
        create_buffer(gpu, texels.size(), vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
    write(gpu, staging, texels);
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        full_barrier(commands);
        begin_image(commands, image, access::copy_to);
        commands.copyBufferToImage(*staging.buffer, *image.image, vk::ImageLayout::eGeneral, regions);
        image_barrier(commands, image, access::copy_to, access::sample);
    });
}

}  // namespace nephos
