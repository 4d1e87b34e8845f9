// SPDX-License-Identifier: Apache-2.0
// The time line: start, pause, step, speed, scrubbing over the steps, and plots of what the clouds do.

#include <algorithm>
#include <array>
#include <cmath>

#include "apps/editor/state.h"

namespace nephos {
namespace {

constexpr std::array<double, 7> kSpeeds{1, 10, 30, 60, 120, 300, 1000};

struct Curve {
    const char* name;
    const char* hint;
    ImU32 colour;
    double (*value)(const LiveStep&);
};

constexpr ImU32 kBlue = IM_COL32(78, 160, 240, 255), kOrange = IM_COL32(240, 150, 60, 255),
                kGreen = IM_COL32(90, 190, 110, 255), kRed = IM_COL32(225, 90, 90, 255),
                kViolet = IM_COL32(170, 120, 230, 255);

const std::array<Curve, 1> kCover{{{"cover", "share of the ground below a cloud", kBlue,
                                    [](const LiveStep& step) { return 100 * step.statistics.cover; }}}};
const std::array<Curve, 3> kCells{{
    {"hum", "cells with vapour", kGreen, [](const LiveStep& step) { return double(step.statistics.hum); }},
    {"act", "cells in phase transition", kOrange,
     [](const LiveStep& step) { return double(step.statistics.act); }},
    {"cld", "cells with cloud", kRed, [](const LiveStep& step) { return double(step.statistics.cld); }},
}};
const std::array<Curve, 2> kHeights{{
    {"base", "lowest cloud, m", kViolet, [](const LiveStep& step) { return step.statistics.base_m; }},
    {"top", "highest cloud, m", kBlue, [](const LiveStep& step) { return step.statistics.top_m; }},
}};

std::string short_number(double value) {
    char text[32];
    if (std::abs(value) >= 1e6) {
        std::snprintf(text, sizeof text, "%.3gM", value * 1e-6);
    } else if (std::abs(value) >= 1e4) {
        std::snprintf(text, sizeof text, "%.3gk", value * 1e-3);
    } else {
        std::snprintf(text, sizeof text, "%.4g", value);
    }
    return text;
}

void plot(Editor& editor, const char* title, const char* unit, std::span<const Curve> curves, ImVec2 size,
          bool from_zero, std::uint64_t last_step) {
    const ImVec2 min = ImGui::GetCursorScreenPos(), max(min.x + size.x, min.y + size.y);
    ImGui::InvisibleButton(title, size);
    editor.controls.note(std::string("plot ") + title);
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.AddRectFilled(min, max, ImGui::GetColorU32(ImGuiCol_FrameBg), 3);
    double low = 1e300, high = -1e300;
    for (const LiveStep& step : editor.steps) {
        for (const Curve& curve : curves) {
            const double value = curve.value(step);
            if (!std::isfinite(value)) continue;
            low = std::min(low, value);
            high = std::max(high, value);
        }
    }
    const float line = ImGui::GetTextLineHeight();
    const float top = min.y + 1.25f * line, bottom = max.y - 4;
    float at = min.x + 6;
    for (const Curve& curve : curves) {
        list.AddText(ImVec2(at, min.y + 2), curve.colour, curve.name);
        at += ImGui::CalcTextSize(curve.name).x + 10;
    }
    if (low > high || bottom <= top) return;
    if (from_zero) low = 0;
    if (high <= low) high = low + 1;
    const std::string most = short_number(high) + unit;
    list.AddText(ImVec2(max.x - ImGui::CalcTextSize(most.c_str()).x - 6, min.y + 2),
                 ImGui::GetColorU32(ImGuiCol_TextDisabled), most.c_str());
    const double span = double(std::max<std::uint64_t>(last_step, 1));
    const auto x_of = [&](double step) {
        return float(min.x + 4 + (size.x - 8) * std::min(1.0, step / span));
    };
    const std::size_t count = editor.steps.size();
    const std::size_t stride = std::max<std::size_t>(1, count / std::size_t(std::max(size.x, 1.0f)));
    for (const Curve& curve : curves) {
        std::vector<ImVec2> points;
        const auto flush = [&] {
            if (points.size() > 1) list.AddPolyline(points.data(), int(points.size()), curve.colour, 0, 1.5f);
            points.clear();
        };
        for (std::size_t n = 0; n < count; n += stride) {
            const double value = curve.value(editor.steps[n]);
            if (!std::isfinite(value)) {
                flush();
                continue;
            }
            points.emplace_back(x_of(double(n)),
                                float(bottom - (bottom - top) * (value - low) / (high - low)));
        }
        flush();
    }
    if (editor.picture) {
        const float now = x_of(double(editor.picture->step));
        list.AddLine(ImVec2(now, min.y), ImVec2(now, max.y), ImGui::GetColorU32(ImGuiCol_TextDisabled));
    }
    if (!ImGui::IsItemHovered() || count == 0) return;
    const double under = (ImGui::GetIO().MousePos.x - min.x - 4) / std::max(size.x - 8, 1.0f) * span;
    const auto step = std::size_t(std::clamp(under, 0.0, double(count - 1)));
    std::string text = "step " + std::to_string(step);
    for (const Curve& curve : curves) {
        text += std::string("\n") + curve.name + ": " + short_number(curve.value(editor.steps[step])) + unit +
                " (" + curve.hint + ")";
    }
    text += "\nClick: go there";
    ImGui::SetTooltip("%s", text.c_str());
    if (ImGui::IsMouseDown(ImGuiMouseButton_Left)) go_to_step(editor, step);
}

void transport(Editor& editor) {
    if (button(editor, editor.running ? "Pause" : "Run", "Run or pause (Space)")) {
        editor.live->run(editor.running = !editor.running);
    }
    ImGui::SameLine();
    if (button(editor, "|<", "Back to the start (Home)")) go_to_step(editor, 0);
    ImGui::SameLine();
    if (button(editor, "<", "A step back (,)")) step_back(editor);
    ImGui::SameLine();
    if (button(editor, ">", "A step on (.)")) step_on(editor);
    ImGui::SameLine();
    if (button(editor, "Mark", "A checkpoint at this step (M); B goes back to the last one")) keep_checkpoint(editor);
    ImGui::SameLine();
    ImGui::SetNextItemWidth(6.5f * ImGui::GetFontSize());
    char now[32];
    std::snprintf(now, sizeof now, "%gx", editor.speed);
    if (ImGui::BeginCombo("##speed", now)) {
        for (const double speed : kSpeeds) {
            char text[32];
            std::snprintf(text, sizeof text, "%gx", speed);
            if (ImGui::Selectable(text, speed == editor.speed)) editor.speed = speed;
            editor.controls.note(std::string("speed ") + text);
        }
        ImGui::EndCombo();
    }
    editor.controls.note("speed");
    tooltip_of_last("Simulated seconds that pass in a second; the machine may be slower");
}

}  // namespace

std::uint64_t step_to_go_from(const Editor& editor) {
    const LiveStatus status = editor.live->status();
    return status.running ? status.step : status.goal;
}

void go_to_step(Editor& editor, std::uint64_t step) {
    editor.live->run(editor.running = false);
    if (editor.shown_scene) editor.live->seek(step);
}

void step_on(Editor& editor) { go_to_step(editor, step_to_go_from(editor) + 1); }

void step_back(Editor& editor) {
    const std::uint64_t from = step_to_go_from(editor);
    go_to_step(editor, from > 0 ? from - 1 : 0);
}

void timeline_panel(Editor& editor) {
    const LiveStatus status = editor.live->status();
    transport(editor);
    const double step_s = editor.shown_scene ? editor.shown_scene->automaton.time_step_s : 10;
    editor.live->set_speed(editor.speed / step_s);
    std::uint64_t last = editor.shown_scene ? editor.shown_scene->steps : 1;
    last = std::max<std::uint64_t>({last, status.step, status.goal, std::uint64_t(editor.steps.size())});
    ImGui::SameLine();
    const float from = ImGui::GetCursorScreenPos().x, width = ImGui::GetContentRegionAvail().x;
    ImGui::SetNextItemWidth(-1);
    // The step of the picture while it runs: with each of them, not between two, the window is drawn anew.
    std::uint64_t step = editor.running && editor.picture ? editor.picture->step : status.goal;
    const std::uint64_t first = 0;
    if (ImGui::SliderScalar("##step", ImGuiDataType_U64, &step, &first, &last, "step %llu"))
        go_to_step(editor, step);
    editor.controls.note("time line");
    tooltip_of_last(
        "Step that is shown; drag it. Steps that were seen come back from checkpoints in memory.");
    key_frame_strip(editor, from, width, last);
    if (!editor.show_plots) return;
    const ImVec2 room = ImGui::GetContentRegionAvail();
    const float gap = ImGui::GetStyle().ItemSpacing.x;
    const ImVec2 size(std::floor((room.x - 2 * gap) / 3), room.y);
    if (size.x < 20 || size.y < 20) return;
    plot(editor, "cover", " %", kCover, size, true, last);
    ImGui::SameLine();
    plot(editor, "cells", "", kCells, size, true, last);
    ImGui::SameLine();
    plot(editor, "heights", " m", kHeights, size, false, last);
}

}  // namespace nephos
