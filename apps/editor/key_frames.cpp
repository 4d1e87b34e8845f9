// SPDX-License-Identifier: Apache-2.0
// Key frames of the scene and checkpoints of the user, as marks below the time line. A mark can be clicked and dragged.

#include <algorithm>
#include <cmath>

#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "core/text.h"

namespace nephos {
namespace {

struct KeyMark {
    double time_s = 0;
    TextPath path;  // of the key frame
    const char* kind = "";
    ImU32 colour = 0;
    double least_s = 0, most_s = 1e15;  // between its neighbours
};

// Adds the key frames of one list, where the text has it: states and winds may come from other keys.
template <typename Key>
void add_marks(std::vector<KeyMark>& marks, const Node& values, const std::vector<Key>& keys,
               const std::string& list, const char* kind, ImU32 colour, bool rises = true) {
    const Node* const elements = value_node(values, text_path(list));
    if (elements == nullptr || elements->items.size() != keys.size()) return;
    for (std::size_t n = 0; n < keys.size(); ++n) {
        KeyMark mark{keys[n].time_s, text_path(list + "[" + std::to_string(n) + "]"), kind, colour};
        if (rises && n > 0) mark.least_s = std::nextafter(keys[n - 1].time_s, 1e300);
        if (rises && n + 1 < keys.size()) mark.most_s = std::nextafter(keys[n + 1].time_s, -1e300);
        marks.push_back(std::move(mark));
    }
}

constexpr ImU32 kWindMark = IM_COL32(78, 160, 240, 255), kClimateMark = IM_COL32(240, 150, 60, 255),
                kSunMark = IM_COL32(245, 215, 90, 255), kFlashMark = IM_COL32(190, 150, 255, 255),
                kCameraMark = IM_COL32(120, 200, 140, 255);

std::vector<KeyMark> marks_of(const Scene& scene, const Node& values) {
    std::vector<KeyMark> marks;
    add_marks(marks, values, scene.automaton.wind.keyframes, "wind", "wind", kWindMark);
    add_marks(marks, values, scene.climate.schedule, "climate.schedule", "climate", kClimateMark);
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        const std::string layer = "layer[" + std::to_string(n) + "].";
        add_marks(marks, values, scene.layers[n].wind.keyframes, layer + "wind", "wind of a layer",
                  kWindMark);
        add_marks(marks, values, scene.layers[n].schedule, layer + "climate.schedule", "climate of a layer",
                  kClimateMark);
    }
    add_marks(marks, values, scene.sun_path, "sun.path", "sun", kSunMark);
    add_marks(marks, values, scene.render.lightning, "lightning", "lightning", kFlashMark, false);
    add_marks(marks, values, scene.render.camera.path, "camera.path", "camera", kCameraMark);
    return marks;
}

}  // namespace

