// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/gpu_device.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <optional>
#include <span>

#include "core/error.h"
#include "render/shared/order.h"

namespace nephos {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";
constexpr const char* kInstall =
    "install a Vulkan driver: the packages libvulkan1 and mesa-vulkan-drivers bring one that needs no "
    "graphics card";

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT,
                                          VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
    auto* log = static_cast<ValidationLog*>(user);
    const std::scoped_lock lock(log->mutex);
    log->messages.emplace_back(data->pMessage);
    return VK_FALSE;
}

// No performance advice: it wants images to change layouts, and GENERAL is a choice here (gpu_resources.h).
vk::DebugUtilsMessengerCreateInfoEXT messenger_info(ValidationLog* log) {
    using Severity = vk::DebugUtilsMessageSeverityFlagBitsEXT;
    using Type = vk::DebugUtilsMessageTypeFlagBitsEXT;
    return {{}, Severity::eWarning | Severity::eError, Type::eValidation, on_message, log};
}

vk::raii::Context load_vulkan() {
    try {
        return vk::raii::Context();
    } catch (const std::runtime_error&) {
        throw Error(ErrorCode::gpu,
                    std::string("the Vulkan loader libvulkan.so.1 was not found; ") + kInstall);
    }
}

[[noreturn]] void fail_without_driver() {
    throw Error(ErrorCode::gpu, std::string("no Vulkan device; ") + kInstall);
}

vk::raii::Instance instance_from(const vk::raii::Context& context, const vk::InstanceCreateInfo& info) {
    try {
        return {context, info};
    } catch (const vk::IncompatibleDriverError&) {
        fail_without_driver();  // what the loader says when it finds no driver at all
    }
}

std::vector<vk::raii::PhysicalDevice> physical_devices(const vk::raii::Instance& instance) {
    try {
        return vk::raii::PhysicalDevices(instance);
    } catch (const vk::InitializationFailedError&) {
        fail_without_driver();  // drivers, but no device that one of them knows
    }
}

vk::raii::Instance create_instance(const vk::raii::Context& context, ValidationLog* log) {
    if (context.enumerateInstanceVersion() < VK_API_VERSION_1_3)
        throw Error(ErrorCode::gpu, "the Vulkan loader is older than version 1.3");
    const vk::ApplicationInfo application("nephos", 1, "nephos", 1, VK_API_VERSION_1_3);
    vk::InstanceCreateInfo info({}, &application);
    if (log == nullptr) return instance_from(context, info);

    const auto layers = context.enumerateInstanceLayerProperties();
    const bool present = std::ranges::any_of(
        layers, [](const auto& layer) { return std::strcmp(layer.layerName, kValidationLayer) == 0; });
    if (!present)
        throw Error(ErrorCode::gpu, std::string("no layer ") + kValidationLayer +
                                        ": install the package vulkan-validationlayers");
    constexpr const char* kLayers[] = {kValidationLayer};
    constexpr const char* kExtensions[] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME,
                                           VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
    info.setPEnabledLayerNames(kLayers).setPEnabledExtensionNames(kExtensions);
    const std::array enabled{vk::ValidationFeatureEnableEXT::eSynchronizationValidation};
    vk::ValidationFeaturesEXT features;
    features.setEnabledValidationFeatures(enabled);
    const vk::DebugUtilsMessengerCreateInfoEXT messages = messenger_info(log);
    features.pNext = &messages;  // hears what creating and destroying the instance says
    info.pNext = &features;
    return instance_from(context, info);
}

