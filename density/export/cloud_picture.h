// SPDX-License-Identifier: Apache-2.0
#pragma once

// One cloud as a picture of its voxels, as FlightGear takes it from the versions after 2024 on (FlightGear wiki, "3D
// clouds": voxel-based clouds; its reader cuts a picture of height W into W x W slices from the left). A picture is W high
// and W * H wide: H slices from the lowest up, side by side; in each the upper row is the northernmost and the left
// column the westernmost. Green is the type of the cloud, 0 wispy to 1 billowy, blue its density; red (distance from the
// edge) and alpha (distance to it) are computed by FlightGear, and are 0 and opaque here.

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "density/export/volume.h"

namespace nephos {

// A cloud alone in its box: `side` voxels to the east and north, `height` up. Codes of its density, x fastest, 0 for what is
// none of it.
struct CloudVoxels {
    int side = 0, height = 0;
    std::vector<std::uint8_t> codes;
    std::uint64_t cut = 0;  // voxels above the scale, which are it; 0 of a cloud that was read
};

// Returns the cloud of the greatest mass. Clouds of a sky touch where they are thin, so a cloud is what hangs together where
// it is dense: voxels of at least 0.3 of the largest density, each beside another of them, also across periodic sides;
// with them up to three voxels of its thin edge, as far as density / scale rounds to 1/255 at least. It stands in the
// middle of a square of 32, 64 or 128 voxels; a wider one, or one of more than 2,048 voxels up, is made coarser by means of
// whole voxels. Without any cloud the box is empty, 32 x 32 x 1. Pure.
CloudVoxels largest_cloud(const Volume& volume, const std::array<bool, 3>& periodic, float scale);

// Returns the most memory that laying a volume of this size out by a factor (volume.h), and largest_cloud() of it, take where at
// most `positive` of its voxels are above 0.
std::uint64_t largest_cloud_bytes(const std::array<int, 3>& size, const std::array<bool, 3>& periodic,
                                  int factor, std::uint64_t positive);

// Writes the picture; `type` 0..1. Throws Error(io) naming the file.
void write_cloud_picture(const std::filesystem::path& path, const CloudVoxels& cloud, double type);
// Reads one. Throws Error(io) naming the file when it is no such picture, of one type.
CloudVoxels read_cloud_picture(const std::filesystem::path& path);

}  // namespace nephos
