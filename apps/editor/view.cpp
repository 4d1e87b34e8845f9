// SPDX-License-Identifier: Apache-2.0
// The picture and its camera: fly, orbit, and what lies over it.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/editor/key_frame_text.h"
#include "apps/editor/state.h"
#include "core/text.h"
#include "density/metaballs.h"
#include "render/options/camera.h"
#include "simulation/framing.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;

// The direction of view as angles: yaw clockwise from north, pitch up.
struct Look {
    double yaw = 0, pitch = 0, distance = 1;
};

Look look_of(const Camera& camera) {
    const Vec3 way = camera.target_m - camera.position_m;
    const double distance = std::max(length(way), 1e-3);
    return {std::atan2(way.x, way.y), std::asin(std::clamp(way.z / distance, -1.0, 1.0)), distance};
}

Vec3 way_of(const Look& look) {
    return {look.distance * std::sin(look.yaw) * std::cos(look.pitch),
            look.distance * std::cos(look.yaw) * std::cos(look.pitch), look.distance * std::sin(look.pitch)};
}

Look turned(Look look, double right, double up) {
    look.yaw = std::remainder(look.yaw + right, 2 * kPi);
    look.pitch = std::clamp(look.pitch + up, -0.495 * kPi, 0.495 * kPi);
    return look;
}

// Metres that one pixel of the picture is at the camera's target.
double metres_a_pixel(const Editor& editor) {
    const Camera& camera = editor.camera.camera;
    const double height = std::max(1.0f, editor.view_max.y - editor.view_min.y);
    return 2 * look_of(camera).distance * std::tan(camera.vertical_fov_deg * kPi / 360) / height;
}

// The right button looks around from where one is, the left goes round the target, the middle shifts both, the wheel
// goes nearer.
void mouse(Editor& editor) {
    const ImGuiIO& io = ImGui::GetIO();
    Camera& camera = editor.camera.camera;
    const double radians = 0.004;
    const ImVec2 by = io.MouseDelta;
    const bool moved = by.x != 0 || by.y != 0;
    if (moved && ImGui::IsMouseDown(ImGuiMouseButton_Right)) {
        const Look look = turned(look_of(camera), radians * by.x, -radians * by.y);
        camera.target_m = camera.position_m + way_of(look);
        editor.camera.moved = true;
    } else if (moved && ImGui::IsMouseDown(ImGuiMouseButton_Middle)) {
        const CameraFrame frame = camera_frame(camera);
        const double scale = metres_a_pixel(editor);
        const Vec3 shift = (-by.x * scale) * frame.right + (by.y * scale) * frame.up;
        camera.position_m = camera.position_m + shift;
        camera.target_m = camera.target_m + shift;
        editor.camera.moved = true;
    } else if (moved && ImGui::IsMouseDown(ImGuiMouseButton_Left)) {
        const Look look = turned(look_of(camera), radians * by.x, -radians * by.y);
        camera.position_m = camera.target_m - way_of(look);
        editor.camera.moved = true;
    }
}

void wheel(Editor& editor) {
    const float turns = ImGui::GetIO().MouseWheel;
    if (turns == 0) return;
    Camera& camera = editor.camera.camera;
    Look look = look_of(camera);
    look.distance = std::clamp(look.distance * std::pow(0.88, double(turns)), 5.0, 5e5);
    camera.position_m = camera.target_m - way_of(look);
    editor.camera.moved = true;
}

bool is_down(char key) { return ImGui::IsKeyDown(int(key)); }

void keys(Editor& editor) {
    const ImGuiIO& io = ImGui::GetIO();
    if (io.WantTextInput || io.KeyCtrl || io.KeyAlt) return;
    const double ahead = (is_down('W') ? 1 : 0) - (is_down('S') ? 1 : 0);
    const double aside = (is_down('D') ? 1 : 0) - (is_down('A') ? 1 : 0);
    const double rise = (is_down('E') ? 1 : 0) - (is_down('Q') ? 1 : 0);
    if (ahead == 0 && aside == 0 && rise == 0) return;
    Camera& camera = editor.camera.camera;
    const CameraFrame frame = camera_frame(camera);
    // As fast as things are large: a second crosses a third of the way to the target.
    const double speed = std::clamp(look_of(camera).distance / 3, 20.0, 3000.0) * (io.KeyShift ? 4 : 1);
    const double way = speed * std::min(io.DeltaTime, 0.1f);
    const Vec3 shift = (way * ahead) * frame.forward + ((way * aside) * frame.right + Vec3{0, 0, way * rise});
    camera.position_m = camera.position_m + shift;
    camera.target_m = camera.target_m + shift;
    editor.camera.moved = true;
}