// Everything the renderer asks of a device; empty when it is all there.
std::string missing_abilities(const vk::raii::PhysicalDevice& physical) {
    if (physical.getProperties().apiVersion < VK_API_VERSION_1_3) return "Vulkan 1.3";
    const auto features =
        physical.getFeatures2<vk::PhysicalDeviceFeatures2, vk::PhysicalDeviceVulkan13Features>();
    const auto& v13 = features.get<vk::PhysicalDeviceVulkan13Features>();
    if (!v13.dynamicRendering || !v13.synchronization2) return "dynamic rendering and synchronization2";
    if (!features.get<vk::PhysicalDeviceFeatures2>().features.independentBlend) return "independent blending";
    using Feature = vk::FormatFeatureFlagBits;
    const auto lacks = [&](vk::Format format, vk::FormatFeatureFlags needed) {
        return (physical.getFormatProperties(format).optimalTilingFeatures & needed) != needed;
    };
    if (lacks(vk::Format::eR32G32B32A32Sfloat, Feature::eColorAttachmentBlend))
        return "blending of 32-bit colours";
    if (lacks(vk::Format::eR32Sfloat, Feature::eColorAttachmentBlend | Feature::eSampledImageFilterLinear))
        return "blending and filtering of 32-bit floats";
    if (lacks(vk::Format::eR32Sfloat, Feature::eStorageImage)) return "storage images of 32-bit floats";
    using Subgroup = vk::SubgroupFeatureFlagBits;
    const auto properties =
        physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceVulkan11Properties>();
    const auto& v11 = properties.get<vk::PhysicalDeviceVulkan11Properties>();
    const vk::SubgroupFeatureFlags needed = Subgroup::eBasic | Subgroup::eVote | Subgroup::eBallot;
    if ((v11.subgroupSupportedOperations & needed) != needed ||
        !(v11.subgroupSupportedStages & vk::ShaderStageFlagBits::eCompute))
        return "votes and ballots of subgroups in compute shaders";
    const vk::PhysicalDeviceLimits limits = physical.getProperties().limits;
    if (limits.maxComputeWorkGroupInvocations < shader::kSortGroup ||
        limits.maxComputeWorkGroupSize[0] < shader::kSortGroup)
        return "work groups of " + std::to_string(shader::kSortGroup);
    if (limits.maxPerStageDescriptorStorageBuffers < kMostStorageBuffers ||
        limits.maxDescriptorSetStorageBuffers < kMostStorageBuffers)
        return std::to_string(kMostStorageBuffers) + " storage buffers in a shader";
    return {};
}

std::optional<std::uint32_t> find_queue_family(const vk::raii::PhysicalDevice& physical) {
    const auto families = physical.getQueueFamilyProperties();
    const vk::QueueFlags needed = vk::QueueFlagBits::eGraphics | vk::QueueFlagBits::eCompute;
    for (std::uint32_t i = 0; i < families.size(); ++i)
        if ((families[i].queueFlags & needed) == needed) return i;
    return std::nullopt;
}

int preference(vk::PhysicalDeviceType type) {
    switch (type) {
        case vk::PhysicalDeviceType::eDiscreteGpu:
            return 4;
        case vk::PhysicalDeviceType::eIntegratedGpu:
            return 3;
        case vk::PhysicalDeviceType::eVirtualGpu:
            return 2;
        case vk::PhysicalDeviceType::eCpu:
            return 1;
        default:
            return 0;
    }
}

std::string name_of(const vk::raii::PhysicalDevice& physical) {
    return std::string(physical.getProperties().deviceName.data());
}

// True when `requested` is the device's number or, unless it is a number, a part of its name.
bool is_named(const std::string& requested, std::size_t number, const std::string& name) {
    if (requested.find_first_not_of("0123456789") == std::string::npos)
        return requested == std::to_string(number);
    return name.find(requested) != std::string::npos;
}

vk::raii::PhysicalDevice choose_device(const std::vector<vk::raii::PhysicalDevice>& devices,
                                       const std::string& requested) {
    if (devices.empty()) fail_without_driver();

    const vk::raii::PhysicalDevice* best = nullptr;
    bool named = requested.empty();
    std::string reasons;
    for (std::size_t i = 0; i < devices.size(); ++i) {
        const std::string name = name_of(devices[i]);
        if (!requested.empty() && !is_named(requested, i, name)) continue;
        named = true;
        const std::string missing = find_queue_family(devices[i]) ? missing_abilities(devices[i])
                                                                  : "a queue for graphics and compute";
        if (!missing.empty()) {
            reasons += "; " + name + " lacks " + missing;
        } else if (best == nullptr || preference(devices[i].getProperties().deviceType) >
                                          preference(best->getProperties().deviceType)) {
            best = &devices[i];
        }
    }
    if (!named) {
        std::string known;
        for (std::size_t i = 0; i < devices.size(); ++i)
            known += (i == 0 ? "" : ", ") + std::to_string(i) + " = " + name_of(devices[i]);
        throw Error(ErrorCode::usage, "no Vulkan device \"" + requested + "\"; there is " + known);
    }
    if (best == nullptr) throw Error(ErrorCode::gpu, "no usable Vulkan device" + reasons + "; " + kInstall);
    return *best;
}

