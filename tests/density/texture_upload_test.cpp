// SPDX-License-Identifier: Apache-2.0
// BC4 volumes as a graphics device reads them: the bytes of a KTX 2 file are uploaded into a 3-D image, blitted to floats by
// the device's own decoder, and downloaded; all voxels of all levels are those of our decoder. Any Vulkan device will do,
// one without a graphics card too.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>
#include <vulkan/vulkan_raii.hpp>

#include "density/export/containers.h"
#include "density/export/volume.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

// A device with one queue, and what a test needs of it.
class Device {
  public:
    Device() {
        const vk::ApplicationInfo application("nephos tests", 1, nullptr, 0, VK_API_VERSION_1_1);
        instance_ = vk::raii::Instance(context_, vk::InstanceCreateInfo({}, &application));
        for (const vk::raii::PhysicalDevice& candidate : vk::raii::PhysicalDevices(instance_)) {
            if (!candidate.getFeatures().textureCompressionBC) continue;
            physical_ = candidate;
            break;
        }
        if (!*physical_)
            throw std::runtime_error("no Vulkan device takes BC4: is mesa-vulkan-drivers installed?");
        const float priority = 1;
        const vk::DeviceQueueCreateInfo queue({}, 0, 1, &priority);
        vk::PhysicalDeviceFeatures features;
        features.textureCompressionBC = true;
        vk::DeviceCreateInfo info({}, queue);
        info.pEnabledFeatures = &features;
        device_ = vk::raii::Device(physical_, info);
        queue_ = device_.getQueue(0, 0);
        pool_ = vk::raii::CommandPool(device_, vk::CommandPoolCreateInfo({}, 0));
    }

    struct Buffer {
        vk::raii::DeviceMemory memory{nullptr};
        vk::raii::Buffer buffer{nullptr};
        std::byte* mapped = nullptr;
    };
    struct Image {
        vk::raii::DeviceMemory memory{nullptr};
        vk::raii::Image image{nullptr};
    };

    Buffer buffer(std::size_t bytes, vk::BufferUsageFlags usage) {
        Buffer made;
        made.buffer = vk::raii::Buffer(device_, vk::BufferCreateInfo({}, bytes, usage));
        made.memory =
            allocate(made.buffer.getMemoryRequirements(),
                     vk::MemoryPropertyFlagBits::eHostVisible | vk::MemoryPropertyFlagBits::eHostCoherent);
        made.buffer.bindMemory(*made.memory, 0);
        made.mapped = static_cast<std::byte*>(made.memory.mapMemory(0, bytes));
        return made;
    }

    Image image(vk::Format format, const VolumeLevel& level, vk::ImageUsageFlags usage) {
        Image made;
        made.image = vk::raii::Image(
            device_, vk::ImageCreateInfo({}, vk::ImageType::e3D, format, extent_of(level), 1, 1,
                                         vk::SampleCountFlagBits::e1, vk::ImageTiling::eOptimal, usage));
        made.memory = allocate(made.image.getMemoryRequirements(), {});
        made.image.bindMemory(*made.memory, 0);
        return made;
    }

    template <class Record>
    void run(const Record& record) {
        const vk::raii::CommandBuffers buffers(
            device_, vk::CommandBufferAllocateInfo(*pool_, vk::CommandBufferLevel::ePrimary, 1));
        const vk::raii::CommandBuffer& commands = buffers.front();
        commands.begin(vk::CommandBufferBeginInfo(vk::CommandBufferUsageFlagBits::eOneTimeSubmit));
        record(commands);
        commands.end();
        const vk::CommandBuffer raw = *commands;
        queue_.submit(vk::SubmitInfo({}, {}, raw));
        queue_.waitIdle();
    }

    bool is_software() const { return physical_.getProperties().deviceType == vk::PhysicalDeviceType::eCpu; }

    static vk::Extent3D extent_of(const VolumeLevel& level) {
        return {std::uint32_t(level.nx), std::uint32_t(level.ny), std::uint32_t(level.nz)};
    }

  private:
    vk::raii::DeviceMemory allocate(const vk::MemoryRequirements& needs, vk::MemoryPropertyFlags wanted) {
        const vk::PhysicalDeviceMemoryProperties memory = physical_.getMemoryProperties();
        for (std::uint32_t n = 0; n < memory.memoryTypeCount; ++n) {
            if ((needs.memoryTypeBits >> n & 1) == 0 ||
                (memory.memoryTypes[n].propertyFlags & wanted) != wanted)
                continue;
            return vk::raii::DeviceMemory(device_, vk::MemoryAllocateInfo(needs.size, n));
        }
        throw std::runtime_error("no memory of this kind");
    }

    vk::raii::Context context_;
    vk::raii::Instance instance_{nullptr};
    vk::raii::PhysicalDevice physical_{nullptr};
    vk::raii::Device device_{nullptr};
    vk::raii::Queue queue_{nullptr};
    vk::raii::CommandPool pool_{nullptr};
};

constexpr vk::ImageSubresourceLayers kLayers{vk::ImageAspectFlagBits::eColor, 0, 0, 1};

