// SPDX-License-Identifier: Apache-2.0
#pragma once

// Options of the conversion from bits to density and of the files; plain data, filled by a scene or by
// another program.

#include <cstdint>

namespace nephos {

// Shape of the weights w(i',j',k',t') along each axis of the smoothing window; all are > 0 inside it.
enum class SmoothingKernel {
    box,       // 1
    tent,      // n0 + 1 - |n'|
    gaussian,  // exp(-(n'/s)^2 / 2), s = (n0 + 0.5) / 2, as whole numbers of at most 64: sums stay exact
};

// Stage 1 of D: the weighted mean of cld over |i'| <= i0, |j'| <= j0, |k'| <= k0, |t'| <= t0.
struct SmoothingOptions {
    SmoothingKernel kernel = SmoothingKernel::tent;
    int i0 = 2, j0 = 2, k0 = 1;  // cells, 0..16
    int t0 = 1;                  // steps, 0..16; steps that do not exist (before the first) have no weight
    bool operator==(const SmoothingOptions&) const = default;
};

// Detail below the voxel: an edge of a cloud that noise erodes, from bumps of `size_m` down to half a metre, while
// the mean density stays that of the metaballs (density/detail.h).
struct DetailOptions {
    bool enabled = true;
    double strength = 1;           // of the erosion, 0..1.4; 0: smooth as the metaballs, only with a crisp edge
    double size_m = 0;             // of the largest bumps, 20..5000; 0: four cells
    double stretch = 1;            // of the bumps along the wind, 1..50: fibres
    double wisps = 1;              // 0..1: hanging shreds at the base instead of round bumps
    double thermals = 0.5;         // 0..1: strength of towers and hollows of two and four times size_m
    // Of light where half of the space is cloud, 1..10000: less is crisper; 0: three quarters of a cell, but more in
    // clouds so thin that more than half of them would be lost.
    double mean_free_path_m = 0;
    bool to_horizon = true;  // pictures: a lattice that is periodic in x and y goes on to the horizon
    int apron_cells = 8;     // 0..64: from an open side inwards, over which cloud thins out
    bool operator==(const DetailOptions&) const = default;
};

struct DensityOptions {
    SmoothingOptions smoothing;
    double extinction_per_m = 0.02;      // extinction coefficient at density 1; > 0
    double metaball_radius_cells = 2.0;  // effective radius R of stage 2, 1..8 cells
    int refine = 1;     // voxels written per cell and axis, 1..8; above 1 the metaball field is resampled
    bool half = false;  // 16-bit floats in the file
    bool write_state = false;     // also the bool grids hum, act, cld
    bool write_velocity = false;  // also `vel`, the wind in m/s
    DetailOptions detail;         // of pictures, and of files that are refined
    bool operator==(const DensityOptions&) const = default;
};

}  // namespace nephos
