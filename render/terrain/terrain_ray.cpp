// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain_ray.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace nephos {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

// The part of a ray over the map's rectangle, as distances.
struct Part {
    double begin = 0, end = 0;
};

Part part_over(const HeightMap& map, const TerrainRay& ray, double begin, double end) {
    const auto cut = [&](double from, double way, double low, double high) {
        if (way == 0) {
            if (from < low || from > high) end = -kNever;
            return;
        }
        const double a = (low - from) / way, b = (high - from) / way;
        begin = std::max(begin, std::min(a, b));
        end = std::min(end, std::max(a, b));
    };
    cut(ray.from_m.x, ray.direction.x, map.west_m, map.east_m());
    cut(ray.from_m.y, ray.direction.y, map.south_m, map.north_m());
    return {begin, end};
}

// The lowest point of a ray between two distances: it is a parabola that opens upwards.
double lowest(const TerrainRay& ray, double begin, double end) {
    const double curve = ray.bend * (1 - ray.direction.z * ray.direction.z);
    if (curve <= 0) return ray.height_m(ray.direction.z < 0 ? end : begin);
    return ray.height_m(std::clamp(-0.5 * ray.direction.z / curve, begin, end));
}

// A ray in units of cells.
struct GridRay {
    double x = 0, y = 0, step_x = 0, step_y = 0;
};

// The first root of height - surface in a cell, with the ray's place in it as s = t - begin from 0 to `length`.
double in_cell(const HeightMap& map, const TerrainRay& ray, const GridRay& grid, int i, int j, double begin,
               double length) {
    const float* z = &map.z_m[std::size_t(j) * std::size_t(map.columns) + std::size_t(i)];
    const double z00 = double(z[0]), z10 = double(z[1]), z01 = double(z[map.columns]), z11 = double(z[map.columns + 1]);
    const double u = grid.x + grid.step_x * begin - i, v = grid.y + grid.step_y * begin - j;
    const double along_x = z10 - z00, along_y = z01 - z00, twist = z11 - z10 - z01 + z00;
    const double curve = ray.bend * (1 - ray.direction.z * ray.direction.z);
    // height(s) - surface(s) = c + b s + a s^2
    const double c = ray.height_m(begin) - (z00 + along_x * u + along_y * v + twist * u * v);
    const double b = ray.direction.z + 2 * curve * begin -
                     (along_x * grid.step_x + along_y * grid.step_y + twist * (u * grid.step_y + v * grid.step_x));
    const double a = curve - twist * grid.step_x * grid.step_y;
    if (c <= 0) return begin;
    const double square = b * b - 4 * a * c;
    if (square < 0) return kNever;
    // The roots c / q and q / a without cancellation: Press et al. 2007, equation 5.6.4.
    const double q = -0.5 * (b + std::copysign(std::sqrt(square), b));
    double first = kNever;
    for (const double root : {q != 0 ? c / q : kNever, a != 0 ? q / a : kNever})
        if (root >= 0 && root <= length) first = std::min(first, root);
    return begin + first;
}

}  // namespace

double terrain_distance(const HeightMap& map, const TerrainRay& ray, double begin_m, double end_m) {
    const Part part = part_over(map, ray, begin_m, end_m);
    if (!(part.begin < part.end) || lowest(ray, part.begin, part.end) > map.highest_m) return kNever;
    const GridRay grid{(ray.from_m.x - map.west_m) / map.step_x_m, (ray.from_m.y - map.south_m) / map.step_y_m,
                       ray.direction.x / map.step_x_m, ray.direction.y / map.step_y_m};
    const int columns = map.columns - 1, rows = map.rows - 1;
    double t = part.begin;
    int i = std::clamp(int(std::floor(grid.x + grid.step_x * t)), 0, columns - 1),
        j = std::clamp(int(std::floor(grid.y + grid.step_y * t)), 0, rows - 1);
    auto level = int(map.tops.size()) - 1;
    while (true) {
        const int column = i >> level, row = j >> level;
        const int west = column << level, south = row << level;
        const int east = std::min(west + (1 << level), columns), north = std::min(south + (1 << level), rows);
        const double to_x = grid.step_x > 0   ? (east - grid.x) / grid.step_x
                            : grid.step_x < 0 ? (west - grid.x) / grid.step_x
                                              : kNever,
                     to_y = grid.step_y > 0   ? (north - grid.y) / grid.step_y
                            : grid.step_y < 0 ? (south - grid.y) / grid.step_y
                                              : kNever;
        const double leaves = std::max(std::min({to_x, to_y, part.end}), t);
        const TerrainTops& tops = map.tops[std::size_t(level)];
        const double top = double(tops.z_m[std::size_t(row) * std::size_t(tops.columns) + std::size_t(column)]);
        if (lowest(ray, t, leaves) <= top) {
            if (level > 0) {
                --level;
                continue;
            }
            const double hit = in_cell(map, ray, grid, i, j, t, leaves - t);
            if (hit < kNever) return hit;
        }
        if (leaves >= part.end) return kNever;
        t = leaves;
        if (to_x <= to_y) {
            i = grid.step_x > 0 ? east : west - 1;
            j = std::clamp(int(std::floor(grid.y + grid.step_y * t)), south, north - 1);
        } else {
            j = grid.step_y > 0 ? north : south - 1;
            i = std::clamp(int(std::floor(grid.x + grid.step_x * t)), west, east - 1);
        }
        if (i < 0 || i >= columns || j < 0 || j >= rows) return kNever;
        level = std::min(level + 1, int(map.tops.size()) - 1);
    }
}

}  // namespace nephos
