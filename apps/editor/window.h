// SPDX-License-Identifier: Apache-2.0
#pragma once

// The window: GLFW for input, Dear ImGui for the interface, Vulkan to show it. Knows nothing of scenes.
//
//     Window window(options);
//     while (window.begin_frame(0.03)) {
//         ...  ImGui calls; window.place_picture()
//         window.end_frame();
//     }

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <imgui.h>

namespace nephos {

struct WindowOptions {
    int width = 1360, height = 860;  // of its content, screen coordinates
    std::string title = "nephos";
    std::string device;       // part of a Vulkan device's name; empty: a graphics card if there is one
    bool validation = false;  // under the Khronos validation layer
    bool visible = true;
    std::function<void()> lost = {};  // called when the display goes away; then the program ends, status 4
};

// Pixels of the window, 4 bytes each, row 0 at the top.
struct WindowImage {
    int width = 0, height = 0;
    std::vector<unsigned char> rgba;
};

class Window {
  public:
    // Opens the window and an ImGui context. Throws Error(gpu) when there is no display, no Vulkan loader, no driver or
    // none that can draw into a window, and names the package that helps.
    explicit Window(const WindowOptions& options);
    ~Window();
    Window(const Window&) = delete;
    Window& operator=(const Window&) = delete;

    // Takes what the user did, waiting at most `wait_s` seconds for it, and begins an ImGui frame. Returns false when
    // the window is to be closed. While it is minimised, frames have no size and end_frame() shows nothing.
    bool begin_frame(double wait_s);
    // Draws the frame and shows it. Throws Error(gpu) when the device fails or is lost.
    void end_frame();

    // Closing: asked for by the user, and taken back when unsaved edits are to be kept.
    void ask_to_close(bool asked);

    // Takes the picture that is drawn below the interface: row 0 at the top, 4 bytes a pixel.
    void set_picture(int width, int height, const unsigned char* rgba);
    // There is none until the next set_picture().
    void clear_picture();
    // Where it shows, scaled, in this frame and later ones; ImGui's coordinates.
    void place_picture(const ImVec2& min, const ImVec2& max);

    // Copies what the next end_frame() shows that has a picture to show.
    void capture_next();
    bool is_captured() const;
    const WindowImage& captured() const;

    // Replaces the fonts; between two frames.
    void rebuild_fonts();

    void set_title(const std::string& title);
    void set_size(int width, int height);
    // Size that opens a window like this one: on a display with larger dots it gets larger again.
    int width() const;
    int height() const;
    void minimise(bool minimised);
    bool is_minimised() const;
    // Factor between 96 dots per inch and this display.
    float content_scale() const;
    std::string device_name() const;
    // Files that were dropped on the window since the last call.
    std::vector<std::filesystem::path> take_dropped();
    // As if the user had dropped these.
    void drop(const std::vector<std::filesystem::path>& files);
    // What the validation layer said so far.
    std::vector<std::string> validation_messages() const;
    // Wakes a begin_frame() that waits; any thread may call it.
    static void wake();

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace nephos
