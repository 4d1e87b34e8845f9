// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/height_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/math.h"
#include "render/options/camera.h"
#include "render/options/height_format.h"
#include "render/terrain/erosion.h"

namespace nephos {
namespace {

std::size_t at(int columns, int i, int j) { return std::size_t(j) * std::size_t(columns) + std::size_t(i); }

void check_image(const HeightImage& image) {
    const auto within = [](int n) { return n >= 2 && n <= kMostHeights; };
    if (!within(image.columns) || !within(image.rows) ||
        image.heights.size() != std::size_t(image.columns) * std::size_t(image.rows)) {
        throw Error(ErrorCode::usage, "a height map of " + std::to_string(image.columns) + " x " +
                                          std::to_string(image.rows) + " heights, of which " +
                                          std::to_string(image.heights.size()) +
                                          " are given: expected 2 to 4096 on a side, and all of them");
    }
    if (!std::ranges::all_of(image.heights, [](float z) { return std::isfinite(z); }))
        throw Error(ErrorCode::usage, "a height map has a height that is not finite");
}

// Sides that go down to the ground leave nothing of a map that has sides alone.
void require_inner_heights(const HeightImage& image, double edge) {
    if (edge <= 0 || std::min(image.columns, image.rows) > 2) return;
    throw Error(ErrorCode::usage,
                "a height map of " + std::to_string(image.columns) + " x " + std::to_string(image.rows) +
                    " heights has nothing but sides, which `edge` in [terrain] leads down to the ground: "
                    "expected 3 or more heights on a side, or `edge` = 0");
}

// Takes the rows from the south, and leads the sides down to the ground.
void take_heights(const HeightImage& image, double edge, double ground_m, HeightMap& map) {
    map.z_m.resize(image.heights.size());
    const auto share = [edge](int i, int count) {
        if (edge <= 0) return 1.0;
        const double from_side = double(std::min(i, count - 1 - i)) / (count - 1);
        return smoothstep(0, edge, from_side);
    };
    for (int j = 0; j < map.rows; ++j) {
        const double up = share(j, map.rows);
        for (int i = 0; i < map.columns; ++i) {
            const double z = double(image.heights[at(map.columns, i, map.rows - 1 - j)]);
            const double part = up * share(i, map.columns);
            map.z_m[at(map.columns, i, j)] = float(ground_m + part * (z - ground_m));
        }
    }
    const auto [low, high] = std::ranges::minmax(map.z_m);
    map.lowest_m = double(low);
    map.highest_m = double(high);
}

TerrainTops tops_of_cells(const HeightMap& map) {
    TerrainTops tops{map.columns - 1, map.rows - 1, {}};
    tops.z_m.resize(std::size_t(tops.columns) * std::size_t(tops.rows));
    for (int j = 0; j < tops.rows; ++j) {
        for (int i = 0; i < tops.columns; ++i) {
            const float* low = &map.z_m[at(map.columns, i, j)];
            tops.z_m[at(tops.columns, i, j)] =
                std::max({low[0], low[1], low[map.columns], low[map.columns + 1]});
        }
    }
    return tops;
}

TerrainTops halved(const TerrainTops& fine) {
    TerrainTops tops{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
    tops.z_m.resize(std::size_t(tops.columns) * std::size_t(tops.rows));
    for (int j = 0; j < tops.rows; ++j) {
        for (int i = 0; i < tops.columns; ++i) {
            const int east = std::min(2 * i + 1, fine.columns - 1), north = std::min(2 * j + 1, fine.rows - 1);
            tops.z_m[at(tops.columns, i, j)] =
                std::max({fine.z_m[at(fine.columns, 2 * i, 2 * j)], fine.z_m[at(fine.columns, east, 2 * j)],
                          fine.z_m[at(fine.columns, 2 * i, north)], fine.z_m[at(fine.columns, east, north)]});
        }
    }
    return tops;
}

TerrainSlopes slopes_of_nodes(const HeightMap& map) {
    TerrainSlopes slopes{map.columns, map.rows, {}, {}};
    slopes.x.resize(map.z_m.size());
    slopes.y.resize(map.z_m.size());
    tbb::parallel_for(0, map.rows, [&](int j) {
        const int south = std::max(j - 1, 0), north = std::min(j + 1, map.rows - 1);
        for (int i = 0; i < map.columns; ++i) {
            const int west = std::max(i - 1, 0), east = std::min(i + 1, map.columns - 1);
            const auto z = [&](int a, int b) { return double(map.z_m[at(map.columns, a, b)]); };
            const std::size_t n = at(map.columns, i, j);
            slopes.x[n] = float((z(east, j) - z(west, j)) / ((east - west) * map.step_x_m));
            slopes.y[n] = float((z(i, north) - z(i, south)) / ((north - south) * map.step_y_m));
        }
    });
    return slopes;
}

// Every other node, with a weight of 1 2 1 along both axes.
std::vector<float> smoothed_half(const std::vector<float>& fine, int columns, int rows, int half_columns,
                                 int half_rows) {
    std::vector<float> out(std::size_t(half_columns) * std::size_t(half_rows));
    for (int j = 0; j < half_rows; ++j) {
        for (int i = 0; i < half_columns; ++i) {
            float sum = 0;
            for (int b = -1; b <= 1; ++b) {
                for (int a = -1; a <= 1; ++a) {
                    const int x = std::clamp(2 * i + a, 0, columns - 1), y = std::clamp(2 * j + b, 0, rows - 1);
                    sum += float((2 - std::abs(a)) * (2 - std::abs(b))) * fine[at(columns, x, y)];
                }
            }
            out[at(half_columns, i, j)] = sum / 16;
        }
    }
    return out;
}

TerrainSlopes halved(const TerrainSlopes& fine) {
    const int columns = (fine.columns + 1) / 2, rows = (fine.rows + 1) / 2;
    return {columns, rows, smoothed_half(fine.x, fine.columns, fine.rows, columns, rows),
            smoothed_half(fine.y, fine.columns, fine.rows, columns, rows)};
}

constexpr int kMostExposures = 1024;  // on a side
constexpr int kAzimuths = 12;
constexpr double kFarthestHorizon = 0.3;  // of the map's longer side

// Looks around from each node of the exposure's grid, at distances that double.
TerrainExposure exposure_of(const HeightMap& map) {
    TerrainExposure out;
    out.columns = std::min(map.columns, kMostExposures);
    out.rows = std::min(map.rows, kMostExposures);
    out.sky.resize(std::size_t(out.columns) * std::size_t(out.rows));
    out.shelter.resize(out.sky.size());
    const double width = map.east_m() - map.west_m, length = map.north_m() - map.south_m;
    const double first = std::max(map.step_x_m, map.step_y_m), last = kFarthestHorizon * std::max(width, length);
    std::array<Vec2, kAzimuths> ways;
    for (int n = 0; n < kAzimuths; ++n) {
        const double angle = 2 * std::numbers::pi * (n + 0.37) / kAzimuths;
        ways[std::size_t(n)] = {std::cos(angle), std::sin(angle)};
    }
    tbb::parallel_for(0, out.rows, [&](int j) {
        for (int i = 0; i < out.columns; ++i) {
            const double x = map.west_m + width * i / (out.columns - 1), y = map.south_m + length * j / (out.rows - 1);
            const double z = height_at(map, x, y);
            double sky = 0, shelter = 0;
            int near = 0;
            for (const Vec2& way : ways) {
                double steepest = 0;
                for (double r = first; r <= last; r *= 1.6) {
                    const double there = interpolated(map.z_m, map.columns, map.rows, (x + r * way.x - map.west_m) / width,
                                                      (y + r * way.y - map.south_m) / length);
                    const double slope = (there - z) / r;
                    steepest = std::max(steepest, slope);
                    if (r < 30 * first) {
                        shelter += slope;
                        ++near;
                    }
                }
                sky += 1 / (1 + steepest * steepest);  // cosine squared of the horizon's elevation
            }
            out.sky[at(out.columns, i, j)] = float(sky / kAzimuths);
            out.shelter[at(out.columns, i, j)] = float(near > 0 ? shelter / near : 0.0);
        }
    });
    return out;
}

constexpr double kWetterPerIndex = 0.45;

// Where water gathers, on the grid of the exposure.
void add_runs(const HeightMap& map, TerrainExposure& out) {
    const double width = map.east_m() - map.west_m, length = map.north_m() - map.south_m;
    const double step_x = width / (out.columns - 1), step_y = length / (out.rows - 1);
    std::vector<float> z(out.sky.size());
    for (int j = 0; j < out.rows; ++j)
        for (int i = 0; i < out.columns; ++i)
            z[at(out.columns, i, j)] = float(interpolated(map.z_m, map.columns, map.rows, double(i) / (out.columns - 1),
                                                          double(j) / (out.rows - 1)));
    const Drainage drainage = drainage_of(z, out.columns, out.rows);
    const std::vector<float> cells = drained_cells(drainage);
    out.pond_m.resize(z.size());
    std::vector<double> index(z.size());
    double sum = 0;
    for (int j = 0; j < out.rows; ++j) {
        for (int i = 0; i < out.columns; ++i) {
            const std::size_t n = at(out.columns, i, j);
            out.pond_m[n] = drainage.filled_m[n] - z[n];
            const MeanSlope slope = mean_slope(map, map.west_m + i * step_x, map.south_m + j * step_y, std::max(step_x, step_y));
            constexpr double kLeastSlope = 0.01;
            const double steep = std::max(std::hypot(slope.x, slope.y), kLeastSlope);
            index[n] = std::log(double(cells[n]) * std::sqrt(step_x * step_y) / steep);
            sum += index[n];
        }
    }
    const double mean = sum / double(index.size());
    out.gathers.resize(z.size());
    for (std::size_t n = 0; n < index.size(); ++n) out.gathers[n] = float(std::exp(kWetterPerIndex * (index[n] - mean)));
}

}  // namespace

double interpolated(const std::vector<float>& nodes, int columns, int rows, double across, double up) {
    const double x = std::clamp(across, 0.0, 1.0) * (columns - 1), y = std::clamp(up, 0.0, 1.0) * (rows - 1);
    const int i = std::min(int(x), columns - 2), j = std::min(int(y), rows - 2);
    const float* low = &nodes[at(columns, i, j)];
    const double u = x - i, v = y - j;
    const double south = double(low[0]) + u * (double(low[1]) - double(low[0])),
                 north = double(low[columns]) + u * (double(low[columns + 1]) - double(low[columns]));
    return south + v * (north - south);
}

HeightMap height_map(const HeightImage& world_m, const TerrainOptions& options, double ground_m) {
    check(options);
    check_image(world_m);
    require_inner_heights(world_m, options.edge);
    HeightMap map;
    map.columns = world_m.columns;
    map.rows = world_m.rows;
    map.west_m = options.x_m - 0.5 * options.width_m;
    map.south_m = options.y_m - 0.5 * options.length_m;
    map.step_x_m = options.width_m / (map.columns - 1);
    map.step_y_m = options.length_m / (map.rows - 1);
    take_heights(world_m, options.edge, ground_m, map);
    map.tops.push_back(tops_of_cells(map));
    while (map.tops.back().columns > 1 || map.tops.back().rows > 1) map.tops.push_back(halved(map.tops.back()));
    map.slopes.push_back(slopes_of_nodes(map));
    while (std::min(map.slopes.back().columns, map.slopes.back().rows) > 4)
        map.slopes.push_back(halved(map.slopes.back()));
    map.exposure = exposure_of(map);
    add_runs(map, map.exposure);
    return map;
}

double height_at(const HeightMap& map, double x_m, double y_m) {
    if (!map.contains(x_m, y_m)) return -1e9;
    return interpolated(map.z_m, map.columns, map.rows, (x_m - map.west_m) / (map.east_m() - map.west_m),
                        (y_m - map.south_m) / (map.north_m() - map.south_m));
}

double ground_height_at(const HeightMap* map, const Ground& ground, double x_m, double y_m) {
    return map == nullptr ? ground.height_m : std::max(ground.height_m, height_at(*map, x_m, y_m));
}

Camera standing_camera(const Camera& camera, const HeightMap* map, const Ground& ground, double time_s) {
    Camera out = camera_at(camera, time_s);
    if (!camera.above_ground) return out;
    for (Vec3* point : {&out.position_m, &out.target_m})
        point->z += ground_height_at(map, ground, point->x, point->y);
    out.above_ground = false;
    return out;
}

Camera standing_camera(const Camera& camera, const HeightMap* map, const Ground& ground,
                       std::span<const double> times_s) {
    if (!camera.above_ground) return camera;
    Camera out = camera;
    out.above_ground = false;
    out.path.clear();
    for (const double time_s : times_s) {
        const Camera at = standing_camera(camera, map, ground, time_s);
        out.path.push_back({time_s, at.position_m, at.target_m});
    }
    return out;
}

MeanSlope mean_slope(const HeightMap& map, double x_m, double y_m, double footprint_m) {
    const double step = std::max(map.step_x_m, map.step_y_m);
    const double level = std::clamp(std::log2(std::max(footprint_m / step, 1e-9)), 0.0, double(map.slopes.size() - 1));
    const auto fine = std::size_t(level);
    const std::size_t coarse = std::min(fine + 1, map.slopes.size() - 1);
    const double part = level - double(fine);
    const auto of = [&](std::size_t n) {
        const TerrainSlopes& s = map.slopes[n];
        // Nodes of a level stand on every 2^n-th one of the map.
        const double spacing = double(std::size_t{1} << n);
        const double across = (x_m - map.west_m) / (map.step_x_m * spacing * (s.columns - 1)),
                     up = (y_m - map.south_m) / (map.step_y_m * spacing * (s.rows - 1));
        return MeanSlope{interpolated(s.x, s.columns, s.rows, across, up),
                         interpolated(s.y, s.columns, s.rows, across, up)};
    };
    const MeanSlope a = of(fine);
    if (part <= 0) return a;
    const MeanSlope b = of(coarse);
    return {a.x + part * (b.x - a.x), a.y + part * (b.y - a.y)};
}

void require_above_ground(const Camera& camera, double time_s) {
    const double height_m = camera_at(camera, time_s).position_m.z;
    if (!camera.above_ground || height_m > 0) return;
    char text[200];
    std::snprintf(
        text, sizeof text,
        "camera: the position is %g m above the ground; expected more than 0, or camera.above_ground = "
        "false, by which heights are those of the world",
        height_m);
    throw Error(ErrorCode::usage, text);
}

void require_above_terrain(const HeightMap& map, const RenderOptions& options) {
    const Vec3& eye = options.camera.position_m;
    const double ground = ground_height_at(&map, options.ground, eye.x, eye.y);
    if (eye.z > ground) return;
    char text[300];
    std::snprintf(text, sizeof text,
                  "camera: the position %g, %g, %g is in the ground, which is %.1f m high there; expected a "
                  "point above it (with camera.above_ground = true, heights are counted from the ground)",
                  eye.x, eye.y, eye.z, ground);
    throw Error(ErrorCode::usage, text);
}

}  // namespace nephos
