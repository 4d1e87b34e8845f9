// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/capture.h"

#include <string>
#include <utility>

#include <fmt/format.h>

#include "apps/editor/script.h"
#include "apps/editor/state.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr std::chrono::seconds kPatience{10};

void give_up(Editor& editor) {
    const std::filesystem::path path = std::exchange(editor.capture_to, {});
    const std::string problem =
        fmt::format("{}: the window showed no picture for {} seconds", path.string(), kPatience.count());
    if (!std::exchange(editor.capture_by_user, false)) throw Error(ErrorCode::gpu, problem);
    say(editor, "Not saved: " + problem, true);
}

void save(Editor& editor) {
    const WindowImage& image = editor.window->captured();
    const std::filesystem::path path = std::exchange(editor.capture_to, {});
    const bool by_user = std::exchange(editor.capture_by_user, false);
    try {
        refuse_own_files(editor, path, by_user);
        save_rgba(path, image.width, image.height, image.rgba);
    } catch (const Error& error) {
        if (!by_user) throw;
        return say(editor, std::string("Not saved: ") + error.what(), true);
    }
    say(editor, "Picture of the window: " + path.string());
}

}  // namespace

bool awaits_capture(const Editor& editor, const Script& script) {
    const bool is_attended = editor.options.script.empty() && editor.options.screenshot.empty();
    const bool may_come_back = script.is_active() || (editor.capture_by_user && is_attended);
    return !editor.capture_to.empty() && !(editor.window->is_minimised() && may_come_back);
}

void Capture::begin(Editor& editor) {
    if (!editor.capture_to.empty()) editor.window->capture_next();
}

void Capture::end(Editor& editor, const Script& script) {
    const bool is_due = awaits_capture(editor, script), is_there = editor.window->is_captured();
    if (!is_due || is_there) last_without_ = Clock::now();
    if (is_due && is_there) save(editor);
    if (Clock::now() - last_without_ > kPatience) give_up(editor);
}

}  // namespace nephos
