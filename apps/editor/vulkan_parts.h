// SPDX-License-Identifier: Apache-2.0
#pragma once

// The parts of Vulkan that a window needs: device, swap chain, commands of a frame, and the picture of the clouds.
// For window.cpp alone. Functions throw vk::SystemError, or Error(gpu) where a user can help.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <vulkan/vulkan_raii.hpp>

#include "apps/editor/window.h"

struct GLFWwindow;

namespace nephos {

// Instance, surface and device.
struct Gpu {
    Gpu(GLFWwindow* window, const std::string& wanted_device, bool validation);
    std::vector<std::string> messages() const;
    std::uint32_t memory_type(std::uint32_t allowed, vk::MemoryPropertyFlags flags) const;

    struct Messages {
        mutable std::mutex mutex;
        std::vector<std::string> texts;
    };
    std::unique_ptr<Messages> log = std::make_unique<Messages>();
    vk::raii::Context context;
    vk::raii::Instance instance = nullptr;
    vk::raii::DebugUtilsMessengerEXT messenger = nullptr;
    vk::raii::SurfaceKHR surface = nullptr;
    vk::raii::PhysicalDevice physical = nullptr;
    std::uint32_t family = 0;
    std::string name;
    vk::raii::Device device = nullptr;
    vk::raii::Queue queue = nullptr;
    vk::raii::DescriptorPool descriptors = nullptr;

  private:
    void choose_device(const std::string& wanted);
};

// The images of the window.
struct SwapChain {
    explicit SwapChain(const Gpu& gpu);
    // Makes them anew for a size; the device must be idle.
    void create(vk::Extent2D size);
    // Returns the next image; none when the window changed, and then the chain is old.
    std::optional<std::uint32_t> acquire(vk::Semaphore acquired);
    void present(std::uint32_t index);
    vk::Semaphore drawn(std::uint32_t index) const { return *drawn_[index]; }
    bool is_bgr() const { return format.format == vk::Format::eB8G8R8A8Unorm; }

    const Gpu& gpu;
    vk::SurfaceFormatKHR format;
    vk::raii::RenderPass pass = nullptr;
    vk::raii::SwapchainKHR chain = nullptr;
    std::vector<vk::Image> images;
    std::vector<vk::raii::ImageView> views;
    std::vector<vk::raii::Framebuffer> framebuffers;
    vk::Extent2D extent;
    bool is_old = false;

  private:
    std::vector<vk::raii::Semaphore> drawn_;  // one an image
};

// Memory that the processor writes or reads.
struct HostBuffer {
    void create(const Gpu& gpu, std::size_t bytes, vk::BufferUsageFlags usage);
    vk::raii::DeviceMemory memory = nullptr;
    vk::raii::Buffer buffer = nullptr;
    void* mapped = nullptr;
    std::size_t size = 0;
};

// Commands of one frame: the next begins when the device has done with it.
struct FrameCommands {
    explicit FrameCommands(const Gpu& gpu);
    void wait();
    vk::CommandBuffer begin();
    void submit(vk::Semaphore drawn);
    void run_once(const std::function<void(vk::CommandBuffer)>& record);
    // Records a copy of an image of the window, which is presented afterwards.
    void copy_image(vk::CommandBuffer commands, vk::Image image, vk::Extent2D extent);
    WindowImage copied(vk::Extent2D extent, bool bgr) const;

    const Gpu& gpu;
    vk::raii::Semaphore acquired = nullptr;

  private:
    vk::raii::CommandPool pool_ = nullptr;
    vk::raii::CommandBuffer commands_ = nullptr;
    vk::raii::Fence done_ = nullptr;
    bool pending_ = false;
    HostBuffer copy_;
};

// The picture of the clouds, which is drawn below the interface: the back end of ImGui 1.86 knows one texture only, that
// of its fonts.
struct PictureImage {
    explicit PictureImage(const Gpu& from) : gpu(from) {}
    // Takes a picture; the device must not be drawing with the last one.
    void set(int width, int height, const unsigned char* rgba);
    void clear() { due_ = filled_ = false; }
    void upload(vk::CommandBuffer commands);
    // Fills an image of the window with a colour and puts the picture into a rectangle of it, scaled.
    void draw(vk::CommandBuffer commands, vk::Image to, vk::Extent2D extent, const vk::Rect2D& place,
              const std::array<float, 4>& colour);

    const Gpu& gpu;

  private:
    vk::raii::DeviceMemory memory_ = nullptr;
    vk::raii::Image image_ = nullptr;
    HostBuffer staging_;
    vk::Extent2D extent_;
    bool due_ = false, filled_ = false;
};

}  // namespace nephos
