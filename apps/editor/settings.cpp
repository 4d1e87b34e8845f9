// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/settings.h"

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"

namespace nephos {
namespace {

constexpr std::size_t kMostBytes = std::size_t(1) << 20;

template <typename Number>
void take(const std::string& text, Number min, Number max, Number& value) {
    std::istringstream in(text);
    in.imbue(std::locale::classic());
    Number read{};
    if (in >> read && read >= min && read <= max) value = read;
}

}  // namespace

std::filesystem::path settings_folder() {
    if (const char* folder = std::getenv("XDG_CONFIG_HOME"); folder != nullptr && *folder == '/') {
        return std::filesystem::path(folder) / "nephos";
    }
    const char* home = std::getenv("HOME");
    if (home == nullptr || *home != '/') {
        const passwd* user = ::getpwuid(::geteuid());
        // Never a folder that all may write to, where another user might have made one. In /dev/null there is none: nothing
        // is remembered.
        home =
            user != nullptr && user->pw_dir != nullptr && *user->pw_dir == '/' ? user->pw_dir : "/dev/null";
    }
    return std::filesystem::path(home) / ".config" / "nephos";
}

Settings read_settings(const std::filesystem::path& folder) {
    Settings settings;
    std::string text;
    try {
        text = read_beginning(folder / "editor.conf", kMostBytes);
    } catch (const Error&) {
        return settings;  // there are none yet, or none that can be read: those that a new user has
    }
    std::istringstream file(text);
    for (std::string line; std::getline(file, line);) {
        const std::size_t equals = line.find(" = ");
        if (equals == std::string::npos) continue;
        const std::string key = line.substr(0, equals), value = line.substr(equals + 3);
        if (key == "width") take(value, 200, 16384, settings.width);
        if (key == "height") take(value, 150, 16384, settings.height);
        if (key == "left") take(value, kLeastLeft, kLargestPanel, settings.left);
        if (key == "right") take(value, kLeastRight, kLargestPanel, settings.right);
        if (key == "bottom") take(value, kLeastBottom, kLargestPanel, settings.bottom);
        if (key == "tab") take(value, 0, 2, settings.tab);
        if (key == "plots") settings.plots = value != "off";
        if (key == "shapes") settings.shapes = value != "off";
        if (key == "theme") settings.dark = value != "light";
        if (key == "scale" && value != "0")
            take(value, kSmallestTextScale, kLargestTextScale, settings.scale);
        if (key == "recent" && !value.empty() && settings.recent.size() < kMostRecent)
            settings.recent.push_back(value);
    }
    return settings;
}

void write_settings(const std::filesystem::path& folder, const Settings& settings) {
    std::string text =
        fmt::format("width = {}\nheight = {}\nleft = {}\nright = {}\nbottom = {}\n", settings.width,
                    settings.height, settings.left, settings.right, settings.bottom) +
        fmt::format("tab = {}\nplots = {}\nshapes = {}\ntheme = {}\nscale = {}\n", settings.tab,
                    settings.plots ? "on" : "off", settings.shapes ? "on" : "off",
                    settings.dark ? "dark" : "light", settings.scale);
    for (const std::string& recent : settings.recent) {
        if (recent.find('\n') == std::string::npos) text += "recent = " + recent + "\n";
    }
    write_atomically(folder / "editor.conf", text);
}

void note_recent(Settings& settings, const std::filesystem::path& path) {
    const std::string name = normal_path(std::filesystem::absolute(path)).string();
    std::erase(settings.recent, name);
    settings.recent.insert(settings.recent.begin(), name);
    if (settings.recent.size() > kMostRecent) settings.recent.resize(kMostRecent);
}

}  // namespace nephos
