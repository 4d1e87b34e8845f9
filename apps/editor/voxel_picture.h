// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pictures of what clouds are made of instead of how they look: the cells of automata as cubes, by rays through the
// lattice, and the billboards of clouds that are drawn directly as frames of lines.

#include <span>
#include <vector>

#include "automaton/lattice.h"
#include "render/image/overlay.h"
#include "render/image/picture.h"
#include "simulation/simulation.h"
#include "simulation/sky_picture.h"

namespace nephos {

// The cells of a lattice.
struct CellLattice {
    BitPlaneView hum, act, cld;
    Placement placement;
};

// Which cells are cubes, and how they look.
struct VoxelStyle {
    bool hum = true, act = true, cld = true;
    double slab_low = 0, slab_high = 1;  // fractions of the lattice's height: only cells between them are there
    bool wireframe = false;              // edges alone; cubes still hide what lies behind them
};

// Adds the cubes of all lattices to a picture of linear colours; depth_m, which decides what hides what, holds infinity or
// distances of what was drawn before. The nearest cube of a pixel counts; of a cell with several bits cld before act before
// hum. Boundaries are open. Parallel; the same bits for any number of threads.
void draw_voxels(Picture& picture, const Camera& camera, std::span<const CellLattice> lattices,
                 const VoxelStyle& style);

// Returns the frames of billboards as they face the camera.
std::vector<WorldLine> billboard_lines(const DrawnClouds& clouds, const Camera& camera);

// Draws all of a frame in this way.
Picture voxel_picture(const Scene& scene, const FrameResult& frame, const Camera& camera, const VoxelStyle& style);

}  // namespace nephos