// A few words over the picture.
void captions(Editor& editor, const LiveStatus& status) {
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const auto write = [&](ImVec2 at, const std::string& text, ImU32 colour) {
        list.AddText(ImVec2(at.x + 1, at.y + 1), IM_COL32(0, 0, 0, 170), text.c_str());
        list.AddText(at, colour, text.c_str());
    };
    const float line = ImGui::GetTextLineHeightWithSpacing();
    const ImVec2 corner(editor.view_min.x + 0.6f * line, editor.view_min.y + 0.5f * line);
    const ImU32 white = IM_COL32(255, 255, 255, 230);
    if (!status.failure.empty()) {
        list.AddRectFilled(ImVec2(editor.view_min.x, editor.view_max.y - 3 * line), editor.view_max,
                           IM_COL32(90, 20, 20, 220));
        const std::string text = status.failure.substr(0, 400);
        list.AddText(nullptr, 0, ImVec2(corner.x, editor.view_max.y - 2.6f * line), white, text.c_str(),
                     nullptr, editor.view_max.x - corner.x - line);
    }
    if (editor.exported) {
        char export_text[160];
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - editor.exported->begin).count();
        std::snprintf(export_text, sizeof export_text, "writing the grid of step %llu, %.0f s",
                      static_cast<unsigned long long>(editor.exported->step), seconds);
        const ImVec2 at(editor.view_max.x - ImGui::CalcTextSize(export_text).x - line, corner.y);
        write(at, export_text, white);
        const float part = float(std::fmod(seconds, 1.5) / 1.5),
                    width = editor.view_max.x - 0.6f * line - at.x;
        list.AddRectFilled(ImVec2(at.x + 0.8f * part * width, at.y + line),
                           ImVec2(at.x + (0.8f * part + 0.2f) * width, at.y + line + 3),
                           IM_COL32(120, 180, 245, 230));
    }
    if (!editor.picture) {
        const bool has_problems = !editor.document->problems().empty();
        list.AddRectFilled(editor.view_min, editor.view_max, IM_COL32(20, 23, 26, 255));
        write(corner,
              has_problems ? "No picture: the scene has problems, which the tab Text lists"
                           : "Preparing the first picture\u2026",
              white);
        return;
    }
    const int seconds = int(std::lround(editor.picture->time_s));
    char text[128];
    std::snprintf(text, sizeof text, "step %llu   %d:%02d:%02d",
                  static_cast<unsigned long long>(editor.picture->step), seconds / 3600, seconds / 60 % 60,
                  seconds % 60);
    write(corner, text, white);
    if (status.goal > status.step + 1) {
        write(ImVec2(corner.x, corner.y + line),
              "simulating to step " + std::to_string(status.goal) + "\u2026", white);
    }
}

// Returns a place as a scene has it, to the centimetre.
std::string place_toml(const Vec3& place_m) {
    const auto part = [](double metres) { return number_text(std::round(100 * metres) / 100, 10); };
    return "[" + part(place_m.x) + ", " + part(place_m.y) + ", " + part(place_m.z) + "]";
}

std::vector<KeyFrame> key_frames(const std::vector<CameraKey>& keys) {
    std::vector<KeyFrame> out;
    for (const CameraKey& key : keys)
        out.push_back({key.time_s,
                       {{"position_m", place_toml(key.position_m)}, {"target_m", place_toml(key.target_m)}}});
    return out;
}

// Returns the path of a camera with a key frame at a time.
std::vector<CameraKey> camera_with_key(std::vector<CameraKey> path, const Camera& camera, double time_s) {
    const auto at = std::ranges::lower_bound(path, time_s, {}, &CameraKey::time_s);
    const CameraKey key{time_s, camera.position_m, camera.target_m};
    if (at != path.end() && at->time_s == time_s) {
        *at = key;
    } else {
        path.insert(at, key);
    }
    return path;
}

}  // namespace

Camera camera_of_view(const Editor& editor) {
    Camera camera = editor.camera.camera;
    camera.width = std::max(1, int(editor.view_max.x - editor.view_min.x));
    camera.height = std::max(1, int(editor.view_max.y - editor.view_min.y));
    return camera;
}

std::optional<ImVec2> on_screen(const Editor& editor, const Vec3& world_m) {
    const Camera camera = camera_of_view(editor);
    const PixelPosition at = project(camera_frame(camera), camera, world_m);
    if (!at.in_front || std::abs(at.x) > 1e5 || std::abs(at.y) > 1e5) return std::nullopt;
    return ImVec2(editor.view_min.x + float(at.x), editor.view_min.y + float(at.y));
}

void take_scene_camera(Editor& editor) {
    if (!editor.shown_scene) return;
    const double time_s = editor.picture ? editor.picture->time_s : 0;
    editor.camera.camera = camera_at(editor.shown_scene->render.camera, time_s);
    editor.camera.camera.path.clear();
    editor.camera.moved = false;
}

