// SPDX-License-Identifier: Apache-2.0
#define GLFW_INCLUDE_NONE
#include "apps/editor/vulkan_parts.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include <GLFW/glfw3.h>
#include <backends/imgui_impl_vulkan.h>

#include "core/error.h"

extern "C" VkResult glfwCreateWindowSurface(VkInstance instance, GLFWwindow* window,
                                            const VkAllocationCallbacks* with, VkSurfaceKHR* surface);

namespace nephos {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

VkBool32 VKAPI_PTR on_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                              const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
    auto& log = *static_cast<Gpu::Messages*>(user);
    const std::scoped_lock lock(log.mutex);
    log.texts.emplace_back(data->pMessage);
    return VK_FALSE;
}

// Discrete cards first, the processor last.
int preference(vk::PhysicalDeviceType type) {
    switch (type) {
        case vk::PhysicalDeviceType::eDiscreteGpu:
            return 0;
        case vk::PhysicalDeviceType::eIntegratedGpu:
            return 1;
        case vk::PhysicalDeviceType::eVirtualGpu:
            return 2;
        default:
            return 3;
    }
}

void barrier(vk::CommandBuffer commands, vk::Image image, vk::ImageLayout from, vk::ImageLayout to,
             vk::PipelineStageFlags before, vk::AccessFlags wrote, vk::PipelineStageFlags after,
             vk::AccessFlags use) {
    const vk::ImageMemoryBarrier change(wrote, use, from, to, VK_QUEUE_FAMILY_IGNORED,
                                        VK_QUEUE_FAMILY_IGNORED, image,
                                        {vk::ImageAspectFlagBits::eColor, 0, 1, 0, 1});
    commands.pipelineBarrier(before, after, {}, {}, {}, change);
}

vk::raii::DeviceMemory allocate(const Gpu& gpu, const vk::MemoryRequirements& needs,
                                vk::MemoryPropertyFlags flags) {
    return {gpu.device, {needs.size, gpu.memory_type(needs.memoryTypeBits, flags)}};
}

}  // namespace

Gpu::Gpu(GLFWwindow* window, const std::string& wanted_device, bool validation) {
    std::uint32_t count = 0;
    const char** needed = glfwGetRequiredInstanceExtensions(&count);
    if (needed == nullptr)
        throw Error(ErrorCode::gpu,
                    "no Vulkan driver that draws into windows: install mesa-vulkan-drivers, which also draws "
                    "without a "
                    "graphics card, or repair your card's");
    std::vector<const char*> extensions(needed, needed + count), layers;
    if (validation) {
        extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
        layers.push_back(kValidationLayer);
    }
    const vk::ApplicationInfo application("nephos", 1, "nephos", 1, VK_API_VERSION_1_1);
    try {
        instance = vk::raii::Instance(context, {{}, &application, layers, extensions});
    } catch (const vk::LayerNotPresentError&) {
        throw Error(ErrorCode::gpu, "the validation layer is not there: install vulkan-validationlayers");
    } catch (const vk::IncompatibleDriverError&) {
        throw Error(ErrorCode::gpu,
                    "no working Vulkan driver: install mesa-vulkan-drivers, or repair your card's");
    }
    if (validation) {
        using Severity = vk::DebugUtilsMessageSeverityFlagBitsEXT;
        using Type = vk::DebugUtilsMessageTypeFlagBitsEXT;
        messenger = vk::raii::DebugUtilsMessengerEXT(
            instance, {{}, Severity::eError | Severity::eWarning, Type::eValidation, &on_message, log.get()});
    }
    VkSurfaceKHR raw = VK_NULL_HANDLE;
    const VkResult made = glfwCreateWindowSurface(*instance, window, nullptr, &raw);
    if (made != VK_SUCCESS) {
        throw Error(ErrorCode::gpu, "no Vulkan surface for the window: " + vk::to_string(vk::Result(made)));
    }
    surface = vk::raii::SurfaceKHR(instance, raw);
    choose_device(wanted_device);
    const float priority = 1;
    const vk::DeviceQueueCreateInfo queues({}, family, 1, &priority);
    const std::vector<const char*> device_extensions{VK_KHR_SWAPCHAIN_EXTENSION_NAME};
    device = vk::raii::Device(physical, {{}, queues, {}, device_extensions});
    queue = vk::raii::Queue(device, family, 0);
    const vk::DescriptorPoolSize pool(vk::DescriptorType::eCombinedImageSampler, 16);
    descriptors =
        vk::raii::DescriptorPool(device, {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 16, pool});
}

