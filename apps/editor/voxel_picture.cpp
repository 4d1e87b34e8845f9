// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/voxel_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <tbb/parallel_for.h>

#include "render/options/camera.h"

namespace nephos {
namespace {

using Colour = std::array<float, 3>;

// As in the plots, linear.
constexpr Colour kHum{0.10f, 0.51f, 0.16f}, kAct{0.87f, 0.30f, 0.045f}, kCld{0.75f, 0.10f, 0.10f};
constexpr Colour kLine{0.55f, 0.75f, 1.0f};
constexpr Colour kAbove{0.018f, 0.026f, 0.042f}, kBelow{0.010f, 0.012f, 0.014f};  // behind everything
constexpr Rgb kBillboardLine{0.55, 0.75, 1.0};
// Of faces to the sides, north and south, below, above.
constexpr float kFaces[4] = {0.72f, 0.58f, 0.38f, 1.0f};

struct Hit {
    double distance = std::numeric_limits<double>::infinity();
    Colour colour{};
};

// Amanatides and Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987: cell after cell along the ray.
class CellWalk {
  public:
    CellWalk(const CellLattice& lattice, const VoxelStyle& style, const CameraFrame& axes, double pixel)
        : lattice_(lattice), style_(style), pixel_(pixel) {
        const Extent& cells = lattice.cld.extent;
        const double edge = lattice.placement.cell_size_m;
        low_ = {0, 0, std::floor(style.slab_low * cells.z + 1e-9)};
        high_ = {double(cells.x), double(cells.y), std::max(low_.z + 1, std::ceil(style.slab_high * cells.z - 1e-9))};
        high_.z = std::min(high_.z, double(cells.z));
        eye_ = (1 / edge) * (axes.position_m - lattice.placement.origin_m);
    }

    // `way`: unit length.
    void first(const Vec3& way, Hit& nearest) const {
        const double edge = lattice_.placement.cell_size_m;
        double enter = 0, leave = nearest.distance / edge;
        int face = 2;
        for (int axis = 0; axis < 3; ++axis) {
            if (way[axis] == 0) {
                if (eye_[axis] < low_[axis] || eye_[axis] >= high_[axis]) return;
                continue;
            }
            const double a = (low_[axis] - eye_[axis]) / way[axis], b = (high_[axis] - eye_[axis]) / way[axis];
            if (std::min(a, b) > enter) {
                enter = std::min(a, b);
                face = axis;
            }
            leave = std::min(leave, std::max(a, b));
        }
        if (enter >= leave) return;
        const Vec3 start = eye_ + enter * way;
        std::array<int, 3> cell{}, step{};
        std::array<double, 3> next{}, across{};
        for (int axis = 0; axis < 3; ++axis) {
            cell[std::size_t(axis)] = std::clamp(int(std::floor(start[axis])), int(low_[axis]), int(high_[axis]) - 1);
            const double v = way[axis];
            step[std::size_t(axis)] = v > 0 ? 1 : -1;
            const double border = cell[std::size_t(axis)] + (v > 0 ? 1 : 0);
            next[std::size_t(axis)] = v == 0 ? std::numeric_limits<double>::infinity() : (border - eye_[axis]) / v;
            across[std::size_t(axis)] = v == 0 ? 0 : std::abs(1 / v);
        }
        double at = enter;
        while (at < leave) {
            if (const Colour* colour = colour_of(cell)) {
                nearest.distance = at * edge;
                nearest.colour = shaded(*colour, eye_ + at * way, face, way, at);
                return;
            }
            const std::size_t axis = next[0] < next[1] ? (next[0] < next[2] ? 0 : 2) : (next[1] < next[2] ? 1 : 2);
            at = next[axis];
            next[axis] += across[axis];
            cell[axis] += step[axis];
            face = int(axis);
            if (cell[axis] < int(low_[int(axis)]) || cell[axis] >= int(high_[int(axis)])) return;
        }
    }

  private:
    const Colour* colour_of(const std::array<int, 3>& c) const {
        if (style_.cld && lattice_.cld.get(c[0], c[1], c[2])) return &kCld;
        if (style_.act && lattice_.act.get(c[0], c[1], c[2])) return &kAct;
        if (style_.hum && lattice_.hum.get(c[0], c[1], c[2])) return &kHum;
        return nullptr;
    }

    Colour shaded(const Colour& colour, const Vec3& at, int face, const Vec3& way, double distance) const {
        // How near the hit is to an edge of its face, in pixels.
        double nearest = 1;
        for (int axis = 0; axis < 3; ++axis) {
            if (axis == face) continue;
            const double part = at[axis] - std::floor(at[axis]);
            nearest = std::min({nearest, part, 1 - part});
        }
        const double pixel = std::max(pixel_ * distance, 1e-9);
        const auto line = float(std::clamp(1.3 - nearest / pixel, 0.0, 1.0) * std::clamp(0.25 / pixel - 0.5, 0.0, 1.0));
        const float light = face < 2 ? kFaces[face] : kFaces[way.z > 0 ? 2 : 3];
        Colour out{};
        for (std::size_t c = 0; c < 3; ++c) {
            const float body = style_.wireframe ? 0.06f * light * colour[c] : light * colour[c];
            const float edge = style_.wireframe ? kLine[c] * (0.25f + 0.75f * light) : 0.25f * body;
            out[c] = body + line * (edge - body);
        }
        return out;
    }