void keep_camera(Editor& editor) {
    const Scene* const scene = editor.document->current_scene();
    if (scene == nullptr)
        return say(editor, "The camera is not kept while the text has problems: mend them, or undo", true);
    const Camera& camera = editor.camera.camera;
    const Camera before = scene->render.camera;
    const double time_s = editor.picture ? editor.picture->time_s : 0;
    if (!before.path.empty() && before.above_ground)
        return say(editor,
                   "The camera is not kept: that of the scene follows the ground along a path, whose key "
                   "frames are set in [camera]",
                   true);
    const auto kept = [&](std::string text) {
        if (!before.path.empty()) {
            text = with_key_frames(text, text_path("camera.path"), key_frames(before.path),
                                   key_frames(camera_with_key(before.path, camera, time_s)));
        } else {
            text = with_value(text, text_path("camera.position_m"), place_toml(camera.position_m));
            text = with_value(text, text_path("camera.target_m"), place_toml(camera.target_m));
        }
        if (before.above_ground && !camera.above_ground)
            text = with_value(text, text_path("camera.above_ground"), "false");
        if (camera.vertical_fov_deg == before.vertical_fov_deg) return text;
        return with_value(text, text_path("camera.vertical_fov_deg"),
                          number_text(std::round(100 * camera.vertical_fov_deg) / 100, 5));
    };
    if (!change_text(editor, kept, "Camera")) return;
    say(editor, before.path.empty()
                    ? "The scene has this camera now"
                    : "The path of the scene's camera is here at " + number_text(time_s, 6) + " s now");
}

void frame_scene(Editor& editor) {
    const std::shared_ptr<const LiveFrame> frame = editor.live->frame();
    if (!frame || !editor.shown_scene) return;
    WorldBox box{{1e30, 1e30, 1e30}, {-1e30, -1e30, -1e30}};
    const auto add = [&](const DensityGrid& grid) {
        if (grid.active_voxels() == 0) return;
        const WorldBox of_grid = cloud_box(grid);
        box.min_m = {std::min(box.min_m.x, of_grid.min_m.x), std::min(box.min_m.y, of_grid.min_m.y),
                     std::min(box.min_m.z, of_grid.min_m.z)};
        box.max_m = {std::max(box.max_m.x, of_grid.max_m.x), std::max(box.max_m.y, of_grid.max_m.y),
                     std::max(box.max_m.z, of_grid.max_m.z)};
    };
    add(frame->frame.density);
    for (const LayerFrame& layer : frame->frame.layers) {
        add(layer.density);
        for (const SkyCloud& cloud : layer.clouds) {
            const Sphere sphere = layer.sky->sphere(cloud);
            const Vec3 reach{sphere.radius_m, sphere.radius_m, sphere.radius_m};
            if (!layer.direct) continue;
            box.min_m = {std::min(box.min_m.x, (sphere.centre_m - reach).x),
                         std::min(box.min_m.y, (sphere.centre_m - reach).y),
                         std::min(box.min_m.z, (sphere.centre_m - reach).z)};
            box.max_m = {std::max(box.max_m.x, (sphere.centre_m + reach).x),
                         std::max(box.max_m.y, (sphere.centre_m + reach).y),
                         std::max(box.max_m.z, (sphere.centre_m + reach).z)};
        }
    }
    if (box.min_m.x > box.max_m.x) {
        say(editor, "There is no cloud yet to look at", true);
        return;
    }
    Camera& camera = editor.camera.camera;
    camera = camera_of_view(editor);
    camera.above_ground = false;
    nephos::frame(camera, box, View::side, editor.shown_scene->render.ground.height_m);
    editor.camera.moved = true;
}

void view_panel(Editor& editor) {
    const ImVec2 size = ImGui::GetContentRegionAvail();
    editor.view_min = ImGui::GetCursorScreenPos();
    editor.view_max =
        ImVec2(editor.view_min.x + std::max(size.x, 1.0f), editor.view_min.y + std::max(size.y, 1.0f));
    editor.window->place_picture(editor.view_min, editor.view_max);
    // A child, so that controls over the picture take the mouse before it does.
    ImGui::SetNextItemWidth(-1);
    ImGui::InvisibleButton("view", ImVec2(std::max(size.x, 1.0f), std::max(size.y, 1.0f)),
                           ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                               ImGuiButtonFlags_MouseButtonMiddle);
    editor.controls.note("view");
    const bool hovered = ImGui::IsItemHovered(), active = ImGui::IsItemActive();
    ImGui::GetWindowDrawList()->PushClipRect(editor.view_min, editor.view_max, true);
    slice_over_picture(editor);
    const bool drags = gizmos(editor);
    if (hovered && !drags && editor.flash_on_click && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
        add_flash(editor, point_under(editor, ImGui::GetIO().MousePos));
        editor.flash_on_click = false;
    } else if (hovered && !drags && ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left)) {
        go_to_cloud(editor, ImGui::GetIO().MousePos);
    } else if (active && !drags) {
        mouse(editor);
    }
    if (hovered && editor.flash_on_click) ImGui::SetTooltip("Lightning here");
    if (hovered) wheel(editor);
    if (ImGui::IsWindowFocused() || hovered) keys(editor);
    captions(editor, editor.live->status());
    ImGui::GetWindowDrawList()->PopClipRect();

    const ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
    editor.view.width = std::clamp(int(std::lround(size.x * scale.x)), 16, 4096);
    editor.view.height = std::clamp(int(std::lround(size.y * scale.y)), 16, 4096);
    editor.view.camera = editor.camera.camera;
    editor.live->set_view(editor.view);
}

}  // namespace nephos