void change_layout(const vk::raii::CommandBuffer& commands, const vk::raii::Image& image,
                   vk::ImageLayout from, vk::ImageLayout to) {
    const vk::ImageMemoryBarrier barrier(
        vk::AccessFlagBits::eTransferWrite,
        vk::AccessFlagBits::eTransferRead | vk::AccessFlagBits::eTransferWrite, from, to,
        VK_QUEUE_FAMILY_IGNORED, VK_QUEUE_FAMILY_IGNORED, *image,
        {vk::ImageAspectFlagBits::eColor, 0, 1, 0, 1});
    commands.pipelineBarrier(vk::PipelineStageFlagBits::eTransfer, vk::PipelineStageFlagBits::eTransfer, {},
                             {}, {}, barrier);
}

// Returns the voxels of a level as the device decodes them.
std::vector<float> read_back(Device& device, const VolumeLevel& level) {
    using Usage = vk::ImageUsageFlagBits;
    using Layout = vk::ImageLayout;
    const std::size_t voxels = std::size_t(level.nx) * std::size_t(level.ny) * std::size_t(level.nz);
    Device::Buffer up = device.buffer(level.bytes.size(), vk::BufferUsageFlagBits::eTransferSrc),
                   down = device.buffer(voxels * sizeof(float), vk::BufferUsageFlagBits::eTransferDst);
    std::memcpy(up.mapped, level.bytes.data(), level.bytes.size());
    const Device::Image blocks = device.image(vk::Format::eBc4UnormBlock, level,
                                              Usage::eTransferDst | Usage::eTransferSrc),
                        floats = device.image(vk::Format::eR32Sfloat, level,
                                              Usage::eTransferDst | Usage::eTransferSrc);
    device.run([&](const vk::raii::CommandBuffer& commands) {
        change_layout(commands, blocks.image, Layout::eUndefined, Layout::eTransferDstOptimal);
        change_layout(commands, floats.image, Layout::eUndefined, Layout::eTransferDstOptimal);
        const vk::Extent3D extent = Device::extent_of(level);
        commands.copyBufferToImage(*up.buffer, *blocks.image, Layout::eTransferDstOptimal,
                                   vk::BufferImageCopy(0, 0, 0, kLayers, {}, extent));
        change_layout(commands, blocks.image, Layout::eTransferDstOptimal, Layout::eTransferSrcOptimal);
        const std::array<vk::Offset3D, 2> box{vk::Offset3D{}, vk::Offset3D{level.nx, level.ny, level.nz}};
        commands.blitImage(*blocks.image, Layout::eTransferSrcOptimal, *floats.image,
                           Layout::eTransferDstOptimal, vk::ImageBlit(kLayers, box, kLayers, box),
                           vk::Filter::eNearest);
        change_layout(commands, floats.image, Layout::eTransferDstOptimal, Layout::eTransferSrcOptimal);
        commands.copyImageToBuffer(*floats.image, Layout::eTransferSrcOptimal, *down.buffer,
                                   vk::BufferImageCopy(0, 0, 0, kLayers, {}, extent));
    });
    std::vector<float> values(voxels);
    std::memcpy(values.data(), down.mapped, voxels * sizeof(float));
    return values;
}

TEST(TextureUpload, ADeviceDecodesEveryLevelAsWeDo) {
    // Not whole blocks in the last levels; smooth, with empty and full parts.
    Volume volume{24, 16, 12, {}};
    for (int k = 0; k < volume.nz; ++k)
        for (int j = 0; j < volume.ny; ++j)
            for (int i = 0; i < volume.nx; ++i)
                volume.values.push_back(
                    std::clamp(float(std::sin(0.5 * i) * std::cos(0.4 * j) + 0.1 * k - 0.3), 0.0f, 1.0f));
    EncodedVolume encoded{VoxelType::bc4, {}};
    for (Volume level = volume; encoded.levels.size() < 3; level = halved(level))
        encoded.levels.push_back({level.nx, level.ny, level.nz, encode(level, VoxelType::bc4, 1)});
    const TemporaryFolder folder;
    write_ktx2(folder.path() / "v.ktx2", encoded, "{}");
    Device device;
    // Devices interpolate between the ends of a block with few bits; an H200 is more than 2 levels off in some voxels.
    const float most = (device.is_software() ? 2.0f : 3.0f) / 255;
    std::size_t compared = 0;
    for (const VolumeLevel& level : read_ktx2(folder.path() / "v.ktx2").levels) {
        const Volume ours =
            decode(level.bytes.data(), level.bytes.size(), level.nx, level.ny, level.nz, VoxelType::bc4, 1);
        const std::vector<float> theirs = read_back(device, level);
        ASSERT_EQ(theirs.size(), ours.values.size());
        for (std::size_t n = 0; n < theirs.size(); ++n)
            ASSERT_NEAR(theirs[n], ours.values[n], most) << level.nx << " voxels wide, voxel " << n;
        compared += theirs.size();
    }
    EXPECT_EQ(compared, std::size_t(24 * 16 * 12 + 12 * 8 * 6 + 6 * 4 * 3));
}

}  // namespace
}  // namespace nephos
