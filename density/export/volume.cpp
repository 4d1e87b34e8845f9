// SPDX-License-Identifier: Apache-2.0
#include "density/export/volume.h"

#include <algorithm>
#include <bit>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "density/export/voxel_kernel.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

std::array<int, 3> world_axes(AxisOrder order) {
    switch (order) {
        case AxisOrder::unity:
            return {0, 2, 1};
        case AxisOrder::unreal:
            return {1, 0, 2};
        case AxisOrder::enu:
            break;
    }
    return {0, 1, 2};
}

int up_to_multiple(int n, int multiple) { return (n + multiple - 1) / multiple * multiple; }

// Copies the voxels beside the border from the opposite side, on one axis of the file.
void wrap_axis(Volume& v, int axis, int inner) {
    const std::array<int, 3> size{v.nx, v.ny, v.nz};
    const std::array<std::size_t, 3> stride{1, std::size_t(v.nx), std::size_t(v.nx) * std::size_t(v.ny)};
    const auto a = std::size_t(axis), b = std::size_t((axis + 1) % 3), c = std::size_t((axis + 2) % 3);
    for (int j = 0; j < size[b]; ++j) {
        for (int k = 0; k < size[c]; ++k) {
            float* row = v.values.data() + std::size_t(j) * stride[b] + std::size_t(k) * stride[c];
            row[0] = row[std::size_t(inner) * stride[a]];
            row[std::size_t(inner + 1) * stride[a]] = row[stride[a]];
        }
    }
}

}  // namespace

VolumeBox box_of(Extent extent, const Placement& placement, const VolumeLayout& layout) {
    VolumeBox box;
    box.axis = world_axes(layout.axes);
    box.border = layout.border == Border::none ? 0 : 1;
    const std::array<int, 3> cells{extent.x, extent.y, extent.z};
    const double voxel = placement.cell_size_m * layout.factor;
    for (std::size_t a = 0; a < 3; ++a) {
        const int world = box.axis[a];
        const int inner = (cells[std::size_t(world)] + layout.factor - 1) / layout.factor + 2 * box.border;
        int size = up_to_multiple(inner, layout.multiple);
        if (layout.power_of_two) size = int(std::bit_ceil(unsigned(size)));
        box.size[a] = size;
        box.padding[a] = size - inner;
        box.voxel_m[a] = voxel;
        box.min_m[a] = placement.origin_m[world] - box.border * voxel;
        box.max_m[a] = box.min_m[a] + size * voxel;
    }
    return box;
}

std::array<bool, 3> repeating_axes(const VolumeBox& box, const VolumeLayout& layout) {
    std::array<bool, 3> repeat{};
    for (std::size_t a = 0; a < 3; ++a)
        repeat[a] = layout.periodic[std::size_t(box.axis[a])] && box.border == 0 && box.padding[a] == 0;
    return repeat;
}