void Gpu::choose_device(const std::string& wanted) {
    std::vector<vk::raii::PhysicalDevice> found;
    try {
        for (auto& candidate : vk::raii::PhysicalDevices(instance)) found.push_back(std::move(candidate));
    } catch (const vk::SystemError& error) {
        throw Error(ErrorCode::gpu, std::string("no working Vulkan driver: ") + error.what() +
                                        "; install mesa-vulkan-drivers, or repair your card's");
    }
    std::ranges::stable_sort(found, {}, [](const vk::raii::PhysicalDevice& device_) {
        return preference(device_.getProperties().deviceType);
    });
    std::string names;
    for (const vk::raii::PhysicalDevice& candidate : found) {
        const std::string candidate_name = candidate.getProperties().deviceName;
        names += (names.empty() ? "" : ", ") + candidate_name;
        if (candidate_name.find(wanted) == std::string::npos) continue;
        const auto families = candidate.getQueueFamilyProperties();
        for (std::uint32_t n = 0; n < families.size(); ++n) {
            const bool draws = bool(families[n].queueFlags & vk::QueueFlagBits::eGraphics);
            if (!draws || candidate.getSurfaceSupportKHR(n, *surface) != VK_TRUE) continue;
            physical = candidate;
            family = n;
            name = candidate_name;
            return;
        }
    }
    if (found.empty()) {
        throw Error(ErrorCode::gpu,
                    "no Vulkan device: install mesa-vulkan-drivers, which also draws without a card");
    }
    throw Error(ErrorCode::gpu,
                "no Vulkan device '" + wanted + "' that draws into windows; there is " + names);
}

std::vector<std::string> Gpu::messages() const {
    const std::scoped_lock lock(log->mutex);
    return log->texts;
}

std::uint32_t Gpu::memory_type(std::uint32_t allowed, vk::MemoryPropertyFlags flags) const {
    const vk::PhysicalDeviceMemoryProperties memory = physical.getMemoryProperties();
    for (std::uint32_t n = 0; n < memory.memoryTypeCount; ++n) {
        if ((allowed >> n & 1u) != 0 && (memory.memoryTypes[n].propertyFlags & flags) == flags) return n;
    }
    throw Error(ErrorCode::gpu, name + " has no memory of the kind that a window needs");
}

SwapChain::SwapChain(const Gpu& from) : gpu(from) {
    const std::vector<vk::SurfaceFormatKHR> formats = gpu.physical.getSurfaceFormatsKHR(*gpu.surface);
    format = formats.front();
    for (const vk::Format wanted : {vk::Format::eR8G8B8A8Unorm, vk::Format::eB8G8R8A8Unorm}) {
        for (const vk::SurfaceFormatKHR& candidate : formats) {
            if (candidate.format == wanted) format = candidate;
        }
    }
    const vk::AttachmentDescription colour(
        {}, format.format, vk::SampleCountFlagBits::e1, vk::AttachmentLoadOp::eLoad,
        vk::AttachmentStoreOp::eStore, vk::AttachmentLoadOp::eDontCare, vk::AttachmentStoreOp::eDontCare,
        vk::ImageLayout::eColorAttachmentOptimal, vk::ImageLayout::ePresentSrcKHR);
    const vk::AttachmentReference reference(0, vk::ImageLayout::eColorAttachmentOptimal);
    const vk::SubpassDescription subpass({}, vk::PipelineBindPoint::eGraphics, {}, reference);
    const auto output = vk::PipelineStageFlagBits::eColorAttachmentOutput;
    const vk::SubpassDependency acquired(VK_SUBPASS_EXTERNAL, 0, output, output, {},
                                         vk::AccessFlagBits::eColorAttachmentWrite);
    const vk::SubpassDependency copied(0, VK_SUBPASS_EXTERNAL, output, vk::PipelineStageFlagBits::eTransfer,
                                       vk::AccessFlagBits::eColorAttachmentWrite,
                                       vk::AccessFlagBits::eTransferRead);
    const std::array dependencies{acquired, copied};
    pass = vk::raii::RenderPass(gpu.device, vk::RenderPassCreateInfo({}, colour, subpass, dependencies));
}