    const CellLattice& lattice_;
    const VoxelStyle& style_;
    double pixel_;  // of the picture at distance 1
    Vec3 low_{}, high_{}, eye_{};  // in cells
};

Picture empty_picture(const Camera& camera) {
    Picture picture;
    picture.width = camera.width;
    picture.height = camera.height;
    const CameraFrame axes = camera_frame(camera);
    picture.beauty.reserve(3 * picture.pixels());
    for (int y = 0; y < picture.height; ++y) {
        const Vec3 way = pixel_ray(axes, camera, 0.5 * picture.width, y + 0.5);
        const auto sky = float(std::clamp(0.5 + 4 * way.z, 0.0, 1.0));
        for (int x = 0; x < picture.width; ++x) {
            for (std::size_t c = 0; c < 3; ++c) picture.beauty.push_back(kBelow[c] + sky * (kAbove[c] - kBelow[c]));
        }
    }
    picture.transmittance.assign(picture.pixels(), 1.0f);
    picture.depth_m.assign(picture.pixels(), std::numeric_limits<float>::infinity());
    return picture;
}

std::vector<CellLattice> lattices_of(const Scene& scene, const FrameResult& frame) {
    std::vector<CellLattice> out;
    if (frame.layers.empty() && frame.hum) out.push_back({*frame.hum, *frame.act, *frame.cld, scene.automaton.placement});
    for (std::size_t n = 0; n < frame.layers.size() && n < scene.layers.size(); ++n) {
        const LayerFrame& layer = frame.layers[n];
        if (layer.hum) out.push_back({*layer.hum, *layer.act, *layer.cld, scene.layers[n].placement});
    }
    return out;
}

}  // namespace

void draw_voxels(Picture& picture, const Camera& camera, std::span<const CellLattice> lattices,
                 const VoxelStyle& style) {
    const CameraFrame axes = camera_frame(camera);
    const double pixel = 2 * axes.half_height / camera.height;
    std::vector<CellWalk> walks;
    for (const CellLattice& lattice : lattices) walks.emplace_back(lattice, style, axes, pixel);
    tbb::parallel_for(0, picture.height, [&](int y) {
        for (int x = 0; x < picture.width; ++x) {
            const std::size_t at = std::size_t(y) * std::size_t(picture.width) + std::size_t(x);
            Hit hit{double(picture.depth_m[at]), {}};
            const Vec3 way = pixel_ray(axes, camera, x + 0.5, y + 0.5);
            for (const CellWalk& walk : walks) walk.first(way, hit);
            if (!(hit.distance < double(picture.depth_m[at]))) continue;
            picture.depth_m[at] = float(hit.distance);
            picture.transmittance[at] = 0;
            std::copy(hit.colour.begin(), hit.colour.end(), picture.beauty.begin() + std::ptrdiff_t(3 * at));
        }
    });
}

std::vector<WorldLine> billboard_lines(const DrawnClouds& clouds, const Camera& camera) {
    const CameraFrame axes = camera_frame(camera);
    std::vector<WorldLine> lines;
    for (const CloudBillboard& billboard : clouds.billboards) {
        const Vec3 right = (0.5 * double(billboard.width_m)) * axes.right, up = (0.5 * double(billboard.height_m)) * axes.up;
        const Vec3& c = billboard.centre_m;
        const Vec3 corners[4] = {c - right - up, c + right - up, c + right + up, c - right + up};
        for (std::size_t n = 0; n < 4; ++n)
            lines.push_back({corners[n], corners[(n + 1) % 4], kBillboardLine, 1.0});
    }
    return lines;
}

Picture voxel_picture(const Scene& scene, const FrameResult& frame, const Camera& camera, const VoxelStyle& style) {
    Picture picture = empty_picture(camera);
    const std::vector<CellLattice> lattices = lattices_of(scene, frame);
    draw_voxels(picture, camera, lattices, style);
    RenderOptions options = scene.render;
    options.camera = camera;
    for (const LayerFrame& layer : frame.layers) {
        if (!layer.direct || layer.sky == nullptr) continue;
        DrawnClouds drawn;
        SkyBillboards().append(*layer.sky, layer.clouds, options, std::nullopt, drawn, true, std::nullopt,
                               std::nullopt, frame.time_s);
        draw_lines(picture, camera, billboard_lines(drawn, camera));
    }
    return picture;
}

}  // namespace nephos
