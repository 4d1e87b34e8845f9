// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/window.h"

#define GLFW_INCLUDE_NONE
#define GLFW_INCLUDE_VULKAN
#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_vulkan.h>
#include <dlfcn.h>

#include "apps/editor/field_text.h"
#include "apps/editor/vulkan_parts.h"
#include "core/digest.h"
#include "core/error.h"

namespace nephos {
namespace {

// GLFW says what went wrong by a callback.
std::string glfw_problem;
void on_glfw_error(int, const char* description) { glfw_problem = description; }

struct Glfw {
    Glfw() {
        glfwSetErrorCallback(&on_glfw_error);
        if (glfwInit() != GLFW_TRUE) {
            throw Error(ErrorCode::gpu, "no window can be opened: " + glfw_problem +
                                            " (is DISPLAY set? without a screen: xvfb-run nephos edit ...)");
        }
        if (glfwVulkanSupported() != GLFW_TRUE) {
            glfwTerminate();
            throw Error(
                ErrorCode::gpu,
                "no Vulkan loader, or no driver that draws into windows: install mesa-vulkan-drivers, which "
                "also draws without a graphics card");
        }
    }
    ~Glfw() { glfwTerminate(); }
    Glfw(const Glfw&) = delete;
    Glfw& operator=(const Glfw&) = delete;
};

template <typename Function>
Function* symbol(const char* name) {
    return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

// Keeps what edits there are when the X server goes away, which Xlib ends the program for.
std::function<void()> when_lost;

int on_lost_display(void*) {
    try {
        if (const std::function<void()> then = std::exchange(when_lost, {})) then();
    } catch (const std::exception&) {  // Xlib called, and the program ends
    }
    std::_Exit(int(ErrorCode::gpu));
}

// An error that the X server answers with, as <X11/Xlib.h> has it.
struct XError {
    int type;
    void* display;
    unsigned long resource, serial;
    unsigned char code, request, minor;
};

unsigned long own_window = 0;  // by its number in the X server

// Xlib would end the program for any of them. A window that is gone is one that another program has destroyed; what else is
// refused (a selection that another window asked for and closed, say) is no reason to lose edits.
int on_x_error(void* display, XError* error) {
    constexpr unsigned char kBadWindow = 3, kBadDrawable = 9;
    if ((error->code == kBadWindow || error->code == kBadDrawable) && error->resource == own_window)
        return on_lost_display(display);
    static bool is_told = false;  // one may come with each frame
    if (std::exchange(is_told, true)) return 0;
    std::fprintf(stderr, "note: the X server refused a request (error %d of request %d.%d)\n", error->code,
                 error->request, error->minor);
    return 0;
}

// Dots an inch of an X server over 96 where nobody has set Xft.dpi, which is all that GLFW asks for; 1 elsewhere. By
// name, so that a GLFW for another window system does as well, and X11's headers are not needed.
float x_server_scale() {
    const auto display_of = symbol<void*()>("glfwGetX11Display");
    const auto resources_of = symbol<char*(void*)>("XResourceManagerString");
    const auto width_of = symbol<int(void*, int)>("XDisplayWidth"),
               mm_of = symbol<int(void*, int)>("XDisplayWidthMM");
    if (display_of == nullptr || resources_of == nullptr || width_of == nullptr || mm_of == nullptr) return 1;
    void* const display = display_of();
    if (display == nullptr) return 1;
    const char* const resources = resources_of(display);
    if (resources != nullptr && std::string(resources).find("Xft.dpi") != std::string::npos) return 1;
    const int mm = mm_of(display, 0);
    return mm > 0 ? 25.4f * float(width_of(display, 0)) / float(mm) / 96 : 1;
}

// In quarters, so that text is as sharp as its size allows.
float display_scale() {
    float x = 1, y = 1;
    if (GLFWmonitor* const monitor = glfwGetPrimaryMonitor()) glfwGetMonitorContentScale(monitor, &x, &y);
    if (x == 1) x = std::max(1.0f, x_server_scale());
    return std::clamp(std::round(4 * x) / 4, 0.5f, 4.0f);
}

struct WindowHandle {
    explicit WindowHandle(const WindowOptions& options) : scale(display_scale()) {
        glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
        glfwWindowHint(GLFW_VISIBLE, options.visible ? GLFW_TRUE : GLFW_FALSE);
        const auto scaled = [&](int size) { return int(std::lround(scale * float(size))); };
        window = glfwCreateWindow(scaled(options.width), scaled(options.height), options.title.c_str(),
                                  nullptr, nullptr);
        if (window == nullptr) throw Error(ErrorCode::gpu, "no window can be opened: " + glfw_problem);
        glfwSetWindowSizeLimits(window, 200, 150, GLFW_DONT_CARE, GLFW_DONT_CARE);
    }
    ~WindowHandle() { glfwDestroyWindow(window); }
    WindowHandle(const WindowHandle&) = delete;
    WindowHandle& operator=(const WindowHandle&) = delete;
    float scale = 1;  // factor between 96 dots an inch and this display
    GLFWwindow* window = nullptr;
};

struct Interface {
    Interface() {
        IMGUI_CHECKVERSION();
        ImGui::CreateContext();
        ImGui::GetIO().IniFilename = nullptr;  // settings.h keeps the layout
    }
    ~Interface() { ImGui::DestroyContext(); }
    Interface(const Interface&) = delete;
    Interface& operator=(const Interface&) = delete;
};

// The checksum of all that the interface draws: two frames with the same one look the same.
std::string digest_of(const ImDrawData& data) {
    Digest digest;
    const auto add = [&](const auto* values, std::size_t count) {
        digest.add(std::as_bytes(std::span(values, count)));
    };
    add(&data.DisplaySize, 1);
    add(&data.FramebufferScale, 1);
    for (const ImDrawList* list : std::span(data.CmdLists, std::size_t(data.CmdListsCount))) {
        add(list->CmdBuffer.Data, std::size_t(list->CmdBuffer.Size));
        add(list->IdxBuffer.Data, std::size_t(list->IdxBuffer.Size));
        add(list->VtxBuffer.Data, std::size_t(list->VtxBuffer.Size));
    }
    return digest.hex();
}

// Exceptions of the Vulkan binding as those of nephos.
template <typename Function>
auto checked(const Function& function) {
    try {
        return function();
    } catch (const vk::DeviceLostError&) {
        throw Error(ErrorCode::gpu, "the graphics device was lost (reset, removed, or out of memory)");
    } catch (const vk::SystemError& error) {
        throw Error(ErrorCode::gpu, std::string("the graphics device failed: ") + error.what());
    }
}

}  // namespace

struct Window::Impl {
    explicit Impl(const WindowOptions& options)
        : handle(options),
          gpu(handle.window, options.device, options.validation),
          chain(gpu),
          frame(gpu),
          picture(gpu) {
        glfwSetWindowUserPointer(handle.window, this);
        when_lost = options.lost;
        using Handler = int(void*);
        if (const auto set_handler = symbol<Handler*(Handler*)>("XSetIOErrorHandler"))
            set_handler(&on_lost_display);
        using ErrorHandler = int(void*, XError*);
        if (const auto number_of = symbol<unsigned long(GLFWwindow*)>("glfwGetX11Window"))
            own_window = number_of(handle.window);
        if (const auto set_handler = symbol<ErrorHandler*(ErrorHandler*)>("XSetErrorHandler"))
            set_handler(&on_x_error);
        glfwSetDropCallback(handle.window, [](GLFWwindow* window, int count, const char** paths) {
            auto& self = *static_cast<Impl*>(glfwGetWindowUserPointer(window));
            for (int n = 0; n < count; ++n) self.dropped.emplace_back(paths[n]);
        });
        glfwSetWindowRefreshCallback(handle.window, [](GLFWwindow* window) {
            static_cast<Impl*>(glfwGetWindowUserPointer(window))->shown.clear();
        });
        ImGui_ImplGlfw_InitForVulkan(handle.window, true);
        glfwSetCharCallback(handle.window, [](GLFWwindow* window, unsigned code) {
            ImGui_ImplGlfw_CharCallback(window, field_character(code));
        });
        keep_clipboard_apart();
        chain.create(framebuffer_size());
        ImGui_ImplVulkan_InitInfo info{};
        info.Instance = *gpu.instance;
        info.PhysicalDevice = *gpu.physical;
        info.Device = *gpu.device;
        info.QueueFamily = gpu.family;
        info.Queue = *gpu.queue;
        info.DescriptorPool = *gpu.descriptors;
        info.MinImageCount = 2;
        info.ImageCount = std::max(2u, std::uint32_t(chain.views.size()));
        info.MSAASamples = VK_SAMPLE_COUNT_1_BIT;
        info.CheckVkResultFn = [](VkResult result) {
            if (result >= 0) return;
            has_failed_in_imgui = true;
            vk::throwResultException(vk::Result(result), "ImGui");
        };
        ImGui_ImplVulkan_Init(&info, *chain.pass);
    }
    ~Impl() {
        try {
            gpu.device.waitIdle();
        } catch (const std::exception&) {  // a lost device: nothing is drawn any more
        }
        // After a failure between two of its calls it still has what the first has freed, and would free it again.
        if (!has_failed_in_imgui) ImGui_ImplVulkan_Shutdown();
        ImGui_ImplGlfw_Shutdown();
        when_lost = {};
    }

