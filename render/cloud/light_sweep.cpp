// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/light_sweep.h"

#include <algorithm>
#include <cmath>

#include "render/cloud/table_rows.h"

namespace nephos {
namespace {

constexpr int kCells = CoverageField::kBrickCells;

// Interpolates between number(x, y) at four whole places around (u, v).
template <class Number>
float bilinear(double u, double v, const Number& number) {
    const double u0 = std::floor(u), v0 = std::floor(v);
    const int i = int(u0), j = int(v0);
    const auto fu = float(u - u0), fv = float(v - v0);
    const float low = number(i, j) + fu * (number(i + 1, j) - number(i, j)),
                high = number(i, j + 1) + fu * (number(i + 1, j + 1) - number(i, j + 1));
    return low + fv * (high - low);
}

int wrapped(int number, int count) {
    const int rest = number % count;
    return rest < 0 ? rest + count : rest;
}

}  // namespace

float LightFront::at(double u, double v) const {
    const int width = lines_[0], height = lines_[1];
    const auto line = [&](int x, int y) { return depth_[std::size_t(y) * std::size_t(width) + std::size_t(x)]; };
    if (periodic_) return bilinear(u, v, [&](int x, int y) { return line(wrapped(x, width), wrapped(y, height)); });
    return bilinear(u - first_[0], v - first_[1], [&](int x, int y) {
        return x < 0 || y < 0 || x >= width || y >= height ? 0.0f : line(x, y);
    });
}

void LightFront::resample(double u, double v, int width, int height, std::vector<float>& to) const {
    const double u0 = std::floor(u - first_[0]), v0 = std::floor(v - first_[1]);
    const auto fu = float(u - first_[0] - u0), fv = float(v - first_[1] - v0);
    const auto lines = std::size_t(lines_[0]);
    // The lines cover all nodes of the lattice: no look at their edges is needed.
    for (int y = 0; y < height; ++y) {
        const float* const low = &depth_[std::size_t(int(v0) + y) * lines + std::size_t(int(u0))];
        const float* const high = low + lines;
        float* const row = &to[std::size_t(y) * std::size_t(width)];
        for (int x = 0; x < width; ++x) {
            const float a = low[x] + fu * (low[x + 1] - low[x]), b = high[x] + fu * (high[x + 1] - high[x]);
            row[x] = a + fv * (b - a);
        }
    }
}

// Number of the line: where it crosses the plane at which the light enters.
Vec2 LightFront::place_of(const Vec3& point_m) const {
    const Vec3 cells = (point_m - corner_m_) / cell_m_;
    const double along = downwards_ ? plane_ - cells[axes_[2]] : cells[axes_[2]];
    return {cells[axes_[0]] - shift_[0] * along, cells[axes_[1]] - shift_[1] * along};
}

float LightFront::depth_at(const Vec3& point_m) const {
    if (depth_.empty()) return 0;
    const Vec2 place = place_of(point_m);
    return at(place.x, place.y);
}

// Lines are those of one period, on a torus: those that begin beside each other stay beside each other. In a slice a
// line crosses several cells where the light is low; it is sampled once for each.
LightFront periodic_sweep(const CoverageField& field, std::span<const float> extinction, const Vec3& to_light,
                          std::span<float> depths, std::span<float> corners) {
    constexpr double kLeastSine = 0.02;
    LightFront front;
    const auto& bricks = field.bricks();
    front.cell_m_ = 2 * field.node_m();
    front.corner_m_ = field.corner_m() + Vec3(field.home_m(), field.home_m(), 0);
    front.periodic_ = true;
    const int planes = bricks[2] * kCells, before = int(std::lround(field.home_m() / front.cell_m_));
    front.plane_ = planes;
    const double sine = std::max(to_light.z, kLeastSine);
    int parts = 1;
    for (int n = 0; n < 2; ++n) {
        front.shift_[n] = -to_light[n] / sine;
        front.lines_[n] = int(std::lround(field.period_m()[n] / front.cell_m_));
        parts = std::max(parts, int(std::ceil(std::abs(front.shift_[n]))));
    }
    const int width = front.lines_[0], height = front.lines_[1];
    const auto row_of = [width](auto& values, int row) { return values.data() + std::size_t(row) * std::size_t(width); };
    front.depth_.assign(std::size_t(width) * std::size_t(height), 0.0f);
    const auto length = float(front.cell_m_ * std::sqrt(1 + front.shift_[0] * front.shift_[0] + front.shift_[1] * front.shift_[1]) / parts);
    std::vector<float> slice(front.depth_.size()), nodes(front.depth_.size()), across(std::size_t(width) + 1);
    std::vector<std::vector<std::int32_t>> layers(static_cast<std::size_t>(bricks[2]));
    for (std::size_t n = 0; n < field.places().size(); ++n)
        layers[std::size_t(field.places()[n] / bricks[0] / bricks[1])].push_back(std::int32_t(n));
    const auto corner_of = [&](std::int32_t n, int axis) {  // in cells of the home period
        const std::int32_t at = field.places()[std::size_t(n)];
        return (axis == 0 ? at % bricks[0] : at / bricks[0] % bricks[1]) * kCells - before;
    };
    // Adds `scale` times a table at the places of all lines, displaced by (u, v) cells: bilinearly, on the torus.
    const auto add_displaced = [&](const std::vector<float>& from, double u, double v, float scale,
                                   std::vector<float>& to) {
        const int i = int(std::floor(u)), j = int(std::floor(v));
        const auto fu = float(u - i), fv = float(v - j);
        const int begin = wrapped(i, width);
        for (int y = 0; y < height; ++y) {
            const float* const a = row_of(from, wrapped(y + j, height));
            const float* const b = row_of(from, wrapped(y + j + 1, height));
            for (int x = 0; x < width; ++x) across[std::size_t(x)] = scale * (a[x] + fv * (b[x] - a[x]));
            across[std::size_t(width)] = across[0];
            float* const out = row_of(to, y);
            const float* const row = across.data();
            for (int x = 0; x < width - begin; ++x)
                out[x] += row[x + begin] + fu * (row[x + begin + 1] - row[x + begin]);
            for (int x = width - begin; x < width; ++x)
                out[x] += row[x + begin - width] + fu * (row[x + begin - width + 1] - row[x + begin - width]);
        }
    };
    const auto store_nodes = [&](int plane) {  // its depths, into the bricks on both sides
        const auto is_empty = [&](int layer) {
            return layer < 0 || layer >= int(layers.size()) || layers[std::size_t(layer)].empty();
        };
        const bool of_corners = !corners.empty() && plane % kCells == 0;
        if (!of_corners && is_empty(plane / kCells) && (plane % kCells != 0 || is_empty(plane / kCells - 1))) return;
        const double b = planes - plane;
        std::ranges::fill(nodes, 0.0f);
        add_displaced(front.depth_, -front.shift_[0] * b, -front.shift_[1] * b, 1, nodes);
        for (const int layer : {plane / kCells, plane / kCells - 1}) {
            const int local = plane - layer * kCells;
            if (layer < 0 || layer >= int(layers.size()) || local > kCells) continue;
            for (const std::int32_t n : layers[std::size_t(layer)])
                for (int v = 0; v < kLightNodes; ++v)
                    for (int u = 0; u < kLightNodes; ++u)
                        depths[std::size_t(n) * kLightNodesOfBrick +
                               std::size_t((local * kLightNodes + v) * kLightNodes + u)] =
                            row_of(nodes, wrapped(corner_of(n, 1) + v, height))[wrapped(corner_of(n, 0) + u, width)];
        }
        if (!of_corners) return;
        float* to = &corners[std::size_t(plane / kCells) * std::size_t((bricks[0] + 1) * (bricks[1] + 1))];
        for (int v = 0; v <= bricks[1]; ++v)
            for (int u = 0; u <= bricks[0]; ++u)
                *to++ = row_of(nodes, wrapped(v * kCells - before, height))[wrapped(u * kCells - before, width)];
    };
    for (int step = 0; step < planes; ++step) {
        const int s = planes - 1 - step;
        store_nodes(s + 1);
        const auto& layer = layers[std::size_t(s / kCells)];
        if (layer.empty()) continue;
        std::ranges::fill(slice, 0.0f);
        for (const std::int32_t n : layer) {
            const float* const from = &extinction[std::size_t(n) * 64] + s % kCells * kCells * kCells;
            for (int v = 0; v < kCells; ++v)
                for (int u = 0; u < kCells; ++u) {
                    const int x = corner_of(n, 0) + u, y = corner_of(n, 1) + v;
                    if (x >= 0 && y >= 0 && x < width && y < height) row_of(slice, y)[x] = from[v * kCells + u];
                }
        }
        for (int part = 0; part < parts; ++part) {
            const double along = step + (part + 0.5) / parts;
            add_displaced(slice, front.shift_[0] * along - 0.5, front.shift_[1] * along - 0.5, length, front.depth_);
        }
    }
    store_nodes(0);
    return front;
}

void LightFront::add_depths(const Vec3& first_m, const Vec3& step_m, std::span<float> depths) const {
    if (depth_.empty()) return;
    if (periodic_) {
        for (std::size_t n = 0; n < depths.size(); ++n) depths[n] += depth_at(first_m + double(n) * step_m);
        return;
    }
    // Numbers of the lines, as in depth_at().
    const auto line_of = [&](const Vec3& cells, double plane, int n) {
        const double along = downwards_ ? plane - cells[axes_[2]] : cells[axes_[2]];
        return cells[axes_[n]] - shift_[n] * along;
    };
    const Vec3 first = (first_m - corner_m_) / cell_m_, step = step_m / cell_m_;
    add_along({depth_, lines_[0], lines_[1]},
              {line_of(first, plane_, 0) - first_[0], line_of(first, plane_, 1) - first_[1], line_of(step, 0, 0),
               line_of(step, 0, 1)},
              depths);
}

LightFront sweep(const CoverageField& field, std::span<const float> extinction, const Vec3& to_light,
                 std::span<float> depths, std::span<float> corners) {
    if (field.period_m().x > 0) return periodic_sweep(field, extinction, to_light, depths, corners);
    LightFront front;
    int along = 2;
    for (int axis = 0; axis < 2; ++axis)
        if (std::abs(to_light[axis]) > std::abs(to_light[along]) * (along == 2 ? 1.0001 : 1)) along = axis;
    const int axes[3] = {along == 0 ? 1 : 0, along == 2 ? 1 : 2, along};
    std::copy_n(axes, 3, front.axes_);
    const auto& bricks = field.bricks();
    const int size[3] = {bricks[std::size_t(axes[0])] * kCells, bricks[std::size_t(axes[1])] * kCells,
                         bricks[std::size_t(along)] * kCells};
    front.corner_m_ = field.corner_m();
    front.cell_m_ = 2 * field.node_m();
    front.downwards_ = to_light[along] > 0;
    front.plane_ = size[2];
    const double slope = std::abs(to_light[along]);
    for (int n = 0; n < 2; ++n) {
        front.shift_[n] = -to_light[axes[n]] / slope;
        front.first_[n] = std::floor(std::min(0.0, -front.shift_[n] * size[2])) - 1;
        front.lines_[n] = size[n] + int(std::ceil(std::abs(front.shift_[n]) * size[2])) + 4;
    }
    const auto width = std::size_t(front.lines_[0]);
    front.depth_.assign(width * std::size_t(front.lines_[1]), 0.0f);
    const auto length = float(front.cell_m_ / slope);

    // The bricks of each layer along the light.
    std::vector<std::vector<std::int32_t>> layers(std::size_t(size[2] / kCells));
    struct Place {
        int across[2];
    };
    std::vector<Place> places(field.places().size());
    for (std::size_t n = 0; n < places.size(); ++n) {
        const std::int32_t at = field.places()[n];
        const int b[3] = {at % bricks[0], at / bricks[0] % bricks[1], at / bricks[0] / bricks[1]};
        places[n] = {{b[axes[0]] * kCells, b[axes[1]] * kCells}};
        layers[std::size_t(b[along])].push_back(std::int32_t(n));
    }
    constexpr int kCellStride[3] = {1, kCells, kCells * kCells},
                  kNodeStride[3] = {1, kLightNodes, kLightNodes * kLightNodes};
    std::vector<float> slice(std::size_t(size[0]) * std::size_t(size[1])), across(slice.size() + 1),
        nodes(std::size_t(size[0] + 1) * std::size_t(size[1] + 1));
    const auto store_nodes = [&](int plane) {  // its depths, into the bricks on both sides
        const double b = front.downwards_ ? size[2] - plane : plane;
        bool resampled = false;
        for (const int layer : {plane / kCells, plane / kCells - 1}) {
            const int local = plane - layer * kCells;
            if (layer < 0 || layer >= int(layers.size()) || local > kCells) continue;
            if (!resampled && !layers[std::size_t(layer)].empty()) {
                front.resample(-front.shift_[0] * b, -front.shift_[1] * b, size[0] + 1, size[1] + 1, nodes);
                resampled = true;
            }
            for (const std::int32_t n : layers[std::size_t(layer)]) {
                float* const to = &depths[std::size_t(n) * kLightNodesOfBrick] + local * kNodeStride[along];
                const Place& place = places[std::size_t(n)];
                for (int v = 0; v < kLightNodes; ++v) {
                    const float* const from = &nodes[std::size_t(place.across[1] + v) * std::size_t(size[0] + 1) +
                                                     std::size_t(place.across[0])];
                    for (int u = 0; u < kLightNodes; ++u)
                        to[u * kNodeStride[axes[0]] + v * kNodeStride[axes[1]]] = from[u];
                }
            }
        }
        if (corners.empty() || plane % kCells != 0) return;
        if (!resampled)
            front.resample(-front.shift_[0] * b, -front.shift_[1] * b, size[0] + 1, size[1] + 1, nodes);
        const int stride[3] = {1, bricks[0] + 1, (bricks[0] + 1) * (bricks[1] + 1)};
        for (int v = 0; v <= size[1] / kCells; ++v)
            for (int u = 0; u <= size[0] / kCells; ++u)
                corners[std::size_t(u) * std::size_t(stride[axes[0]]) + std::size_t(v) * std::size_t(stride[axes[1]]) +
                        std::size_t(plane / kCells) * std::size_t(stride[along])] =
                    nodes[std::size_t(v * kCells) * std::size_t(size[0] + 1) + std::size_t(u * kCells)];
    };
    for (int step = 0; step < size[2]; ++step) {
        const int s = front.downwards_ ? size[2] - 1 - step : step;  // slice
        store_nodes(front.downwards_ ? s + 1 : s);
        const auto& layer = layers[std::size_t(s / kCells)];
        if (layer.empty()) continue;
        std::ranges::fill(slice, 0.0f);
        for (const std::int32_t n : layer) {
            const float* const from = &extinction[std::size_t(n) * 64] + s % kCells * kCellStride[along];
            for (int v = 0; v < kCells; ++v)
                for (int u = 0; u < kCells; ++u)
                    slice[std::size_t(places[std::size_t(n)].across[1] + v) * std::size_t(size[0]) +
                          std::size_t(places[std::size_t(n)].across[0] + u)] =
                        from[u * kCellStride[axes[0]] + v * kCellStride[axes[1]]];
        }
        // Line (i, j) passes the middle of the slice at i + shift (step + 1/2): between two cells, by the same
        // weights on all lines.
        const double move[2] = {front.first_[0] + front.shift_[0] * (step + 0.5) - 0.5,
                                front.first_[1] + front.shift_[1] * (step + 0.5) - 0.5};
        const int whole[2] = {int(std::floor(move[0])), int(std::floor(move[1]))};
        const auto fu = float(move[0] - whole[0]), fv = float(move[1] - whole[1]);
        for (int j = std::max(-whole[1] - 1, 0); j < std::min(size[1] - whole[1], front.lines_[1]); ++j) {
            const int v = j + whole[1];
            const float* const a = v >= 0 ? &slice[std::size_t(v) * std::size_t(size[0])] : nullptr;
            const float* const b = v + 1 < size[1] ? &slice[std::size_t(v + 1) * std::size_t(size[0])] : nullptr;
            float* const row = across.data();
            for (int u = 0; u < size[0]; ++u)
                row[u] = length * ((a != nullptr ? (1 - fv) * a[u] : 0.0f) + (b != nullptr ? fv * b[u] : 0.0f));
            const int begin = std::max(-whole[0], 0), end = std::min(size[0] - 1 - whole[0], front.lines_[0]);
            float* const to = &front.depth_[std::size_t(j) * width];
            if (begin >= 1 && begin - 1 < front.lines_[0]) to[begin - 1] += fu * row[0];
            for (int i = begin; i < end; ++i)
                to[i] += (1 - fu) * row[i + whole[0]] + fu * row[i + whole[0] + 1];
            if (end >= 0 && end < front.lines_[0]) to[end] += (1 - fu) * row[size[0] - 1];
        }
    }
    store_nodes(front.downwards_ ? 0 : size[2]);
    return front;
}

}  // namespace nephos
