// SPDX-License-Identifier: Apache-2.0
#pragma once

// One Vulkan 1.3 device with one queue for graphics and compute, and the way failures become Error(gpu).
// Private to the module: this header costs three seconds of compile time and is included by .cpp files only.

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <vulkan/vulkan_raii.hpp>

#include "render/options/device_options.h"

namespace nephos {

// Storage buffers that a shader reads and writes at most.
inline constexpr std::uint32_t kMostStorageBuffers = 14;

// Messages of the validation layer, from any thread.
struct ValidationLog {
    mutable std::mutex mutex;
    std::vector<std::string> messages;
};

// Members are destroyed from the last to the first: the loader goes last. Movable; everything else keeps
// references to handles, not to this struct.
struct GpuDevice {
    explicit GpuDevice(vk::raii::Context loader) : context(std::move(loader)) {}

    vk::raii::Context context;
    std::unique_ptr<ValidationLog> log;
    vk::raii::Instance instance{nullptr};
    vk::raii::DebugUtilsMessengerEXT messenger{nullptr};
    vk::raii::PhysicalDevice physical{nullptr};
    vk::PhysicalDeviceProperties properties;
    vk::PhysicalDeviceMemoryProperties memory;
    vk::raii::Device device{nullptr};
    std::uint32_t queue_family = 0;
    // Invocations that draw a tile (render/gpu/tiles.glsl): one whole subgroup where the device has ones
    // of 8 to 128.
    std::uint32_t tile_lanes = 8;
    bool tiles_are_subgroups = false;
    bool subgroup_size_varies = false;  // and must be asked for
    // The processor reads the device's own memory as fast as any: nothing has to be copied from there.
    bool unified_memory = false;
    mutable std::uint64_t uploaded_bytes = 0;  // so far, with write() of gpu_resources.h
    vk::raii::Queue queue{nullptr};
    vk::raii::CommandPool pool{nullptr};
};

// Throws Error(gpu) when there is no loader, no device, or none that can do what the renderer needs.
GpuDevice open_device(const DeviceOptions& options);
// Opens the same device unless it is of type CPU and not requested by name; and none, without an error, where there is no loader or no
// usable device and neither the options nor NEPHOS_DEVICE ask for one by name.
std::optional<GpuDevice> open_graphics_card(const DeviceOptions& options);

// Records `commands` anew with `record` and submits them; resets `fence`, which is signalled when they are done.
void submit(const GpuDevice& gpu, const vk::raii::CommandBuffer& commands, const vk::raii::Fence& fence,
            const std::function<void()>& record);
// Records commands with `record`, submits them and waits until they are done.
void submit_and_wait(const GpuDevice& gpu, const std::function<void(const vk::raii::CommandBuffer&)>& record);

[[noreturn]] void fail_gpu(const std::string& what, vk::Result result);

// Runs `work`; a Vulkan failure in it becomes Error(gpu) "what: VkResult".
template <class Work>
decltype(auto) with_gpu_errors(const char* what, Work&& work) {
    try {
        return std::forward<Work>(work)();
    } catch (const vk::SystemError& error) {
        fail_gpu(what, vk::Result(error.code().value()));
    }
}

}  // namespace nephos
