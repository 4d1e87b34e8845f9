// SPDX-License-Identifier: Apache-2.0

// The program nephos-editor: `nephos edit` with its window.

#include <string_view>
#include <vector>

#include "apps/editor/editor.h"
#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"

namespace {

int edit(const nephos::EditArguments& a) {
    nephos::start_threads(0);
    nephos::EditorOptions options;
    options.scene = a.scene;
    options.screenshot = a.screenshot;
    options.after_s = a.after_s;
    options.script = a.script;
    options.report = a.report;
    options.width = a.width;
    options.height = a.height;
    options.theme = a.theme;
    options.scale = a.scale;
    options.device = a.device;
    options.validation = a.validation;
    return nephos::run_editor(options);
}

}  // namespace

int main(int argc, char** argv) {
    std::vector<const char*> words{argc > 0 ? argv[0] : "nephos-editor"};
    const std::string_view first = argc > 1 ? argv[1] : "";
    if (first != "--version" && first != "-V") words.push_back("edit");  // the version is that of the whole
    words.insert(words.end(), argv + (argc > 0 ? 1 : 0), argv + argc);
    return nephos::run_program(int(words.size()), words.data(), &edit);
}