    std::array<int, 2> size() const {
        std::array<int, 2> out{};
        glfwGetWindowSize(handle.window, &out[0], &out[1]);
        return out;
    }

    vk::Extent2D framebuffer_size() const {
        int width = 0, height = 0;
        glfwGetFramebufferSize(handle.window, &width, &height);
        return {std::uint32_t(width), std::uint32_t(height)};
    }

    void load_fonts() {
        gpu.device.waitIdle();
        frame.run_once([](vk::CommandBuffer commands) { ImGui_ImplVulkan_CreateFontsTexture(commands); });
        ImGui_ImplVulkan_DestroyFontUploadObjects();
        fonts_loaded = true;
        shown.clear();
    }

    // Draws and shows the frame, unless that is what the window shows already: on a machine without a card each frame
    // that is drawn takes time from the clouds.
    void show_changed(ImDrawData* data) {
        std::string due = digest_of(*data);
        if (due == shown && framebuffer_size() == chain.extent && !chain.is_old && !captures) return;
        shown.clear();
        if (show(data)) shown = std::move(due);
    }

    // Returns whether it is shown: not in a window without size, nor when the window changed meanwhile.
    bool show(ImDrawData* data) {
        const vk::Extent2D size = framebuffer_size();
        if (size.width == 0 || size.height == 0) return false;
        if (size != chain.extent || chain.is_old) {
            gpu.device.waitIdle();
            chain.create(size);
        }
        frame.wait();
        const std::optional<std::uint32_t> index = chain.acquire(*frame.acquired);
        if (!index) return false;
        const vk::CommandBuffer commands = frame.begin();
        picture.upload(commands);
        const ImVec4& panels = ImGui::GetStyleColorVec4(ImGuiCol_WindowBg);
        picture.draw(commands, chain.images[*index], chain.extent, place, {panels.x, panels.y, panels.z, 1});
        commands.beginRenderPass({*chain.pass, *chain.framebuffers[*index], {{0, 0}, chain.extent}, {}},
                                 vk::SubpassContents::eInline);
        ImGui_ImplVulkan_RenderDrawData(data, commands);
        commands.endRenderPass();
        if (captures) frame.copy_image(commands, chain.images[*index], chain.extent);
        frame.submit(chain.drawn(*index));
        if (captures) {
            frame.wait();
            image = frame.copied(chain.extent, chain.is_bgr());
            captures = false;
        }
        chain.present(*index);
        return !chain.is_old;
    }