vk::raii::Device create_device(const vk::raii::PhysicalDevice& physical, std::uint32_t queue_family) {
    constexpr float kPriority = 1.0f;
    const vk::DeviceQueueCreateInfo queue({}, queue_family, 1, &kPriority);
    vk::PhysicalDeviceVulkan13Features features;
    features.dynamicRendering = true;
    features.synchronization2 = true;
    features.subgroupSizeControl = true;
    features.maintenance4 = true;  // core, always there in 1.3; compute shaders name their group size its way
    vk::PhysicalDeviceFeatures core;
    core.independentBlend = true;  // pictures without depth leave the second attachment alone
    vk::DeviceCreateInfo info({}, queue);
    info.setPEnabledFeatures(&core).pNext = &features;
    return {physical, info};
}

void choose_tile_lanes(GpuDevice& gpu) {
    const auto chain =
        gpu.physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceVulkan11Properties,
                                    vk::PhysicalDeviceVulkan13Properties>();
    const auto& subgroup = chain.get<vk::PhysicalDeviceVulkan11Properties>();
    const auto& sizes = chain.get<vk::PhysicalDeviceVulkan13Properties>();
    const bool varies = sizes.minSubgroupSize != sizes.maxSubgroupSize;
    const bool can_ask = bool(sizes.requiredSubgroupSizeStages & vk::ShaderStageFlagBits::eCompute);
    const std::uint32_t size = subgroup.subgroupSize;
    gpu.tiles_are_subgroups = size >= 8 && size <= 128 && (!varies || can_ask);
    gpu.subgroup_size_varies = varies;
    gpu.tile_lanes = gpu.tiles_are_subgroups ? size : 8;
}

bool has_unified_memory(const vk::PhysicalDeviceMemoryProperties& memory) {
    using Memory = vk::MemoryPropertyFlagBits;
    const vk::MemoryPropertyFlags all =
        Memory::eDeviceLocal | Memory::eHostVisible | Memory::eHostCoherent | Memory::eHostCached;
    return std::ranges::any_of(std::span(memory.memoryTypes.data(), memory.memoryTypeCount),
                               [&](const vk::MemoryType& type) { return (type.propertyFlags & all) == all; });
}

// Keeps the drivers of graphics cards loaded from the first call on, as long as the process lives. They are unloaded with the
// last instance, and NVIDIA's finds no device any more, in no instance, when a process has loaded it about ten times. Where it
// fails, nothing is lost yet.
void keep_drivers_loaded() {
    struct Loaded {
        vk::raii::Context context = load_vulkan();
        vk::raii::Instance instance = create_instance(context, nullptr);
    };
    try {
        static const Loaded& loaded = *new Loaded;  // never destroyed: drivers may have gone before
        static_cast<void>(loaded);
    } catch (const std::exception&) {
    }
}

// Returns the devices of all drivers.
std::vector<vk::raii::PhysicalDevice> find_devices(const vk::raii::Instance& instance) {
    std::vector<vk::raii::PhysicalDevice> devices = physical_devices(instance);
    if (std::ranges::any_of(devices, [](const vk::raii::PhysicalDevice& each) {
            return each.getProperties().deviceType != vk::PhysicalDeviceType::eCpu;
        }))
        keep_drivers_loaded();
    return devices;
}

