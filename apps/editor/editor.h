// SPDX-License-Identifier: Apache-2.0
#pragma once

// The editor: a window in which scenes are edited and watched while they run (docs/editor.md).

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace nephos {

struct EditorOptions {
    std::filesystem::path scene;  // a scene, or a folder of scenes; empty: the scene of a first start
    // Saves a picture of the window after so many seconds and ends; empty: no.
    std::filesystem::path screenshot;
    double after_s = 3;
    std::filesystem::path script;  // clicks and keys (script.h); empty: the user's
    bool report = false;           // print times and rates at the end
    int width = 0, height = 0;     // of the window; 0: as last time
    std::string theme;             // "dark", "light"; empty: as last time
    double scale = 0;              // of text and controls; 0: that of the display
    std::string device;            // Vulkan device of the window
    bool validation = false;       // end with status 4 when the validation layer says anything
};

// Opens the window and returns when it is closed: the exit status. Throws Error(gpu) when there is no display or no
// driver, or the device is lost, after unsaved edits were written beside the scene; Error(io) and SceneErrors for a
// scene that cannot be read.
int run_editor(const EditorOptions& options);

}  // namespace nephos