    static inline bool has_failed_in_imgui = false;  // a function of Vulkan that it called
    Glfw glfw;
    WindowHandle handle;
    Interface interface;
    Gpu gpu;
    SwapChain chain;
    FrameCommands frame;
    PictureImage picture;
    vk::Rect2D place;
    bool fonts_loaded = false, captures = false;
    std::string shown;  // digest of what the window shows; empty: to be drawn anew
    WindowImage image;
    std::vector<std::filesystem::path> dropped;
};

Window::Window(const WindowOptions& options)
    : impl_(checked([&] { return std::make_unique<Impl>(options); })) {}
Window::~Window() = default;

bool Window::begin_frame(double wait_s) {
    if (wait_s > 0) {
        glfwWaitEventsTimeout(wait_s);
    } else {
        glfwPollEvents();
    }
    if (glfwWindowShouldClose(impl_->handle.window) != 0) return false;
    checked([&] {
        if (!impl_->fonts_loaded) impl_->load_fonts();
    });
    ImGui_ImplVulkan_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    return true;
}

void Window::end_frame() {
    ImGui::Render();
    checked([&] { impl_->show_changed(ImGui::GetDrawData()); });
}

void Window::ask_to_close(bool asked) {
    glfwSetWindowShouldClose(impl_->handle.window, asked ? GLFW_TRUE : GLFW_FALSE);
}

void Window::set_picture(int width, int height, const unsigned char* rgba) {
    checked([&] {
        impl_->frame.wait();
        impl_->picture.set(width, height, rgba);
        impl_->shown.clear();
    });
}

void Window::clear_picture() {
    impl_->picture.clear();
    impl_->shown.clear();
}

void Window::place_picture(const ImVec2& min, const ImVec2& max) {
    const ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
    const auto pixel = [](float at) { return std::int32_t(std::lround(std::max(at, 0.0f))); };
    const std::int32_t left = pixel(min.x * scale.x), top = pixel(min.y * scale.y);
    const vk::Rect2D place({left, top}, {std::uint32_t(std::max(0, pixel(max.x * scale.x) - left)),
                                         std::uint32_t(std::max(0, pixel(max.y * scale.y) - top))});
    if (place != std::exchange(impl_->place, place)) impl_->shown.clear();
}

void Window::capture_next() { impl_->captures = true; }
bool Window::is_captured() const { return !impl_->captures; }
const WindowImage& Window::captured() const { return impl_->image; }

void Window::rebuild_fonts() { impl_->fonts_loaded = false; }

void Window::set_title(const std::string& title) { glfwSetWindowTitle(impl_->handle.window, title.c_str()); }
void Window::set_size(int width, int height) { glfwSetWindowSize(impl_->handle.window, width, height); }
int Window::width() const { return int(std::lround(float(impl_->size()[0]) / content_scale())); }
int Window::height() const { return int(std::lround(float(impl_->size()[1]) / content_scale())); }
void Window::minimise(bool minimised) {
    if (minimised) {
        glfwIconifyWindow(impl_->handle.window);
    } else {
        glfwRestoreWindow(impl_->handle.window);
    }
}
bool Window::is_minimised() const {
    const vk::Extent2D size = impl_->framebuffer_size();
    return size.width == 0 || size.height == 0 ||
           glfwGetWindowAttrib(impl_->handle.window, GLFW_ICONIFIED) == GLFW_TRUE;
}
float Window::content_scale() const { return impl_->handle.scale; }
std::string Window::device_name() const { return impl_->gpu.name; }
void Window::drop(const std::vector<std::filesystem::path>& files) {
    impl_->dropped.insert(impl_->dropped.end(), files.begin(), files.end());
}
std::vector<std::filesystem::path> Window::take_dropped() { return std::exchange(impl_->dropped, {}); }
std::vector<std::string> Window::validation_messages() const { return impl_->gpu.messages(); }
void Window::wake() { glfwPostEmptyEvent(); }

}  // namespace nephos
