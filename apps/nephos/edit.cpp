// SPDX-License-Identifier: Apache-2.0

// nephos edit: the editor's window. The command passes its arguments on to the program nephos-editor.

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr const char* kProgram = "nephos-editor";

// Arguments of the program, so that it parses what was parsed here.
std::vector<std::string> words_of(const EditArguments& a) {
    std::vector<std::string> words{kProgram};
    const auto add = [&](const char* name, const std::string& value) {
        if (!value.empty()) words.insert(words.end(), {name, value});
    };
    if (!a.scene.empty()) words.insert(words.end(), {"--", a.scene});
    std::vector<std::string> options;
    std::swap(words, options);
    words = {kProgram};
    add("--screenshot", a.screenshot);
    if (!a.screenshot.empty()) add("--after", fmt::format("{}", a.after_s));
    add("--script", a.script);
    add("--theme", a.theme);
    add("--device", a.device);
    if (a.scale > 0) add("--scale", fmt::format("{}", a.scale));
    if (a.width > 0) add("--size", fmt::format("{}x{}", a.width, a.height));
    if (a.report) words.push_back("--report");
    if (a.validation) words.push_back("--validation");
    words.insert(words.end(), options.begin() + 1, options.end());
    return words;
}

}  // namespace

int start_editor_program(const EditArguments& arguments) {
    std::vector<std::string> words = words_of(arguments);
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    std::error_code error;
    const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
    const std::string beside = (self.parent_path() / kProgram).string();
    const auto require_none = [](const std::string& program) {
        if (errno != ENOENT)
            throw Error(ErrorCode::io,
                        fmt::format("{} cannot be started: {}", program, std::strerror(errno)));
    };
    if (!error) {
        execv(beside.c_str(), pointers.data());
        require_none(beside);
    }
    execvp(kProgram, pointers.data());
    require_none(kProgram);
    throw Error(ErrorCode::usage,
                "this build has no editor: install libglfw3-dev and libimgui-dev and build again, or call "
                "`./run --edit`, "
                "which does both");
}

void add_edit_command(CLI::App& app, Action& action, const EditFunction& edit) {
    CLI::App* command = app.add_subcommand("edit", "Open a window: change a scene and watch it live");
    const auto a = std::make_shared<EditArguments>();
    command->add_option("SCENE", a->scene, "Scene (TOML), or a folder of scenes; default: a small new one")
        ->type_name("SCENE");
    command->add_option("--screenshot", a->screenshot, "Save a picture of the window there, and quit")
        ->type_name("FILE.png");
    add_value(*command, "--after", "SECONDS", "When that picture is taken (default: 3)",
              [a](const std::string& text) { a->after_s = parse_real(text, 0, 86400); });
    command->add_option("--script", a->script, "Do the clicks and keys of a file, and quit (docs/editor.md)")
        ->type_name("FILE");
    add_value(*command, "--size", "WIDTHxHEIGHT", "Size of the window (default: as last time)",
              [a](const std::string& text) {
                  const auto [width, height] = parse_size(text);
                  a->width = width;
                  a->height = height;
              });
    add_value(*command, "--theme", "dark|light", "Colours (default: as last time)",
              [a](const std::string& text) {
                  if (text != "dark" && text != "light") {
                      throw Error(ErrorCode::usage, fmt::format("'{}' is not dark or light", text));
                  }
                  a->theme = text;
              });
    add_value(*command, "--scale", "FACTOR",
              "Size of text and controls, 0.5 to 4 (default: as the display says)",
              [a](const std::string& text) { a->scale = parse_real(text, 0.5, 4); });
    command->add_option("--device", a->device, "Vulkan device of the window: part of its name")
        ->type_name("NAME");
    command->add_flag("--report", a->report, "Print times and rates at the end");
    command->add_flag("--validation", a->validation,
                      "Under the Vulkan validation layer; status 4 when it complains");
    command->footer(
        "What the keys and the mouse do is listed under Help > Keys, and explained in docs/editor.md.\n"
        "\n"
        "Examples:\n"
        "  nephos edit\n"
        "  nephos edit scenes/climate.toml\n"
        "  xvfb-run -a nephos edit scenes/cumulus.toml --screenshot editor.png --after 5");
    command->callback([a, &action, edit] {
        action = [a, edit] {
            // Before a window opens; the files that the scene names are looked at when the picture is saved.
            for (const std::string* const read : {&a->scene, &a->script})
                if (!a->screenshot.empty() && !read->empty()) refuse_to_replace(*read, a->screenshot);
            return edit(*a);
        };
    });
}

}  // namespace nephos
