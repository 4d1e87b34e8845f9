// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/handles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/editor/state.h"
#include "render/options/camera.h"

namespace nephos {
namespace {

// Keeps what the mouse holds, and where that has got to.
struct Grip {
    std::string name;       // empty: nothing
    TextPath of;            // what is selected
    bool is_moved = false;  // a mere click changes nothing
    double value = 0;
    Vec3 place{};
};
Grip grip;

// The knob of a handle. Returns whether the mouse holds it; `taken`: since this frame.
bool knob(Editor& editor, const std::string& name, const ImVec2& at, ImU32 colour, bool& taken) {
    const float radius = 0.42f * ImGui::GetFontSize();
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const bool near = std::hypot(mouse.x - at.x, mouse.y - at.y) < 1.6f * radius;
    taken = near && ImGui::IsMouseClicked(ImGuiMouseButton_Left) && grip.name.empty();
    if (taken) grip = {name, editor.selected, false, 0, {}};
    const bool mine = grip.name == name;
    constexpr float kFewPixels = 2;
    if (mine && ImGui::IsMouseDragging(ImGuiMouseButton_Left, kFewPixels)) grip.is_moved = true;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.AddCircleFilled(at, mine || near ? 1.25f * radius : radius, colour);
    list.AddCircle(at, radius, IM_COL32(0, 0, 0, 160));
    if (near && grip.name.empty()) ImGui::SetTooltip("%s", name.c_str());
    editor.controls.now["handle " + name] = {ImVec2(at.x - radius, at.y - radius),
                                             ImVec2(at.x + radius, at.y + radius)};
    return mine;
}

// Returns how far the mouse moved along a line of length `unit` that is `pixels` long in the picture.
double along(const ImVec2& pixels, double unit) {
    const double length2 = double(pixels.x) * pixels.x + double(pixels.y) * pixels.y;
    const ImVec2 by = ImGui::GetIO().MouseDelta;
    if (length2 < 4) return 0;  // seen end on
    return (double(by.x) * pixels.x + double(by.y) * pixels.y) / length2 * unit;
}

// Returns the value of the handle that is held, once it is another than `now`: one that is seen end on writes nothing.
std::optional<double> moved_from(double now) {
    return grip.is_moved && grip.value != now ? std::optional(grip.value) : std::nullopt;
}

}  // namespace

void world_line(const Editor& editor, const Vec3& from, const Vec3& to, ImU32 colour, float width) {
    const auto a = on_screen(editor, from), b = on_screen(editor, to);
    if (a && b) ImGui::GetWindowDrawList()->AddLine(*a, *b, colour, width);
}

void box_lines(const Editor& editor, const Vec3& min, const Vec3& max, ImU32 colour) {
    const auto corner = [&](int bits) {
        return Vec3{(bits & 1) != 0 ? max.x : min.x, (bits & 2) != 0 ? max.y : min.y,
                    (bits & 4) != 0 ? max.z : min.z};
    };
    for (int bits = 0; bits < 8; ++bits) {
        for (const int axis : {1, 2, 4}) {
            if ((bits & axis) == 0) world_line(editor, corner(bits), corner(bits | axis), colour);
        }
    }
}

void loop_lines(const Editor& editor, const std::function<Vec3(double)>& point, ImU32 colour, int parts) {
    Vec3 before = point(0);
    for (int n = 1; n <= parts; ++n) {
        const Vec3 at = point(double(n) / parts);
        world_line(editor, before, at, colour);
        before = at;
    }
}

void ellipsoid_lines(const Editor& editor, const Vec3& centre, const Vec3& axes, double yaw_deg,
                     ImU32 colour) {
    for (int plane = 0; plane < 3; ++plane) {
        loop_lines(
            editor,
            [&](double part) {
                const double angle = 2 * std::numbers::pi * part, c = std::cos(angle), s = std::sin(angle);
                const Vec3 unit = plane == 0 ? Vec3{c, s, 0} : plane == 1 ? Vec3{c, 0, s} : Vec3{0, c, s};
                return centre + turned(unit * axes, yaw_deg);
            },
            colour);
    }
}

Vec3 turned(const Vec3& v, double yaw_deg) {
    const double angle = yaw_deg * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
    return {c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

void let_go_of_handles(const Editor& editor) {
    if (!ImGui::IsMouseDown(ImGuiMouseButton_Left) || grip.of != editor.selected) grip.name.clear();
}

bool holds_handle() { return !grip.name.empty(); }

std::optional<double> axis_handle(Editor& editor, const std::string& name, const Vec3& from, const Vec3& axis,
                                  double size_m, ImU32 colour, double value) {
    const auto a = on_screen(editor, from), b = on_screen(editor, from + size_m * axis);
    if (!a || !b) return std::nullopt;
    ImGui::GetWindowDrawList()->AddLine(*a, *b, colour, 2.2f);
    bool taken = false;
    if (!knob(editor, name, *b, colour, taken)) return std::nullopt;
    if (taken) grip.value = value;
    grip.value += along(ImVec2(b->x - a->x, b->y - a->y), size_m);
    return moved_from(value);
}

std::optional<double> angle_handle(Editor& editor, const std::string& name,
                                   const std::function<Vec3(double)>& point, ImU32 colour, double value_deg) {
    constexpr double kStep = 4;
    const auto at = on_screen(editor, point(value_deg)), next = on_screen(editor, point(value_deg + kStep));
    if (!at || !next) return std::nullopt;
    bool taken = false;
    if (!knob(editor, name, *at, colour, taken)) return std::nullopt;
    if (taken) grip.value = value_deg;
    grip.value += along(ImVec2(next->x - at->x, next->y - at->y), kStep);
    return moved_from(value_deg);
}

std::optional<Vec3> free_handle(Editor& editor, const std::string& name, const Vec3& place, ImU32 colour) {
    const auto at = on_screen(editor, place);
    if (!at) return std::nullopt;
    bool taken = false;
    if (!knob(editor, name, *at, colour, taken)) return std::nullopt;
    if (taken) grip.place = place;
    const Camera camera = camera_of_view(editor);
    const CameraFrame axes = camera_frame(camera);
    const double depth = dot(place - camera.position_m, axes.forward);
    const double scale = 2 * axes.half_height * depth / camera.height;  // metres a pixel there
    const ImVec2 by = ImGui::GetIO().MouseDelta;
    grip.place = grip.place + (scale * double(by.x)) * axes.right - (scale * double(by.y)) * axes.up;
    return grip.is_moved ? std::optional(grip.place) : std::nullopt;
}

double tidy_m(const Editor& editor, double metres) {
    const Camera camera = camera_of_view(editor);
    const double pixel_m =
        2 * camera_frame(camera).half_height * length(camera.target_m - camera.position_m) / camera.height;
    const double unit = std::pow(10.0, std::floor(std::log10(std::clamp(pixel_m, 1e-3, 100.0))));
    return std::round(metres / unit) * unit;
}

}  // namespace nephos