void key_frame_strip(Editor& editor, float from, float width, std::uint64_t last_step) {
    const float height = 0.9f * ImGui::GetFontSize();
    const ImVec2 corner(from, ImGui::GetCursorScreenPos().y);
    ImGui::SetCursorScreenPos(corner);
    ImGui::InvisibleButton("key frames", ImVec2(std::max(width, 1.0f), height));
    editor.controls.note("key frames");
    const bool hovered = ImGui::IsItemHovered();
    if (!editor.shown_scene) return;
    const double step_s = editor.shown_scene->automaton.time_step_s,
                 span = double(std::max<std::uint64_t>(last_step, 1));
    // As the slider's grab: a step's middle lies within its rim.
    const float rim = 0.5f * ImGui::GetStyle().GrabMinSize + 2;
    const auto x_of = [&](double step) {
        return from + rim + (width - 2 * rim) * float(std::min(step / span, 1.0));
    };
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const float middle = corner.y + 0.5f * height, half = 0.38f * height;
    for (std::size_t n = 0; n < editor.checkpoints.size(); ++n) {
        const std::uint64_t step = editor.checkpoints[n];
        const float x = x_of(double(step));
        const ImU32 white = ImGui::GetColorU32(ImGuiCol_Text);
        list.AddLine(ImVec2(x, corner.y), ImVec2(x, corner.y + height), white, 1.5f);
        list.AddTriangleFilled(ImVec2(x, corner.y), ImVec2(x + 1.6f * half, corner.y + half),
                               ImVec2(x, corner.y + 2 * half), white);
        editor.controls.now["checkpoint " + std::to_string(n)] = {ImVec2(x, corner.y),
                                                                  ImVec2(x + half, middle + half)};
        if (!hovered || std::abs(mouse.x - x - 0.5f * half) > 1.5f * half) continue;
        ImGui::SetTooltip("checkpoint: step %llu", static_cast<unsigned long long>(step));
        if (ImGui::IsMouseClicked(ImGuiMouseButton_Left)) go_to_step(editor, step);
    }
    static TextPath held;  // one mouse
    const Scene* const scene = editor.document->current_scene();
    if (!ImGui::IsMouseDown(ImGuiMouseButton_Left) || scene == nullptr) held.clear();
    if (scene == nullptr) return;
    const std::vector<KeyMark> marks = marks_of(*scene, editor.document->values());
    // The nearest, and of those at one place the one that is drawn last.
    const KeyMark* under_mouse = nullptr;
    float nearest = hovered ? 1.6f * half : -1.0f;
    for (const KeyMark& mark : marks) {
        const float distance = std::abs(mouse.x - x_of(mark.time_s / step_s));
        if (distance > nearest) continue;
        under_mouse = &mark;
        nearest = distance;
    }
    for (const KeyMark& mark : marks) {
        const double step = mark.time_s / step_s;
        const float x = x_of(step);
        const bool near = under_mouse == &mark, chosen = editor.selected == mark.path;
        const float size = chosen || near ? 1.3f * half : half;
        list.AddQuadFilled(ImVec2(x, middle - size), ImVec2(x + size, middle), ImVec2(x, middle + size),
                           ImVec2(x - size, middle), mark.colour);
        editor.controls.now["key frame " + path_text(mark.path)] = {ImVec2(x - half, middle - half),
                                                                    ImVec2(x + half, middle + half)};
        if (near && held.empty()) {
            ImGui::SetTooltip("%s at %g s, step %g\nClick: choose it; drag: another time", mark.kind,
                              mark.time_s, step);
            if (ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
                held = mark.path;
                editor.selected = mark.path;
                editor.wanted_tab = 0;
            }
        }
        if (held != mark.path || !ImGui::IsMouseDragging(ImGuiMouseButton_Left, 3)) continue;
        const double under = double((mouse.x - from - rim) / std::max(width - 2 * rim, 1.0f)) * span;
        // Up to the last step before the neighbour, however far it is dragged.
        double least = std::ceil(mark.least_s / step_s), most = std::floor(mark.most_s / step_s);
        if (least * step_s < mark.least_s) ++least;  // quotients are rounded
        if (most * step_s > mark.most_s) --most;
        if (least > most) continue;
        const double time_s = std::clamp(std::round(std::clamp(under, 0.0, span)), least, most) * step_s;
        if (time_s == mark.time_s) continue;
        set_values(editor, mark.path, {{"time_s", number_text(time_s)}}, true);
        break;  // the scene is another now
    }
}

void keep_checkpoint(Editor& editor) {
    if (!editor.picture) return;
    const std::uint64_t step = editor.picture->step;
    if (std::ranges::find(editor.checkpoints, step) == editor.checkpoints.end())
        editor.checkpoints.push_back(step);
    std::ranges::sort(editor.checkpoints);
    say(editor, "Checkpoint at step " + std::to_string(step) + ": B goes back to it");
}

void back_to_checkpoint(Editor& editor) {
    const std::uint64_t now = step_to_go_from(editor);
    const auto next = std::ranges::lower_bound(editor.checkpoints, now);
    if (next == editor.checkpoints.begin()) {
        say(editor,
            editor.checkpoints.empty() ? "There is no checkpoint: M sets one"
                                       : "There is no earlier checkpoint",
            true);
        return;
    }
    go_to_step(editor, *std::prev(next));
}

}  // namespace nephos
