// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the editor remembers from one start to the next: the size of its window and panels, which of them show, theme,
// recent files. A text
// file of `key = value` lines in the user's configuration folder.

#include <filesystem>
#include <string>
#include <vector>

namespace nephos {

// The range of the scale of texts and controls: 1 fits a display of 96 dots an inch.
inline constexpr float kSmallestTextScale = 0.5f, kLargestTextScale = 4;

// The range of panels, at scale 1: below it nothing in them could be read.
inline constexpr float kLeastLeft = 140, kLeastRight = 220, kLeastBottom = 60, kLargestPanel = 1600;

struct Settings {
    int width = 1360, height = 860;               // of the window
    float left = 250, right = 390, bottom = 190;  // of the panels, at scale 1
    int tab = 0;                                  // 0 properties, 1 view, 2 text
    bool plots = true, shapes = true;             // below the time line, over the picture
    bool dark = true;
    float scale = 0;                  // 0: that of the display
    std::vector<std::string> recent;  // newest first
};

inline constexpr std::size_t kMostRecent = 12;

// Returns $XDG_CONFIG_HOME/nephos, or ~/.config/nephos.
std::filesystem::path settings_folder();

// Returns the defaults where there is no file, or a line cannot be read. Lines of later versions are ignored.
Settings read_settings(const std::filesystem::path& folder);
// Throws Error(io).
void write_settings(const std::filesystem::path& folder, const Settings& settings);

// Puts a file at the top of the recent ones.
void note_recent(Settings& settings, const std::filesystem::path& path);

}  // namespace nephos
