// SPDX-License-Identifier: Apache-2.0
// One height of the automaton over the picture: its bits, or the probabilities of its field.

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <span>
#include <vector>

#include "apps/editor/state.h"

namespace nephos {
namespace {

constexpr int kMostCells = 5000;  // that are drawn: a large slice is drawn coarser

// The lattice that is shown: of a scene with layers the one that is chosen, or the first with an automaton.
struct ShownLattice {
    BitPlaneView hum, act, cld;
    Placement placement;
    std::size_t layer = 0;
};

std::optional<ShownLattice> shown_lattice(const Editor& editor, const FrameResult& frame) {
    if (!editor.shown_scene) return std::nullopt;
    const Scene& scene = *editor.shown_scene;
    if (frame.layers.empty() && frame.hum) {
        return ShownLattice{*frame.hum, *frame.act, *frame.cld, scene.automaton.placement, 0};
    }
    std::optional<ShownLattice> first;
    for (std::size_t n = 0; n < frame.layers.size() && n < scene.layers.size(); ++n) {
        const LayerFrame& layer = frame.layers[n];
        if (!layer.hum) continue;
        const bool chosen =
            editor.selected.size() >= 2 && editor.selected[0].name == "layer" && editor.selected[1].index == n;
        if (first && !chosen) continue;
        first = ShownLattice{*layer.hum, *layer.act, *layer.cld, scene.layers[n].placement, n};
    }
    return first;
}

// Blue over green and yellow to red for 0..1; 0 is clear.
ImU32 heat(double value) {
    if (!(value > 0)) return 0;
    const double t = std::clamp(value, 0.0, 1.0);
    const auto part = [&](double centre) { return std::clamp(1.5 - 4 * std::abs(t - centre), 0.0, 1.0); };
    return IM_COL32(int(255 * part(0.8)), int(255 * part(0.5)), int(255 * part(0.2)), 90 + int(100 * t));
}

// Probability of one kind at a point: the field as field.h defines it, evaluated in double.
double probability_at(const Vec3& at, std::span<const ActiveEllipsoid> field, const Probabilities& background,
                      double Probabilities::*kind, bool is_extinction) {
    double out = background.*kind;
    for (const ActiveEllipsoid& active : field) {
        const Ellipsoid& e = active.ellipsoid;
        const Vec3 off = at - e.centre_m;
        const double angle = e.yaw_deg * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
        const double a = (c * off.x + s * off.y) / e.semi_axes_m.x, b = (c * off.y - s * off.x) / e.semi_axes_m.y,
                     h = off.z / e.semi_axes_m.z;
        const double u2 = a * a + b * b + h * h;
        if (u2 >= 1) continue;
        const double bell = (1 - u2) * (1 - u2), p = e.rim.*kind + (e.centre.*kind - e.rim.*kind) * bell;
        const double mixed = background.*kind + active.weight * (p - background.*kind);
        out = is_extinction ? std::min(out, mixed) : std::max(out, mixed);
    }
    return out;
}

}  // namespace

void slice_over_picture(Editor& editor) {
    if (editor.slice_of == SliceOf::nothing) return;
    const std::shared_ptr<const LiveFrame> frame = editor.live->frame();
    const auto shown = frame ? shown_lattice(editor, frame->frame) : std::nullopt;
    if (!shown) return;
    const Extent& cells = shown->cld.extent;
    editor.slice_cells = cells.z;
    const int k = std::clamp(editor.slice, 0, cells.z - 1);
    int stride = 1;
    while ((cells.x / stride) * (cells.y / stride) > kMostCells) ++stride;
    const Vec3& origin = shown->placement.origin_m;
    const double edge = shown->placement.cell_size_m;
    const auto corner = [&](double i, double j) {
        return origin + edge * Vec3{i, j, k + 0.5};
    };
    std::function<ImU32(int, int)> colour_of = [&](int i, int j) -> ImU32 {
        return shown->cld.get(i, j, k)   ? IM_COL32(225, 90, 90, 170)
               : shown->act.get(i, j, k) ? IM_COL32(240, 150, 60, 170)
               : shown->hum.get(i, j, k) ? IM_COL32(90, 190, 110, 120)
                                         : 0;
    };
    const bool of_bits = editor.slice_of == SliceOf::bits;
    double most = 0;
    std::vector<double> values;
    const std::size_t columns = std::size_t((cells.x + stride - 1) / stride);
    if (!of_bits && shown->layer < frame->fields.size()) {
        const LiveField& field = frame->fields[shown->layer];
        const bool extinction = editor.slice_of == SliceOf::p_ext;
        double Probabilities::*const kind = extinction                        ? &Probabilities::ext
                                            : editor.slice_of == SliceOf::p_act ? &Probabilities::act
                                                                                : &Probabilities::hum;
        for (int j = 0; j < cells.y; j += stride) {
            for (int i = 0; i < cells.x; i += stride) {
                const Vec3 at = corner(i + 0.5 * stride, j + 0.5 * stride);
                values.push_back(probability_at(at, field.ellipsoids, field.background, kind, extinction));
                most = std::max(most, values.back());
            }
        }
        colour_of = [&](int i, int j) {
            return heat(most > 0 ? values[std::size_t(j / stride) * columns + std::size_t(i / stride)] / most : 0);
        };
    }
    editor.slice_most = most;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    for (int j = 0; j < cells.y; j += stride) {
        for (int i = 0; i < cells.x; i += stride) {
            const ImU32 colour = colour_of(i, j);
            if (colour == 0) continue;
            const auto a = on_screen(editor, corner(i, j)), b = on_screen(editor, corner(i + stride, j)),
                       c = on_screen(editor, corner(i + stride, j + stride)),
                       d = on_screen(editor, corner(i, j + stride));
            if (a && b && c && d) list.AddQuadFilled(*a, *b, *c, *d, colour);
        }
    }
}

}  // namespace nephos