// Loads Vulkan and chooses a device, without opening it.
GpuDevice find_device(const DeviceOptions& options) {
    GpuDevice gpu{load_vulkan()};
    if (options.validation) gpu.log = std::make_unique<ValidationLog>();
    gpu.instance = create_instance(gpu.context, gpu.log.get());
    if (gpu.log != nullptr)
        gpu.messenger = vk::raii::DebugUtilsMessengerEXT(gpu.instance, messenger_info(gpu.log.get()));
    gpu.physical = choose_device(find_devices(gpu.instance), requested_device(options));
    gpu.properties = gpu.physical.getProperties();
    return gpu;
}

void open(GpuDevice& gpu) {
    gpu.memory = gpu.physical.getMemoryProperties();
    gpu.unified_memory = has_unified_memory(gpu.memory);
    gpu.queue_family = find_queue_family(gpu.physical).value();
    choose_tile_lanes(gpu);
    gpu.device = create_device(gpu.physical, gpu.queue_family);
    gpu.queue = vk::raii::Queue(gpu.device, gpu.queue_family, 0);
    gpu.pool = vk::raii::CommandPool(
        gpu.device, vk::CommandPoolCreateInfo(vk::CommandPoolCreateFlagBits::eTransient |
                                                  vk::CommandPoolCreateFlagBits::eResetCommandBuffer,
                                              gpu.queue_family));
}

}  // namespace

void fail_gpu(const std::string& what, vk::Result result) {
    throw Error(ErrorCode::gpu, what + ": the Vulkan device reported " + vk::to_string(result));
}

GpuDevice open_device(const DeviceOptions& options) {
    return with_gpu_errors("opening the device", [&] {
        GpuDevice gpu = find_device(options);
        open(gpu);
        return gpu;
    });
}

std::optional<GpuDevice> open_graphics_card(const DeviceOptions& options) {
    return with_gpu_errors("opening the device", [&]() -> std::optional<GpuDevice> {
        std::optional<GpuDevice> gpu;
        try {
            gpu = with_gpu_errors("looking for a device", [&] { return find_device(options); });
        } catch (const Error& error) {
            if (error.code() != ErrorCode::gpu || !requested_device(options).empty()) throw;
            return std::nullopt;
        }
        if (gpu->properties.deviceType == vk::PhysicalDeviceType::eCpu && requested_device(options).empty())
            return std::nullopt;
        open(*gpu);
        return gpu;
    });
}

void submit(const GpuDevice& gpu, const vk::raii::CommandBuffer& commands, const vk::raii::Fence& fence,
            const std::function<void()>& record) {
    commands.reset();
    commands.begin(vk::CommandBufferBeginInfo(vk::CommandBufferUsageFlagBits::eOneTimeSubmit));
    record();
    commands.end();
    gpu.device.resetFences(*fence);
    const vk::CommandBufferSubmitInfo command_info(*commands);
    vk::SubmitInfo2 info;
    info.setCommandBufferInfos(command_info);
    gpu.queue.submit2(info, *fence);
}

void submit_and_wait(const GpuDevice& gpu,
                     const std::function<void(const vk::raii::CommandBuffer&)>& record) {
    vk::raii::CommandBuffers buffers(
        gpu.device, vk::CommandBufferAllocateInfo(*gpu.pool, vk::CommandBufferLevel::ePrimary, 1));
    const vk::raii::CommandBuffer& commands = buffers.front();
    const vk::raii::Fence fence(gpu.device, vk::FenceCreateInfo());
    submit(gpu, commands, fence, [&] { record(commands); });
    const vk::Result result = gpu.device.waitForFences(*fence, VK_TRUE, UINT64_MAX);
    if (result != vk::Result::eSuccess) fail_gpu("waiting for the device", result);
}

std::vector<std::string> device_names() {
    return with_gpu_errors("listing the devices", [] {
        const vk::raii::Context context = load_vulkan();
        const vk::raii::Instance instance = create_instance(context, nullptr);
        std::vector<std::string> names;
        for (const auto& physical : find_devices(instance)) names.push_back(name_of(physical));
        return names;
    });
}

}  // namespace nephos