void SwapChain::create(vk::Extent2D size) {
    const vk::SurfaceCapabilitiesKHR can = gpu.physical.getSurfaceCapabilitiesKHR(*gpu.surface);
    extent = can.currentExtent;
    if (extent.width == std::numeric_limits<std::uint32_t>::max()) extent = size;
    extent.width = std::max(1u, std::clamp(extent.width, can.minImageExtent.width, can.maxImageExtent.width));
    extent.height =
        std::max(1u, std::clamp(extent.height, can.minImageExtent.height, can.maxImageExtent.height));
    const vk::ImageUsageFlags copies =
        vk::ImageUsageFlagBits::eTransferSrc | vk::ImageUsageFlagBits::eTransferDst;
    if ((can.supportedUsageFlags & copies) != copies) {
        throw Error(ErrorCode::gpu, gpu.name + " cannot copy the images of a window");
    }
    std::uint32_t count = std::max(2u, can.minImageCount);
    if (can.maxImageCount > 0) count = std::min(count, can.maxImageCount);
    framebuffers.clear();
    views.clear();
    vk::SwapchainCreateInfoKHR info({}, *gpu.surface, count, format.format, format.colorSpace, extent, 1,
                                    vk::ImageUsageFlagBits::eColorAttachment |
                                        vk::ImageUsageFlagBits::eTransferSrc |
                                        vk::ImageUsageFlagBits::eTransferDst);
    info.preTransform = can.currentTransform;
    info.compositeAlpha = vk::CompositeAlphaFlagBitsKHR::eOpaque;
    if (!(can.supportedCompositeAlpha & vk::CompositeAlphaFlagBitsKHR::eOpaque)) {
        info.compositeAlpha = vk::CompositeAlphaFlagBitsKHR::eInherit;
    }
    info.presentMode = vk::PresentModeKHR::eFifo;
    info.clipped = VK_TRUE;
    info.oldSwapchain = *chain;
    vk::raii::SwapchainKHR made(gpu.device, info);
    chain = std::move(made);
    images.clear();
    drawn_.clear();
    for (const VkImage image : chain.getImages()) {
        images.emplace_back(image);
        const vk::ImageViewCreateInfo view({}, image, vk::ImageViewType::e2D, format.format, {},
                                           {vk::ImageAspectFlagBits::eColor, 0, 1, 0, 1});
        views.emplace_back(gpu.device, view);
        framebuffers.emplace_back(
            gpu.device, vk::FramebufferCreateInfo({}, *pass, *views.back(), extent.width, extent.height, 1));
        drawn_.emplace_back(gpu.device, vk::SemaphoreCreateInfo());
    }
    is_old = false;
}