Volume lay_out(const DensityGrid& density, const VolumeLayout& layout) {
    const VolumeBox box = box_of(density.extent(), density.placement(), layout);
    Volume volume{box.size[0], box.size[1], box.size[2], {}};
    volume.values.assign(volume.voxels(), 0.0f);
    // Stride of each of the world's axes.
    const std::array<std::size_t, 3> file_stride{1, std::size_t(volume.nx),
                                                 std::size_t(volume.nx) * std::size_t(volume.ny)};
    std::array<std::size_t, 3> stride{};
    for (std::size_t a = 0; a < 3; ++a) stride[std::size_t(box.axis[a])] = file_stride[a];
    const std::size_t first = std::size_t(box.border) * (stride[0] + stride[1] + stride[2]);
    const Extent extent = density.extent();
    const int f = layout.factor;
    // Adds in doubles: sums of floats of equal values go astray, and stand still once the next value is below their last bit.
    std::vector<double> sums(f == 1 ? 0 : volume.voxels());
    for (const Block& block : blocks_of(density)) {
        if (f == 1) {
            block.copy_to(volume.values.data() + first, stride, extent);
            continue;
        }
        const int x = block.origin.x(), y = block.origin.y(), z = block.origin.z();
        for (int i = 0; i < std::min(kBlock, extent.x - x); ++i) {
            for (int j = 0; j < std::min(kBlock, extent.y - y); ++j) {
                double* column = sums.data() + first + std::size_t((x + i) / f) * stride[0] +
                                 std::size_t((y + j) / f) * stride[1];
                for (int k = 0; k < std::min(kBlock, extent.z - z); ++k)
                    column[std::size_t((z + k) / f) * stride[2]] += double(block.value(leaf_offset(i, j, k)));
            }
        }
    }
    const double cells = double(f) * f * f;
    for (std::size_t n = 0; n < sums.size(); ++n) volume.values[n] = float(sums[n] / cells);
    if (layout.border == Border::wrap) {
        for (int a = 0; a < 3; ++a) {
            const int inner = box.size[std::size_t(a)] - box.padding[std::size_t(a)] - 2;
            if (layout.periodic[std::size_t(box.axis[std::size_t(a)])]) wrap_axis(volume, a, inner);
        }
    }
    return volume;
}

DensityGrid coarser(const DensityGrid& density, int factor) {
    if (factor == 1) return density;
    VolumeLayout layout;
    layout.factor = factor;
    const Volume volume = lay_out(density, layout);
    Placement placement = density.placement();
    placement.cell_size_m *= factor;
    return DensityGrid::from_dense(volume.values, {volume.nx, volume.ny, volume.nz}, placement);
}

Volume halved(const Volume& volume) {
    const auto half = [](int n) { return std::max(1, n / 2); };
    Volume next{half(volume.nx), half(volume.ny), half(volume.nz), {}};
    next.values.resize(next.voxels());
    const std::size_t row = std::size_t(volume.nx), slice = row * std::size_t(volume.ny);
    // Along an axis of one voxel both neighbours are that voxel.
    const std::size_t dx = volume.nx > 1 ? 1 : 0, dy = volume.ny > 1 ? row : 0,
                      dz = volume.nz > 1 ? slice : 0;
    const std::size_t step = volume.nx > 1 ? 2 : 1;
    tbb::parallel_for(0, next.nz, [&](int k) {
        for (int j = 0; j < next.ny; ++j) {
            const float* a = volume.values.data() + std::size_t(volume.nz > 1 ? 2 * k : k) * slice +
                             std::size_t(volume.ny > 1 ? 2 * j : j) * row;
            const float *b = a + dy, *c = a + dz, *d = c + dy;
            float* to = next.values.data() +
                        (std::size_t(k) * std::size_t(next.ny) + std::size_t(j)) * std::size_t(next.nx);
            if (step == 2) {
                halve_rows(a, b, c, d, std::size_t(next.nx), to);
                continue;
            }
            for (std::size_t i = 0; i < std::size_t(next.nx); ++i) {
                const std::size_t n = i * step;
                to[i] = 0.125f * (((a[n] + a[n + dx]) + (b[n] + b[n + dx])) +
                                  ((c[n] + c[n + dx]) + (d[n] + d[n + dx])));
            }
        }
    });
    return next;
}

int level_count(const std::array<int, 3>& size, int smallest) {
    int levels = 1;
    for (int longest = std::max({size[0], size[1], size[2]}); longest > smallest; longest = (longest + 1) / 2)
        ++levels;
    return levels;
}

std::vector<std::array<int, 3>> level_sizes(const std::array<int, 3>& size, int levels) {
    std::vector<std::array<int, 3>> sizes{size};
    while (int(sizes.size()) < levels) {
        sizes.push_back(sizes.back());
        for (int& side : sizes.back()) side = std::max(1, side / 2);
    }
    return sizes;
}

}  // namespace nephos
