// SPDX-License-Identifier: Apache-2.0
#pragma once

// Density as the dense box that textures want: coarser if asked for, with its axes in the target's order, a border and
// padding, as 8 to 32 bits a voxel, with levels of detail (mips). Functions are pure and thread-safe.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "density/density_grid.h"

namespace nephos {

// The order in which a file has the world's axes. Data are permuted, never mirrored: each swap of two axes turns a
// right-handed frame into a left-handed one.
enum class AxisOrder {
    enu,     // x, y, z = east, north, up; right-handed
    unity,   // x, y, z = east, up, north; left-handed, y up
    unreal,  // x, y, z = north, east, up; left-handed, z up
};

// What stands around the voxels.
enum class Border {
    none,
    zero,  // one voxel of 0 on each side: clamped addresses read nothing
    wrap,  // one voxel of the opposite side where the box repeats, 0 elsewhere: a linear filter sees no seam
};

// How a grid becomes a box of voxels.
struct VolumeLayout {
    int factor = 1;  // voxels of the grid a voxel of the box, per axis: their mean
    AxisOrder axes = AxisOrder::enu;
    Border border = Border::none;
    std::array<bool, 3> periodic{};  // the grid's x, y, z
    int multiple = 1;                // sizes are padded with 0 at their upper ends to multiples of this
    bool power_of_two = false;       // and to powers of two
    bool operator==(const VolumeLayout&) const = default;
};

// A dense box of values, x fastest, then y, then z, in the order of its file.
struct Volume {
    int nx = 0, ny = 0, nz = 0;
    std::vector<float> values;

    std::size_t voxels() const { return std::size_t(nx) * std::size_t(ny) * std::size_t(nz); }
};

// Geometry of the box that lay_out() makes of a grid: all in the file's order of axes.
struct VolumeBox {
    std::array<int, 3> size{};     // voxels, border and padding included
    std::array<int, 3> padding{};  // voxels of 0 at the upper ends
    int border = 0;                // voxels on each side
    std::array<double, 3> voxel_m{};
    std::array<double, 3> min_m{},
        max_m{};                       // corners of the box, border and padding included; world coordinates
    std::array<int, 3> axis{0, 1, 2};  // the world's axis (0 east) behind each of the file's

    std::uint64_t voxels() const {
        return std::uint64_t(size[0]) * std::uint64_t(size[1]) * std::uint64_t(size[2]);
    }
};

VolumeBox box_of(Extent extent, const Placement& placement, const VolumeLayout& layout);

// Returns which of the file's axes repeat in the box: those of which nothing stands between its sides.
std::array<bool, 3> repeating_axes(const VolumeBox& box, const VolumeLayout& layout);

// Returns the memory that lay_out() takes for a box of so many voxels: a float for each, and a sum where there are several cells
// in one.
constexpr std::uint64_t layout_bytes(std::uint64_t voxels, int factor) {
    return voxels * (sizeof(float) + (factor > 1 ? sizeof(double) : 0));
}

// Fills the box. A voxel of several of the grid has their mean, so that the mass stays, at most their largest. Memory:
// layout_bytes().
Volume lay_out(const DensityGrid& density, const VolumeLayout& layout);

// Returns the grid of voxels `factor` times as large, which are means; takes layout_bytes() of them on the way,
// unless the factor is 1. Pure.
DensityGrid coarser(const DensityGrid& density, int factor);

// Returns the next level: means of 2 x 2 x 2 voxels. Precondition: even sizes, or 1.
Volume halved(const Volume& volume);

// Returns the number of levels down to at most `smallest` voxels on the longest side; and the multiple to which sizes
// are padded so that all of them divide, and every level has the same mass.
int level_count(const std::array<int, 3>& size, int smallest = 32);

// Returns the sizes of so many levels, the first of which is that of the box.
std::vector<std::array<int, 3>> level_sizes(const std::array<int, 3>& size, int levels);

// Form of a voxel in a file.
enum class VoxelType {
    r8,    // 8 bits, 0..1 as 0..255
    r16,   // 16 bits, 0..1 as 0..65535
    r16f,  // IEEE half, rounded to nearest even
    r32f,  // IEEE single
    bc4,   // BC4: blocks of 4 x 4 voxels of a slice in 8 bytes, two 8-bit ends and 3-bit indices
};

std::string_view type_name(VoxelType type);

// Returns the bytes of a box of this size: BC4 counts whole blocks.
std::size_t encoded_bytes(int nx, int ny, int nz, VoxelType type);
// Returns the sum of those of levels.
std::uint64_t encoded_bytes(const std::vector<std::array<int, 3>>& sizes, VoxelType type);

// Encodes value / scale; what is then outside of 0..1 is clamped in r8, r16 and bc4. Little-endian, x fastest.
std::vector<std::byte> encode(const Volume& volume, VoxelType type, float scale);

// Returns the values that a reader of the encoded voxels gets, times scale. Throws Error(io) unless the bytes are those
// of the size.
Volume decode(const std::byte* bytes, std::size_t count, int nx, int ny, int nz, VoxelType type, float scale);

// Returns the largest error of a type, relative to scale; of bc4 that of a block from 0 to 1.
double largest_error(VoxelType type);

}  // namespace nephos