std::optional<std::uint32_t> SwapChain::acquire(vk::Semaphore acquired) {
    try {
        const auto [result, index] = chain.acquireNextImage(2'000'000'000, acquired);
        if (result == vk::Result::eSuboptimalKHR) is_old = true;
        if (result != vk::Result::eSuccess && result != vk::Result::eSuboptimalKHR) return std::nullopt;
        return index;
    } catch (const vk::OutOfDateKHRError&) {
        is_old = true;
        return std::nullopt;
    }
}

void SwapChain::present(std::uint32_t index) {
    const vk::Semaphore ready = drawn(index);
    try {
        const vk::Result result = gpu.queue.presentKHR({ready, *chain, index});
        if (result == vk::Result::eSuboptimalKHR) is_old = true;
    } catch (const vk::OutOfDateKHRError&) {
        is_old = true;
    }
}

void HostBuffer::create(const Gpu& gpu, std::size_t bytes, vk::BufferUsageFlags usage) {
    if (size >= bytes) return;
    buffer = vk::raii::Buffer(gpu.device, {{}, bytes, usage});
    memory = allocate(gpu, buffer.getMemoryRequirements(),
                      vk::MemoryPropertyFlagBits::eHostVisible | vk::MemoryPropertyFlagBits::eHostCoherent);
    buffer.bindMemory(*memory, 0);
    mapped = memory.mapMemory(0, bytes);
    size = bytes;
}

FrameCommands::FrameCommands(const Gpu& from) : gpu(from) {
    pool_ =
        vk::raii::CommandPool(gpu.device, {vk::CommandPoolCreateFlagBits::eResetCommandBuffer, gpu.family});
    commands_ = std::move(
        vk::raii::CommandBuffers(gpu.device, {*pool_, vk::CommandBufferLevel::ePrimary, 1}).front());
    done_ = vk::raii::Fence(gpu.device, vk::FenceCreateInfo());
    acquired = vk::raii::Semaphore(gpu.device, vk::SemaphoreCreateInfo());
}

void FrameCommands::wait() {
    if (!pending_) return;
    if (gpu.device.waitForFences(*done_, VK_TRUE, 10'000'000'000) != vk::Result::eSuccess) {
        throw Error(ErrorCode::gpu, gpu.name + " does not answer");
    }
    gpu.device.resetFences(*done_);
    pending_ = false;
}

vk::CommandBuffer FrameCommands::begin() {
    commands_.reset();
    commands_.begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
    return *commands_;
}

void FrameCommands::submit(vk::Semaphore drawn) {
    commands_.end();
    const vk::PipelineStageFlags stage =
        vk::PipelineStageFlagBits::eColorAttachmentOutput | vk::PipelineStageFlagBits::eTransfer;
    gpu.queue.submit(vk::SubmitInfo(*acquired, stage, *commands_, drawn), *done_);
    pending_ = true;
}

void FrameCommands::run_once(const std::function<void(vk::CommandBuffer)>& record) {
    wait();
    record(begin());
    commands_.end();
    gpu.queue.submit(vk::SubmitInfo({}, {}, *commands_), *done_);
    pending_ = true;
    wait();
}

void FrameCommands::copy_image(vk::CommandBuffer commands, vk::Image image, vk::Extent2D extent) {
    copy_.create(gpu, std::size_t(4) * extent.width * extent.height, vk::BufferUsageFlagBits::eTransferDst);
    using Stage = vk::PipelineStageFlagBits;
    using Access = vk::AccessFlagBits;
    barrier(commands, image, vk::ImageLayout::ePresentSrcKHR, vk::ImageLayout::eTransferSrcOptimal,
            Stage::eColorAttachmentOutput | Stage::eTransfer, Access::eColorAttachmentWrite, Stage::eTransfer,
            Access::eTransferRead);
    const vk::BufferImageCopy region(0, 0, 0, {vk::ImageAspectFlagBits::eColor, 0, 0, 1}, {0, 0, 0},
                                     {extent.width, extent.height, 1});
    commands.copyImageToBuffer(image, vk::ImageLayout::eTransferSrcOptimal, *copy_.buffer, region);
    barrier(commands, image, vk::ImageLayout::eTransferSrcOptimal, vk::ImageLayout::ePresentSrcKHR,
            Stage::eTransfer, Access::eTransferRead, Stage::eBottomOfPipe, {});
    const vk::MemoryBarrier readable(Access::eTransferWrite, Access::eHostRead);
    commands.pipelineBarrier(Stage::eTransfer, Stage::eHost, {}, readable, {}, {});
}

WindowImage FrameCommands::copied(vk::Extent2D extent, bool bgr) const {
    WindowImage out{int(extent.width), int(extent.height), {}};
    const auto* bytes = static_cast<const unsigned char*>(copy_.mapped);
    out.rgba.assign(bytes, bytes + std::size_t(4) * extent.width * extent.height);
    for (std::size_t at = 0; at < out.rgba.size(); at += 4) {
        if (bgr) std::swap(out.rgba[at], out.rgba[at + 2]);
        out.rgba[at + 3] = 255;
    }
    return out;
}

void PictureImage::set(int width, int height, const unsigned char* rgba) {
    const vk::Extent2D size{std::uint32_t(width), std::uint32_t(height)};
    const std::size_t bytes = std::size_t(4) * size.width * size.height;
    staging_.create(gpu, bytes, vk::BufferUsageFlagBits::eTransferSrc);
    std::memcpy(staging_.mapped, rgba, bytes);
    due_ = true;
    if (size == extent_) return;
    const vk::ImageCreateInfo info(
        {}, vk::ImageType::e2D, vk::Format::eR8G8B8A8Unorm, vk::Extent3D(size.width, size.height, 1), 1, 1,
        vk::SampleCountFlagBits::e1, vk::ImageTiling::eOptimal,
        vk::ImageUsageFlagBits::eTransferSrc | vk::ImageUsageFlagBits::eTransferDst);
    image_ = vk::raii::Image(gpu.device, info);
    memory_ = allocate(gpu, image_.getMemoryRequirements(), vk::MemoryPropertyFlagBits::eDeviceLocal);
    image_.bindMemory(*memory_, 0);
    extent_ = size;
}

void PictureImage::upload(vk::CommandBuffer commands) {
    if (!due_) return;
    due_ = false;
    filled_ = true;
    using Stage = vk::PipelineStageFlagBits;
    using Access = vk::AccessFlagBits;
    barrier(commands, *image_, vk::ImageLayout::eUndefined, vk::ImageLayout::eTransferDstOptimal,
            Stage::eTransfer, {}, Stage::eTransfer, Access::eTransferWrite);
    const vk::BufferImageCopy region(0, 0, 0, {vk::ImageAspectFlagBits::eColor, 0, 0, 1}, {0, 0, 0},
                                     {extent_.width, extent_.height, 1});
    commands.copyBufferToImage(*staging_.buffer, *image_, vk::ImageLayout::eTransferDstOptimal, region);
    barrier(commands, *image_, vk::ImageLayout::eTransferDstOptimal, vk::ImageLayout::eTransferSrcOptimal,
            Stage::eTransfer, Access::eTransferWrite, Stage::eTransfer, Access::eTransferRead);
}

void PictureImage::draw(vk::CommandBuffer commands, vk::Image to, vk::Extent2D extent,
                        const vk::Rect2D& place, const std::array<float, 4>& colour) {
    using Stage = vk::PipelineStageFlagBits;
    using Access = vk::AccessFlagBits;
    barrier(commands, to, vk::ImageLayout::eUndefined, vk::ImageLayout::eTransferDstOptimal,
            Stage::eColorAttachmentOutput | Stage::eTransfer, {}, Stage::eTransfer, Access::eTransferWrite);
    commands.clearColorImage(to, vk::ImageLayout::eTransferDstOptimal, vk::ClearColorValue(colour),
                             vk::ImageSubresourceRange(vk::ImageAspectFlagBits::eColor, 0, 1, 0, 1));
    const std::int32_t right = std::min(place.offset.x + std::int32_t(place.extent.width),
                                        std::int32_t(extent.width)),
                       bottom = std::min(place.offset.y + std::int32_t(place.extent.height),
                                         std::int32_t(extent.height));
    const bool seen =
        place.offset.x >= 0 && place.offset.y >= 0 && right > place.offset.x && bottom > place.offset.y;
    if (filled_ && seen) {
        barrier(commands, to, vk::ImageLayout::eTransferDstOptimal, vk::ImageLayout::eTransferDstOptimal,
                Stage::eTransfer, Access::eTransferWrite, Stage::eTransfer, Access::eTransferWrite);
        const vk::ImageSubresourceLayers layer(vk::ImageAspectFlagBits::eColor, 0, 0, 1);
        const std::array from{vk::Offset3D(0, 0, 0),
                              vk::Offset3D(std::int32_t(extent_.width), std::int32_t(extent_.height), 1)};
        const std::array into{vk::Offset3D(place.offset.x, place.offset.y, 0),
                              vk::Offset3D(right, bottom, 1)};
        commands.blitImage(*image_, vk::ImageLayout::eTransferSrcOptimal, to,
                           vk::ImageLayout::eTransferDstOptimal, vk::ImageBlit(layer, from, layer, into),
                           vk::Filter::eLinear);
    }
    barrier(commands, to, vk::ImageLayout::eTransferDstOptimal, vk::ImageLayout::eColorAttachmentOptimal,
            Stage::eTransfer, Access::eTransferWrite, Stage::eColorAttachmentOutput,
            Access::eColorAttachmentRead | Access::eColorAttachmentWrite);
}

}  // namespace nephos
