// SPDX-License-Identifier: Apache-2.0
// A Vulkan layer for tests: a graphics card that is lost. It calls every device a virtual graphics card, so
// that pictures are drawn by shaders, and after NEPHOS_LOSE_DEVICE_AFTER submissions (all of the process)
// each further one fails with VK_ERROR_DEVICE_LOST. So do waits for fences after NEPHOS_LOSE_WAIT_AFTER of
// them, counted while that variable is there; what they wait for is done all the same. Submissions fail also from the
// moment on when the file NEPHOS_LOSE_DEVICE_WHEN is there. After NEPHOS_REFUSE_MEMORY_AFTER allocations of memory, counted
// while that variable is there, each further one fails with VK_ERROR_OUT_OF_DEVICE_MEMORY. With NEPHOS_SHOW_EVERY a window gets
// an image only each so many times that it asks for one, with 0 never; the other times VK_ERROR_OUT_OF_DATE_KHR, as while its size
// changes. For one instance and one device in one thread at a time.

#include <atomic>
#include <cstdlib>
#include <cstring>

#include <unistd.h>
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

namespace {

PFN_vkGetInstanceProcAddr next_of_instance = nullptr;
PFN_vkGetDeviceProcAddr next_of_device = nullptr;
PFN_vkGetPhysicalDeviceProperties next_properties = nullptr;
PFN_vkQueueSubmit2 next_submit = nullptr;
PFN_vkQueueSubmit next_old_submit = nullptr;
PFN_vkWaitForFences next_wait = nullptr;
PFN_vkAllocateMemory next_allocate = nullptr;
PFN_vkAcquireNextImageKHR next_acquire = nullptr;
std::atomic<long> submissions{0}, waits{0}, allocations{0}, images{0};

// What the loader hands to a layer in the chain of a create info.
template <typename Link, typename CreateInfo>
Link* link_of(const CreateInfo* info, VkStructureType type) {
    for (auto* at = static_cast<const VkBaseInStructure*>(info->pNext); at != nullptr; at = at->pNext) {
        auto* link = reinterpret_cast<Link*>(const_cast<VkBaseInStructure*>(at));
        if (at->sType == type && link->function == VK_LAYER_LINK_INFO) return link;
    }
    return nullptr;
}

VKAPI_ATTR void VKAPI_CALL properties(VkPhysicalDevice device, VkPhysicalDeviceProperties* result) {
    next_properties(device, result);
    result->deviceType = VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU;
}

bool is_lost() {
    const char* after = std::getenv("NEPHOS_LOSE_DEVICE_AFTER");
    const char* when = std::getenv("NEPHOS_LOSE_DEVICE_WHEN");
    return (after != nullptr && submissions++ >= std::atol(after)) || (when != nullptr && access(when, F_OK) == 0);
}

VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue queue, std::uint32_t count, const VkSubmitInfo2* infos,
                                      VkFence fence) {
    return is_lost() ? VK_ERROR_DEVICE_LOST : next_submit(queue, count, infos, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL old_submit(VkQueue queue, std::uint32_t count, const VkSubmitInfo* infos, VkFence fence) {
    return is_lost() ? VK_ERROR_DEVICE_LOST : next_old_submit(queue, count, infos, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL wait(VkDevice device, std::uint32_t count, const VkFence* fences, VkBool32 all,
                                    std::uint64_t timeout) {
    const VkResult result = next_wait(device, count, fences, all, timeout);
    const char* after = std::getenv("NEPHOS_LOSE_WAIT_AFTER");
    if (after == nullptr) waits = 0;
    return after != nullptr && waits++ >= std::atol(after) ? VK_ERROR_DEVICE_LOST : result;
}

VKAPI_ATTR VkResult VKAPI_CALL allocate(VkDevice device, const VkMemoryAllocateInfo* info,
                                        const VkAllocationCallbacks* allocator, VkDeviceMemory* memory) {
    const char* after = std::getenv("NEPHOS_REFUSE_MEMORY_AFTER");
    if (after == nullptr) allocations = 0;
    if (after != nullptr && allocations++ >= std::atol(after)) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    return next_allocate(device, info, allocator, memory);
}

VKAPI_ATTR VkResult VKAPI_CALL acquire(VkDevice device, VkSwapchainKHR chain, std::uint64_t timeout,
                                       VkSemaphore semaphore, VkFence fence, std::uint32_t* index) {
    const char* given = std::getenv("NEPHOS_SHOW_EVERY");
    const long every = given != nullptr ? std::atol(given) : 1;
    if (every == 0 || images++ % every != 0) return VK_ERROR_OUT_OF_DATE_KHR;
    return next_acquire(device, chain, timeout, semaphore, fence, index);
}

VKAPI_ATTR VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo* info,
                                               const VkAllocationCallbacks* allocator, VkInstance* instance) {
    auto* link = link_of<VkLayerInstanceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    if (link == nullptr) return VK_ERROR_INITIALIZATION_FAILED;
    next_of_instance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create = reinterpret_cast<PFN_vkCreateInstance>(next_of_instance(nullptr, "vkCreateInstance"));
    const VkResult result = create(info, allocator, instance);
    if (result == VK_SUCCESS)
        next_properties = reinterpret_cast<PFN_vkGetPhysicalDeviceProperties>(
            next_of_instance(*instance, "vkGetPhysicalDeviceProperties"));
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                             const VkAllocationCallbacks* allocator, VkDevice* device) {
    auto* link = link_of<VkLayerDeviceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    if (link == nullptr) return VK_ERROR_INITIALIZATION_FAILED;
    const PFN_vkGetInstanceProcAddr next = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    next_of_device = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create = reinterpret_cast<PFN_vkCreateDevice>(next(nullptr, "vkCreateDevice"));
    const VkResult result = create(physical, info, allocator, device);
    if (result != VK_SUCCESS) return result;
    next_submit = reinterpret_cast<PFN_vkQueueSubmit2>(next_of_device(*device, "vkQueueSubmit2"));
    next_old_submit = reinterpret_cast<PFN_vkQueueSubmit>(next_of_device(*device, "vkQueueSubmit"));
    next_wait = reinterpret_cast<PFN_vkWaitForFences>(next_of_device(*device, "vkWaitForFences"));
    next_allocate = reinterpret_cast<PFN_vkAllocateMemory>(next_of_device(*device, "vkAllocateMemory"));
    next_acquire =
        reinterpret_cast<PFN_vkAcquireNextImageKHR>(next_of_device(*device, "vkAcquireNextImageKHR"));
    return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_function(VkDevice device, const char* name) {
    if (std::strcmp(name, "vkGetDeviceProcAddr") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(&device_function);
    if (std::strcmp(name, "vkQueueSubmit2") == 0) return reinterpret_cast<PFN_vkVoidFunction>(&submit);
    if (std::strcmp(name, "vkQueueSubmit") == 0) return reinterpret_cast<PFN_vkVoidFunction>(&old_submit);
    if (std::strcmp(name, "vkWaitForFences") == 0) return reinterpret_cast<PFN_vkVoidFunction>(&wait);
    if (std::strcmp(name, "vkAllocateMemory") == 0) return reinterpret_cast<PFN_vkVoidFunction>(&allocate);
    if (std::strcmp(name, "vkAcquireNextImageKHR") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(&acquire);
    return next_of_device(device, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_function(VkInstance instance, const char* name) {
    const struct {
        const char* name;
        PFN_vkVoidFunction function;
    } own[] = {
        {"vkGetInstanceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(&instance_function)},
        {"vkGetDeviceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(&device_function)},
        {"vkCreateInstance", reinterpret_cast<PFN_vkVoidFunction>(&create_instance)},
        {"vkCreateDevice", reinterpret_cast<PFN_vkVoidFunction>(&create_device)},
        {"vkGetPhysicalDeviceProperties", reinterpret_cast<PFN_vkVoidFunction>(&properties)},
    };
    for (const auto& each : own)
        if (std::strcmp(name, each.name) == 0) return each.function;
    return next_of_instance != nullptr ? next_of_instance(instance, name) : nullptr;
}

}  // namespace

extern "C" VK_LAYER_EXPORT VkResult
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* interface) {
    interface->loaderLayerInterfaceVersion = 2;
    interface->pfnGetInstanceProcAddr = &instance_function;
    interface->pfnGetDeviceProcAddr = &device_function;
    interface->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
