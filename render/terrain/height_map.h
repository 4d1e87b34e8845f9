// SPDX-License-Identifier: Apache-2.0
#pragma once

// Ground as a height map: heights at the nodes of a grid, bilinear between them, and what drawing needs of them. A map is
// made once and never changes; a ray meets it in terrain_ray.h.
//
//     tops[0]     of each cell the highest of its four nodes        the quadtree that rays step through:
//     tops[n]     of 2 x 2 elements of the level below              Tevs, Ihrke and Seidel 2008
//     slopes[0]   central differences at the nodes                  so that far pixels have the mean slope of what
//     slopes[n]   at every 2^n-th node, the mean around it          they cover
//     exposure    how much of the sky each place sees, and how far it lies below what surrounds it
//
// A node (i, j) is at (west_m + i step_x_m, south_m + j step_y_m); i runs east and fastest, j north.

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "core/vec.h"
#include "render/options/options.h"

namespace nephos {

// Heights as a file or a generator gives them: row 0 is the north, rows of `columns` from west to east.
struct HeightImage {
    int columns = 0, rows = 0;   // 2..kMostHeights
    std::vector<float> heights;  // columns * rows, finite
};
inline constexpr int kMostHeights = 4096;

struct TerrainTops {
    int columns = 0, rows = 0;
    std::vector<float> z_m;  // world
};

struct TerrainSlopes {
    int columns = 0, rows = 0;
    std::vector<float> x, y;  // dz/dx and dz/dy
};

// On a grid of its own, whose corners are those of the map.
struct TerrainExposure {
    int columns = 0, rows = 0;
    std::vector<float> sky;      // part of the sky's light on level ground that its surroundings leave, 0..1
    std::vector<float> shelter;  // mean slope up to what surrounds it: above 0 in hollows, below on crests
    // Film of water relative to what falls: by the topographic wetness index ln(a / tan slope), a the area that drains
    // through a metre of width (Beven and Kirkby 1979); the mean of its logarithm is 0.
    std::vector<float> gathers;
    std::vector<float> pond_m;  // depth of the hollow there when it is full; 0: none
};

struct HeightMap {
    int columns = 0, rows = 0;
    double west_m = 0, south_m = 0, step_x_m = 1, step_y_m = 1;
    double lowest_m = 0, highest_m = 0;
    std::vector<float> z_m;  // world
    std::vector<TerrainTops> tops;
    std::vector<TerrainSlopes> slopes;
    TerrainExposure exposure;

    double east_m() const { return west_m + (columns - 1) * step_x_m; }
    double north_m() const { return south_m + (rows - 1) * step_y_m; }
    bool contains(double x_m, double y_m) const {
        return x_m >= west_m && x_m <= east_m() && y_m >= south_m && y_m <= north_m();
    }
};

// Makes a map of heights in world metres; towards its sides it goes down to `ground_m`. Throws Error(usage) on an image whose
// size or numbers are not as stated, one that its sides leave nothing of, and as check(options). Deterministic; in parallel.
HeightMap height_map(const HeightImage& world_m, const TerrainOptions& options, double ground_m);

// Returns the height of the map's surface at a place, bilinear; below any ground outside of it. Pure.
double height_at(const HeightMap& map, double x_m, double y_m);

// Returns the height of the ground: that of the map where it is above Ground::height_m, else that; `map` may be null.
double ground_height_at(const HeightMap* map, const Ground& ground, double x_m, double y_m);

// Returns the camera at a time (camera_at()), with world heights if its own are above the ground there
// (Camera::above_ground). Heights above the ground are interpolated between key frames: the camera follows the relief and
// never enters it. `map` may be null. Pure.
Camera standing_camera(const Camera& camera, const HeightMap* map, const Ground& ground, double time_s);

// Returns a camera with world heights that is where standing_camera() is at these times, which rise; between them it is
// interpolated as any path. A camera whose heights are of the world is returned as it is. Pure.
Camera standing_camera(const Camera& camera, const HeightMap* map, const Ground& ground,
                       std::span<const double> times_s);

// Interpolates nodes of a grid that spans the map at fractions of it, bilinear; clamped to its sides.
double interpolated(const std::vector<float>& nodes, int columns, int rows, double across, double up);

// Mean slopes around a place, over about `footprint_m`.
struct MeanSlope {
    double x = 0, y = 0;
};
MeanSlope mean_slope(const HeightMap& map, double x_m, double y_m, double footprint_m);

// Throws Error(usage) when a camera whose heights are counted from the ground lies in it at a time, whatever its height there is.
void require_above_ground(const Camera& camera, double time_s);

// Throws Error(usage) when the camera is not above ground and map.
void require_above_terrain(const HeightMap& map, const RenderOptions& options);

}  // namespace nephos
