// SPDX-License-Identifier: Apache-2.0
#pragma once

// The lowest cloud above each place and the water in it, from a density grid or from billboards: where rain of that cloud
// begins and how much of it falls.

#include <span>
#include <vector>

#include "automaton/lattice.h"
#include "core/vec.h"
#include "density/density_grid.h"

namespace nephos {

struct CloudBases {
    // Along an edge; larger grids have texels of several columns, of parts of one where no number of whole ones divides a
    // periodic grid. Texels are squares: of a grid both of whose sides are periodic and have no large divisor in common each
    // column is one, however many there are.
    static constexpr int kMostTexels = 192;

    double x_m = 0, y_m = 0;  // south-western corner, world
    double texel_m = 1;       // edge of a texel, > 0
    int columns = 0, rows = 0;
    // Of each texel, x fastest: its water, 1 - exp(-depth / 10) of the optical depth, 0..1; and that times the world height
    // of its base. Products, so that between a texel with cloud and one without the base is that of the cloud.
    std::vector<float> water, water_base_m;
    bool repeats_x = false,
         repeats_y = false;  // beyond the sides the opposite ones follow; else there is no water

    struct Column {
        double water = 0;
        double base_m = 0;  // world z; meaningless without water
    };
    // Returns the column at a place of the world, bilinearly.
    Column at(double x_m, double y_m) const;
};

// Returns the bases of a grid: in each column the lowest height at which the density is above a tenth of the column's
// largest, half a voxel within the cloud. Extinction in 1/m where density is 1, >= 0. `boundaries`: of the grid. Pure;
// thread-safe.
CloudBases cloud_bases(const DensityGrid& density, double extinction_per_m,
                       const Boundaries& boundaries = {});

// A piece of a cloud without density: a spheroid with an upright axis, as a billboard shows it from all sides.
struct CloudPiece {
    Vec3 centre_m{};                       // world
    double width_m = 100, height_m = 100;  // > 0
    double opacity = 1;                    // 0..1 in its middle, seen from below; 1 - r^2 of that at r radii beside it
};

// Returns the bases of pieces within a rectangle of the world: in each texel the lowest underside of the pieces above it,
// and as water what they hide together, 1 - the product of 1 - opacity. Pieces with an opacity of less than a tenth there
// make a base only where no other does; pieces smaller than a texel cover a part of it. Pure; thread-safe.
CloudBases cloud_bases(std::span<const CloudPiece> pieces, const Vec2& low_m, const Vec2& high_m);

}  // namespace nephos
