// SPDX-License-Identifier: Apache-2.0
// Shapes of the scene as lines over the picture: the lattice, parcels of air, seeds of a base model. Those of the
// selected element have handles: its centre moves, its ends give it its size.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "core/text.h"

namespace nephos {
namespace {

void world_line(const Editor& editor, const Vec3& from, const Vec3& to, ImU32 colour, float width = 1.2f) {
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

Vec3 turned(const Vec3& v, double yaw_deg) {
    const double angle = yaw_deg * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
    return {c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

void ellipsoid_lines(const Editor& editor, const Vec3& centre, const Vec3& axes, double yaw_deg,
                     ImU32 colour) {
    constexpr int kParts = 40;
    for (int plane = 0; plane < 3; ++plane) {
        Vec3 before{};
        for (int n = 0; n <= kParts; ++n) {
            const double angle = 2 * std::numbers::pi * n / kParts, c = std::cos(angle), s = std::sin(angle);
            const Vec3 unit = plane == 0 ? Vec3{c, s, 0} : plane == 1 ? Vec3{c, 0, s} : Vec3{0, c, s};
            const Vec3 at = centre + turned({unit.x * axes.x, unit.y * axes.y, unit.z * axes.z}, yaw_deg);
            if (n > 0) world_line(editor, before, at, colour);
            before = at;
        }
    }
}

// A handle that the mouse takes. Returns true while it drags, with the metres that it went along `axis` (unit length).
struct Handle {
    bool dragging = false;
    double metres = 0;
};

Handle axis_handle(Editor& editor, const char* name, const Vec3& from, const Vec3& axis, double size_m,
                   ImU32 colour) {
    const auto a = on_screen(editor, from), b = on_screen(editor, from + size_m * axis);
    if (!a || !b) return {};
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.AddLine(*a, *b, colour, 2.2f);
    const float radius = 0.42f * ImGui::GetFontSize();
    static std::string taken;  // the handle that the mouse holds; one mouse
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const bool near = std::hypot(mouse.x - b->x, mouse.y - b->y) < 1.6f * radius;
    const bool down = ImGui::IsMouseDown(ImGuiMouseButton_Left);
    if (!down) taken.clear();
    if (near && ImGui::IsMouseClicked(ImGuiMouseButton_Left) && taken.empty()) taken = name;
    const bool mine = taken == name;
    list.AddCircleFilled(*b, mine || near ? 1.25f * radius : radius, colour);
    list.AddCircle(*b, radius, IM_COL32(0, 0, 0, 160));
    editor.controls.now[std::string("handle ") + name] = {ImVec2(b->x - radius, b->y - radius),
                                                          ImVec2(b->x + radius, b->y + radius)};
    if (!mine) return {};
    const double px = double(b->x) - a->x, py = double(b->y) - a->y, length2 = px * px + py * py;
    const ImVec2 by = ImGui::GetIO().MouseDelta;
    if (length2 < 4) return {true, 0};
    return {true, (by.x * px + by.y * py) / length2 * size_m};
}

std::string vector_toml(const Vec3& v) {
    return "[" + number_text(std::round(v.x), 7) + ", " + number_text(std::round(v.y), 7) + ", " +
           number_text(std::round(v.z), 7) + "]";
}

// The unrounded place of what is dragged: rounding to metres in every frame would lose slow moves.
struct Dragged {
    TextPath path;
    Vec3 value{};
};

Vec3& precise(const TextPath& path, const Vec3& now, bool dragging) {
    static Dragged dragged;  // one mouse
    if (!dragging || dragged.path != path) dragged = {path, now};
    return dragged.value;
}

constexpr ImU32 kAxisColours[3] = {IM_COL32(235, 80, 80, 255), IM_COL32(90, 200, 90, 255),
                                   IM_COL32(90, 140, 250, 255)};

// Handles of a thing with a place and a size along its axes. Returns true while one moves.
bool shape_handles(Editor& editor, const TextPath& place_path, const TextPath& size_path, Vec3 origin,
                   Vec3 place, Vec3 half_size, double yaw_deg) {
    bool drags = false;
    const Vec3 unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const double sizes[3] = {half_size.x, half_size.y, half_size.z};
    constexpr const char* kMoves[3] = {"move east", "move north", "move up"};
    constexpr const char* kSizes[3] = {"size x", "size y", "size z"};
    const double arrow = 0.6 * std::max({sizes[0], sizes[1], sizes[2]});
    for (int axis = 0; axis < 3; ++axis) {
        const Handle handle =
            axis_handle(editor, kMoves[axis], origin + place, unit[axis], arrow, kAxisColours[axis]);
        if (!handle.dragging) continue;
        drags = true;
        Vec3& exact = precise(place_path, place,
                              handle.metres != 0 || ImGui::IsMouseDragging(ImGuiMouseButton_Left, 0));
        exact = exact + handle.metres * unit[axis];
        set_value(editor, place_path, vector_toml(exact), true);
    }
    for (int axis = 0; axis < 3; ++axis) {
        const Vec3 way = turned(-1.0 * unit[axis], yaw_deg);
        const Handle handle =
            axis_handle(editor, kSizes[axis], origin + place, way, sizes[axis], IM_COL32(245, 215, 90, 255));
        if (!handle.dragging) continue;
        drags = true;
        Vec3& exact = precise(size_path, half_size,
                              handle.metres != 0 || ImGui::IsMouseDragging(ImGuiMouseButton_Left, 0));
        exact = exact + handle.metres * unit[axis];
        exact = {std::max(exact.x, 1.0), std::max(exact.y, 1.0), std::max(exact.z, 1.0)};
        const bool whole_size = size_path.back().name == "size_m";
        set_value(editor, size_path, vector_toml(whole_size ? 2.0 * exact : exact), true);
    }
    return drags;
}

Vec3 vector_of(const Node* node, const Vec3& otherwise) {
    if (node == nullptr || node->items.size() != 3) return otherwise;
    const auto number = [&](std::size_t n) {
        const Node& item = node->items[n];
        return item.kind == Node::Kind::integer ? double(item.integer) : item.number;
    };
    return {number(0), number(1), number(2)};
}

TextPath with(const TextPath& path, const char* name) {
    TextPath out = path;
    out.push_back({name, 0});
    return out;
}

// Returns the origin of a model's own space while its seeds are edited: the camera's target.
bool model_gizmo(Editor& editor) {
    const TextPath model(editor.selected.begin(), editor.selected.begin() + 2);
    const auto count = [&] {  // asked again after each seed: a handle replaces the values
        const Node* seeds = value_node(editor.document->values(), with(model, "seeds"));
        return seeds != nullptr ? seeds->items.size() : 0;
    };
    const Vec3 origin = editor.camera.camera.target_m;
    bool drags = false;
    for (std::size_t n = 0; n < count(); ++n) {
        TextPath path = with(model, "seeds");
        path.push_back({{}, n});
        const Vec3 place = vector_of(value_node(editor.document->values(), with(path, "position_m")), {});
        const Vec3 size =
            vector_of(value_node(editor.document->values(), with(path, "size_m")), {100, 100, 100});
        const bool chosen =
            editor.selected.size() >= 4 && std::equal(path.begin(), path.end(), editor.selected.begin());
        const Vec3 half = 0.5 * size;
        box_lines(editor, origin + (place - half), origin + (place + half),
                  chosen ? IM_COL32(120, 190, 255, 255) : IM_COL32(60, 110, 235, 200));
        if (chosen) {
            drags |=
                shape_handles(editor, with(path, "position_m"), with(path, "size_m"), origin, place, half, 0);
        }
    }
    return drags;
}

// The lattice that is shown: of a scene with layers the first with an automaton.
struct ShownBits {
    BitPlaneView hum, act, cld;
    Placement placement;
};
std::optional<ShownBits> shown_bits(const Editor& editor, const FrameResult& frame) {
    if (!editor.shown_scene) return std::nullopt;
    const Scene& scene = *editor.shown_scene;
    if (frame.layers.empty() && frame.hum) {
        return ShownBits{*frame.hum, *frame.act, *frame.cld, scene.automaton.placement};
    }
    for (std::size_t n = 0; n < frame.layers.size() && n < scene.layers.size(); ++n) {
        const LayerFrame& layer = frame.layers[n];
        if (layer.hum) return ShownBits{*layer.hum, *layer.act, *layer.cld, scene.layers[n].placement};
    }
    return std::nullopt;
}

}  // namespace

void slice_of_bits(Editor& editor) {
    if (!editor.show_slice) return;
    const std::shared_ptr<const LiveFrame> frame = editor.live.frame();
    const auto bits = frame ? shown_bits(editor, frame->frame) : std::nullopt;
    if (!bits) return;
    constexpr int kMostCells = 5000;  // that are looked at: a large slice is drawn coarser
    const Extent& cells = bits->cld.extent;
    const int k = std::clamp(editor.slice, 0, cells.z - 1);
    int stride = 1;
    while ((cells.x / stride) * (cells.y / stride) > kMostCells) ++stride;
    const Vec3& origin = bits->placement.origin_m;
    const double edge = bits->placement.cell_size_m;
    const auto at = [&](int i, int j) {
        return on_screen(editor, {origin.x + edge * i, origin.y + edge * j, origin.z + edge * (k + 0.5)});
    };
    ImDrawList& list = *ImGui::GetWindowDrawList();
    for (int j = 0; j < cells.y; j += stride) {
        for (int i = 0; i < cells.x; i += stride) {
            const ImU32 colour = bits->cld.get(i, j, k)   ? IM_COL32(225, 90, 90, 170)
                                 : bits->act.get(i, j, k) ? IM_COL32(240, 150, 60, 170)
                                 : bits->hum.get(i, j, k) ? IM_COL32(90, 190, 110, 120)
                                                          : 0;
            if (colour == 0) continue;
            const auto a = at(i, j), b = at(i + stride, j), c = at(i + stride, j + stride),
                       d = at(i, j + stride);
            if (a && b && c && d) list.AddQuadFilled(*a, *b, *c, *d, colour);
        }
    }
}

bool gizmos(Editor& editor) {
    const std::optional<Scene>& scene = editor.document->scene();
    if (!editor.show_gizmos || !scene || editor.selected.empty()) return false;
    const std::string& section = editor.selected.front().name;
    if (section == "model" && editor.selected.size() >= 2) return model_gizmo(editor);
    const auto lattice_lines = [&](const Extent& cells, const Placement& place, ImU32 colour) {
        const double edge = place.cell_size_m;
        box_lines(editor, place.origin_m,
                  place.origin_m + Vec3{edge * cells.x, edge * cells.y, edge * cells.z}, colour);
    };
    const ImU32 white = IM_COL32(255, 255, 255, 150);
    if (section == "layer") {
        for (std::size_t n = 0; n < scene->layers.size(); ++n) {
            const bool chosen = editor.selected.size() < 2 || editor.selected[1].index == n;
            if (chosen) lattice_lines(scene->layers[n].extent, scene->layers[n].placement, white);
        }
        return false;
    }
    if (section == "lattice" || section == "field") {
        lattice_lines(scene->automaton.extent, scene->automaton.placement, white);
    }
    if (section != "field") return false;
    bool drags = false;
    for (std::size_t n = 0; n < scene->automaton.field.ellipsoids.size(); ++n) {
        const Ellipsoid parcel = scene->automaton.field.ellipsoids[n];  // a handle replaces the scene
        const TextPath path{{"field", 0}, {"ellipsoids", 0}, {{}, n}};
        const bool chosen = editor.selected == path;
        ellipsoid_lines(editor, parcel.centre_m, parcel.semi_axes_m, parcel.yaw_deg,
                        chosen ? IM_COL32(255, 225, 120, 255) : IM_COL32(250, 190, 60, 150));
        if (chosen) {
            drags |= shape_handles(editor, with(path, "centre_m"), with(path, "semi_axes_m"), {},
                                   parcel.centre_m, parcel.semi_axes_m, parcel.yaw_deg);
        }
    }
    if (editor.selected.size() >= 3 && editor.selected[1].name == "scatters" &&
        editor.selected[2].index < scene->automaton.field.scatters.size()) {
        const EllipsoidScatter& scatter = scene->automaton.field.scatters[editor.selected[2].index];
        const ImU32 orange = IM_COL32(250, 190, 60, 230);
        box_lines(editor, {scatter.x_m.min, scatter.y_m.min, scatter.z_m.min},
                  {scatter.x_m.max, scatter.y_m.max, scatter.z_m.max}, orange);
        const Vec3 centre{0.5 * (scatter.x_m.min + scatter.x_m.max),
                          0.5 * (scatter.y_m.min + scatter.y_m.max),
                          0.5 * (scatter.z_m.min + scatter.z_m.max)};
        ellipsoid_lines(editor, centre,
                        {scatter.semi_axis_x_m.max, scatter.semi_axis_y_m.max, scatter.semi_axis_z_m.max}, 0,
                        orange);
    }
    return drags;
}

}  // namespace nephos
