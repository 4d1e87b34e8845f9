// SPDX-License-Identifier: Apache-2.0
#pragma once

// Buffers, images and the three barriers. Plain structs that own their handles. Private to the module.

#include <cstddef>
#include <span>

#include "render/gpu/gpu_device.h"

namespace nephos {

// A buffer. Where the processor sees its memory, it is mapped as long as it lives.
struct GpuBuffer {
    vk::raii::DeviceMemory memory{nullptr};
    vk::raii::Buffer buffer{nullptr};
    std::byte* mapped = nullptr;
    bool readable = false;  // mapped, and the processor reads it as fast as any memory
    std::size_t bytes = 0;
};

enum class HostAccess {
    write,
    read,
    none
};  // what the processor does with a buffer: decides the kind of memory

GpuBuffer create_buffer(const GpuDevice& gpu, std::size_t bytes, vk::BufferUsageFlags usage,
                        HostAccess access);

// Copies into a mapped buffer that is as large at least.
void write(const GpuDevice& gpu, const GpuBuffer& buffer, std::span<const std::byte> bytes);
template <class T>
void write(const GpuDevice& gpu, const GpuBuffer& buffer, const T& value) {
    write(gpu, buffer, std::as_bytes(std::span(&value, 1)));
}

// Replaces a buffer by a storage buffer in the device's own memory, which can be copied into and from; `more`: its
// other usages.
void make_storage(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes, vk::BufferUsageFlags more = {});
// The same, if it is not at least so large.
void reserve_storage(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes);
// Copy into such a buffer, after all that was submitted before, and from it; wait until that is done.
void upload_staged(const GpuDevice& gpu, const GpuBuffer& to, std::span<const std::byte> bytes);
void download_staged(const GpuDevice& gpu, const GpuBuffer& from, std::span<std::byte> bytes);

// Makes a buffer at least so large that is copied into on the device and read by the processor; its content
// is lost when it grows.
void reserve_copy(const GpuDevice& gpu, GpuBuffer& copy, std::size_t bytes);

// Returns the first bytes of a buffer that the device has written: itself where it is readable, else `copy`,
// which grows; then the buffer must allow to be copied from.
const std::byte* read_back(const GpuDevice& gpu, const GpuBuffer& buffer, std::size_t bytes, GpuBuffer& copy);

// A 2D image (or array of them) in device memory, always in the layout GENERAL once it was cleared: images
// here are in turn drawn to, sampled and copied from, and GENERAL serves all of it.
struct GpuImage {
    vk::raii::DeviceMemory memory{nullptr};
    vk::raii::Image image{nullptr};
    vk::raii::ImageView view{nullptr};
    vk::Format format = vk::Format::eUndefined;
    std::uint32_t width = 0, height = 0, layers = 1, levels = 1;
};

GpuImage create_image(const GpuDevice& gpu, std::uint32_t width, std::uint32_t height, std::uint32_t layers,
                      vk::Format format, vk::ImageUsageFlags usage, std::uint32_t levels = 1);

// One side of a dependency.
struct GpuAccess {
    vk::PipelineStageFlags2 stages;
    vk::AccessFlags2 kinds;
};

namespace access {
inline constexpr GpuAccess none{vk::PipelineStageFlagBits2::eNone, {}};
inline constexpr GpuAccess draw{
    vk::PipelineStageFlagBits2::eColorAttachmentOutput,
    vk::AccessFlagBits2::eColorAttachmentRead | vk::AccessFlagBits2::eColorAttachmentWrite};
inline constexpr GpuAccess sample{vk::PipelineStageFlagBits2::eVertexShader |
                                      vk::PipelineStageFlagBits2::eFragmentShader |
                                      vk::PipelineStageFlagBits2::eComputeShader,
                                  vk::AccessFlagBits2::eShaderSampledRead};
inline constexpr GpuAccess copy_from{vk::PipelineStageFlagBits2::eCopy, vk::AccessFlagBits2::eTransferRead};
inline constexpr GpuAccess copy_to{vk::PipelineStageFlagBits2::eCopy, vk::AccessFlagBits2::eTransferWrite};
inline constexpr GpuAccess compute{
    vk::PipelineStageFlagBits2::eComputeShader,
    vk::AccessFlagBits2::eShaderStorageRead | vk::AccessFlagBits2::eShaderStorageWrite};
inline constexpr GpuAccess host{vk::PipelineStageFlagBits2::eHost, vk::AccessFlagBits2::eHostRead};
}  // namespace access

// Transitions an image from UNDEFINED to GENERAL and discards its content.
void begin_image(const vk::raii::CommandBuffer& commands, const GpuImage& image, const GpuAccess& after);
// Makes the accesses `before` to an image complete and visible to those `after`.
void image_barrier(const vk::raii::CommandBuffer& commands, const GpuImage& image, const GpuAccess& before,
                   const GpuAccess& after);
void buffer_barrier(const vk::raii::CommandBuffer& commands, const GpuBuffer& buffer, const GpuAccess& before,
                    const GpuAccess& after);
// Replaces the content of an image by texels, tightly packed, first of all layers of level 0, then of level 1, and so on;
// waits until shaders can sample it.
void upload_image(const GpuDevice& gpu, const GpuImage& image, std::span<const std::byte> texels);
// Makes all memory accesses of earlier commands complete and visible to later ones.
void full_barrier(const vk::raii::CommandBuffer& commands);

}  // namespace nephos
