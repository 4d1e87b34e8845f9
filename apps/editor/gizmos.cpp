// SPDX-License-Identifier: Apache-2.0
// Shapes of the scene as lines over the picture: the lattice, parcels of air, seeds and roots of a base model, rain areas.
// Those of the selected element have handles, which move, stretch and turn it.

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string_view>
#include <vector>

#include "apps/editor/handles.h"
#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "apps/editor/value_controls.h"
#include "core/text.h"

namespace nephos {
namespace {

constexpr ImU32 kYellow = IM_COL32(245, 215, 90, 255);
constexpr ImU32 kAxisColours[3] = {IM_COL32(235, 80, 80, 255), IM_COL32(90, 200, 90, 255),
                                   IM_COL32(90, 140, 250, 255)};

TextPath with(const TextPath& path, const char* name) {
    TextPath out = path;
    out.push_back({name, 0});
    return out;
}

// Returns a number for a key as it stands in the text: within what the key allows.
std::string number_of(const Editor& editor, const TextPath& table, const char* name, double metres) {
    const Key* const key = key_at(with(table, name));
    const double tidy = tidy_m(editor, metres);
    if (key == nullptr) return number_text(tidy, 9);
    const bool vanishes = key->limits.above_min && tidy <= key->limits.min;  // seen from afar
    return number_text(within_limits(key->limits, vanishes ? metres : tidy), 9);
}

// Holds a vector of which a handle has moved one number; the others keep their digits.
struct Moved {
    Vec3 value{};
    int axis = 0;
};

std::string vector_toml(const Editor& editor, const TextPath& table, const char* name, const Moved& moved) {
    std::string text;
    for (int axis = 0; axis < 3; ++axis)
        text +=
            (axis > 0 ? ", " : "[") + (axis == moved.axis ? number_of(editor, table, name, moved.value[axis])
                                                          : number_text(moved.value[axis]));
    return text + "]";
}

void drag_values(Editor& editor, const TextPath& table, const std::vector<TextEntry>& entries) {
    set_values(editor, table, entries, true);
}

void drag_number(Editor& editor, const TextPath& table, const char* name, double metres) {
    drag_values(editor, table, {{name, number_of(editor, table, name, metres)}});
}

constexpr Vec3 kUnits[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
constexpr const char* kMoves[3] = {"move east", "move north", "move up"};
constexpr const char* kSizes[3] = {"size x", "size y", "size z"};

// Handles of a place; returns the new one while one of them is held.
std::optional<Moved> place_handles(Editor& editor, const Vec3& origin, const Vec3& place, double arrow_m,
                                   int axes = 3) {
    std::optional<Moved> out;
    for (int axis = 0; axis < axes; ++axis) {
        const auto moved = axis_handle(editor, kMoves[axis], origin + place, kUnits[axis], arrow_m,
                                       kAxisColours[axis], place[axis]);
        if (!moved) continue;
        out = Moved{place, axis};
        out->value[axis] = *moved;
    }
    return out;
}

// Handles of half the size along axes that are turned; on their negative sides.
std::optional<Moved> size_handles(Editor& editor, const Vec3& centre, const Vec3& half, double yaw_deg,
                                  int axes = 3) {
    std::optional<Moved> out;
    for (int axis = 0; axis < axes; ++axis) {
        const auto size = axis_handle(editor, kSizes[axis], centre, turned(-1.0 * kUnits[axis], yaw_deg),
                                      half[axis], kYellow, half[axis]);
        if (!size) continue;
        out = Moved{half, axis};
        out->value[axis] = std::max(*size, 1.0);
    }
    return out;
}

// A handle that turns something about the vertical.
std::optional<double> turn_handle(Editor& editor, const Vec3& centre, double radius_m, double yaw_deg) {
    const auto point = [&](double yaw) { return centre + turned({radius_m, 0, 0}, yaw); };
    loop_lines(editor, [&](double part) { return point(360 * part); }, IM_COL32(200, 120, 235, 110));
    const auto now = angle_handle(editor, "turn", point, IM_COL32(200, 120, 235, 255), yaw_deg);
    if (!now) return std::nullopt;
    return std::round(std::remainder(*now, 360.0));
}

// Handles of a thing with a place, a size along its axes, and `yaw` where it can be turned.
void shape_handles(Editor& editor, const TextPath& table, const char* place_key, const char* size_key,
                   const Vec3& origin, const Vec3& place, const Vec3& half, std::optional<double> yaw_deg) {
    const double arrow = 0.6 * std::max({half.x, half.y, half.z});
    if (const auto moved = place_handles(editor, origin, place, arrow))
        drag_values(editor, table, {{place_key, vector_toml(editor, table, place_key, *moved)}});
    const bool whole = std::string_view(size_key) == "size_m";
    if (const auto size = size_handles(editor, origin + place, half, yaw_deg.value_or(0)))
        drag_values(editor, table,
                    {{size_key, vector_toml(editor, table, size_key,
                                            {(whole ? 2.0 : 1.0) * size->value, size->axis})}});
    if (!yaw_deg) return;
    if (const auto yaw = turn_handle(editor, origin + place, 1.3 * std::max(half.x, half.y), *yaw_deg))
        drag_values(editor, table, {{"yaw_deg", number_text(*yaw)}});
}

// A seed's root as an arrow with its opening; the chosen one has handles for its direction and its two openings.
void root_gizmo(Editor& editor, const TextPath& path, const Root& root, const Vec3& centre, double size_m,
                bool chosen) {
    const ImU32 blue = chosen ? IM_COL32(120, 190, 255, 255) : IM_COL32(60, 110, 235, 200);
    const auto towards = [&](double yaw_off, double pitch_off) {
        Root turned_root = root;
        turned_root.yaw_deg += yaw_off;
        turned_root.pitch_deg += pitch_off;
        return centre + size_m * axes_of(turned_root).ahead;
    };
    const Vec3 tip = towards(0, 0);
    world_line(editor, centre, tip, blue, chosen ? 2.4f : 1.6f);
    for (const double off : {-7.0, 7.0}) world_line(editor, 0.15 * centre + 0.85 * towards(off, 0), tip, blue, 1.6f);
    if (!chosen) return;
    const double a = 0.5 * root.open_yaw_deg, b = 0.5 * root.open_pitch_deg;
    const auto rim = [&](double part) {
        const double angle = 2 * std::numbers::pi * part;
        return towards(a * std::cos(angle), b * std::sin(angle));
    };
    loop_lines(editor, rim, IM_COL32(120, 190, 255, 130), 72);
    for (int n = 0; n < 8; ++n) world_line(editor, centre, rim(n / 8.0), IM_COL32(120, 190, 255, 70));
    if (const auto at = free_handle(editor, "root direction", tip, blue)) {
        const Vec3 way = *at - centre;
        const double flat = std::hypot(way.x, way.y);
        if (flat + std::abs(way.z) > 1e-6 * size_m) {
            const double yaw = flat > 1e-6 ? std::atan2(way.y, way.x) : root.yaw_deg * std::numbers::pi / 180;
            drag_values(editor, path,
                       {{"pitch_deg", number_text(std::round(std::atan2(way.z, flat) * 180 / std::numbers::pi))},
                        {"yaw_deg", number_text(std::round(yaw * 180 / std::numbers::pi))}});
        }
    }
    const auto opening = [&](const char* name, const char* key, double half,
                             const std::function<Vec3(double)>& point) {
        if (const auto now = angle_handle(editor, name, point, kYellow, half))
            drag_values(editor, path, {{key, number_text(std::clamp(std::round(2 * *now), 0.0, 360.0))}});
    };
    opening("root opening sideways", "open_yaw_deg", a, [&](double angle) { return towards(angle, 0); });
    opening("root opening upwards", "open_pitch_deg", b, [&](double angle) { return towards(0, angle); });
}

// The seeds of a model, in its own space about the camera's target, and the roots of the chosen one.
void model_gizmo(Editor& editor) {
    const TextPath model(editor.selected.begin(), editor.selected.begin() + 2);
    const Scene scene = *editor.document->current_scene();  // a handle replaces it
    const std::size_t index = editor.selected[1].index + models_from_files(editor);
    if (index >= scene.models.size()) return;
    const Vec3 origin = editor.camera.camera.target_m;
    if (const GeneratedCloud* made = generated_cloud(editor)) {
        for (const SeedBox& box : made->cloud.boxes) {
            if (box.level == 0) continue;  // a seed, below
            const Vec3 centre = origin + box.centre_m, half = 0.5 * box.size_m;
            box_lines(editor, centre - half, centre + half, IM_COL32(120, 190, 255, 110));
        }
    }
    for (std::size_t n = 0; n < scene.models[index].seeds.size(); ++n) {
        const Seed& seed = scene.models[index].seeds[n];
        TextPath path = with(model, "seeds");
        path.push_back({{}, n});
        const bool chosen =
            editor.selected.size() >= 4 && std::equal(path.begin(), path.end(), editor.selected.begin());
        const Vec3 half = 0.5 * seed.size_m, centre = origin + seed.position_m;
        box_lines(editor, centre - half, centre + half,
                  chosen ? IM_COL32(120, 190, 255, 255) : IM_COL32(60, 110, 235, 200));
        const bool in_roots = chosen && editor.selected.size() >= 6;
        for (std::size_t r = 0; r < seed.roots.size(); ++r) {
            TextPath root = with(path, "roots");
            root.push_back({{}, r});
            root_gizmo(editor, root, seed.roots[r], centre, 0.75 * length(seed.size_m),
                       in_roots && editor.selected[5].index == r);
        }
        if (chosen && !in_roots)
            shape_handles(editor, path, "position_m", "size_m", origin, seed.position_m, half, std::nullopt);
    }
}

// Rain areas that were placed by hand, as ellipses below the clouds.
void placed_rain(Editor& editor, std::size_t layer, const LayerOptions& options) {
    const double ground = editor.document->current_scene()->render.ground.height_m,
                 base = options.base_height_m.min;
    const bool in_rain = editor.selected.size() >= 5 && editor.selected[2].name == "rain" &&
                         editor.selected[3].name == "placed";
    for (std::size_t n = 0; n < options.rain.placed.size(); ++n) {
        const PlacedRain rain = options.rain.placed[n];
        const bool chosen = in_rain && editor.selected[4].index == n;
        const Vec3 centre{rain.x_m, rain.y_m, ground};
        const auto rim = [&](double part, double z) {
            const double angle = 2 * std::numbers::pi * part;
            return Vec3{0, 0, z - ground} + centre +
                   turned({rain.semi_a_m * std::cos(angle), rain.semi_b_m * std::sin(angle), 0}, rain.yaw_deg);
        };
        const ImU32 colour = chosen ? IM_COL32(130, 210, 230, 255) : IM_COL32(130, 210, 230, 150);
        for (const double z : {ground, base}) loop_lines(editor, [&](double part) { return rim(part, z); }, colour);
        for (int side = 0; side < 8; ++side) world_line(editor, rim(side / 8.0, ground), rim(side / 8.0, base), colour);
        if (!chosen) continue;
        const TextPath path = text_path("layer[" + std::to_string(layer) + "].rain.placed[" + std::to_string(n) + "]");
        const Vec3 half{rain.semi_a_m, rain.semi_b_m, 0};
        if (const auto at = place_handles(editor, {}, centre, 0.6 * std::max(half.x, half.y), 2))
            drag_number(editor, path, at->axis == 0 ? "x_m" : "y_m", at->value[at->axis]);
        if (const auto size = size_handles(editor, centre, half, rain.yaw_deg, 2))
            drag_number(editor, path, size->axis == 0 ? "semi_a_m" : "semi_b_m", size->value[size->axis]);
        if (const auto yaw = turn_handle(editor, centre, 1.3 * std::max(half.x, half.y), rain.yaw_deg))
            drag_values(editor, path, {{"yaw_deg", number_text(*yaw)}});
    }
}

// The box of a scatter, which moves and stretches, and the largest of its parcels.
void scatter_gizmo(Editor& editor, const TextPath& path, const EllipsoidScatter& scatter) {
    const ImU32 orange = IM_COL32(250, 190, 60, 230);
    const Vec3 low{scatter.x_m.min, scatter.y_m.min, scatter.z_m.min},
        high{scatter.x_m.max, scatter.y_m.max, scatter.z_m.max};
    const Vec3 centre = 0.5 * (low + high), half = 0.5 * (high - low);
    box_lines(editor, low, high, orange);
    ellipsoid_lines(editor, centre,
                    {scatter.semi_axis_x_m.max, scatter.semi_axis_y_m.max, scatter.semi_axis_z_m.max}, 0, orange);
    const std::optional<Moved> place = place_handles(editor, {}, centre, 0.4 * std::max(half.x, half.y));
    std::optional<Moved> size;
    if (!place) size = size_handles(editor, centre, glm::max(half, Vec3{1, 1, 1}), 0);
    if (!place && !size) return;
    constexpr const char* kRanges[3] = {"x_m", "y_m", "z_m"};
    const int axis = place ? place->axis : size->axis;
    const double at = place ? place->value[axis] : centre[axis],
                 reach = size ? size->value[axis] : half[axis];
    const auto number = [&](double metres) { return number_of(editor, path, kRanges[axis], metres); };
    const std::string range = low[axis] == high[axis] && !size  // flat, as it was
                                  ? number(at)
                                  : "[" + number(at - reach) + ", " + number(at + reach) + "]";
    drag_values(editor, path, {{kRanges[axis], range}});
}

}  // namespace

bool gizmos(Editor& editor) {
    let_go_of_handles(editor);
    const Scene* const now = editor.document->current_scene();
    if (!editor.show_gizmos || now == nullptr || editor.selected.empty()) return false;
    const std::string& section = editor.selected.front().name;
    if (section == "model" && editor.selected.size() >= 2) {
        model_gizmo(editor);
        return holds_handle();
    }
    const auto lattice_lines = [&](const Extent& cells, const Placement& place, ImU32 colour) {
        const double edge = place.cell_size_m;
        box_lines(editor, place.origin_m,
                  place.origin_m + Vec3{edge * cells.x, edge * cells.y, edge * cells.z}, colour);
    };
    const ImU32 white = IM_COL32(255, 255, 255, 150);
    if (section == "layer") {
        const std::vector<LayerOptions> layers = now->layers;  // a handle replaces the scene
        for (std::size_t n = 0; n < layers.size(); ++n) {
            const bool chosen = editor.selected.size() < 2 || editor.selected[1].index == n;
            if (!chosen) continue;
            lattice_lines(layers[n].extent, layers[n].placement, white);
            placed_rain(editor, n, layers[n]);
        }
        return holds_handle();
    }
    if (section == "lattice" || section == "field") {
        lattice_lines(now->automaton.extent, now->automaton.placement, white);
    }
    if (section != "field") return false;
    const FieldOptions field = now->automaton.field;
    for (std::size_t n = 0; n < field.ellipsoids.size(); ++n) {
        const Ellipsoid& parcel = field.ellipsoids[n];
        const TextPath path{{"field", 0}, {"ellipsoids", 0}, {{}, n}};
        const bool chosen = editor.selected == path;
        ellipsoid_lines(editor, parcel.centre_m, parcel.semi_axes_m, parcel.yaw_deg,
                        chosen ? IM_COL32(255, 225, 120, 255) : IM_COL32(250, 190, 60, 150));
        if (chosen)
            shape_handles(editor, path, "centre_m", "semi_axes_m", {}, parcel.centre_m, parcel.semi_axes_m,
                          parcel.yaw_deg);
    }
    if (editor.selected.size() >= 3 && editor.selected[1].name == "scatters" &&
        editor.selected[2].index < field.scatters.size()) {
        scatter_gizmo(editor, TextPath(editor.selected.begin(), editor.selected.begin() + 3),
                      field.scatters[editor.selected[2].index]);
    }
    return holds_handle();
}

}  // namespace nephos
