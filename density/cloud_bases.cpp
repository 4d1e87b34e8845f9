// SPDX-License-Identifier: Apache-2.0
#include "density/cloud_bases.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

#include "density/openvdb_access.h"

namespace nephos {
namespace {

constexpr double kDepthOfRain = 10;  // optical depth at which a cloud has 1 - 1/e of its rain
constexpr float kBaseFraction = 0.1f;

// Calls `visit(column, level, value)` for the voxels above 0.
template <class Visit>
void for_voxels(const DensityGrid& density, Visit&& visit) {
    const Extent extent = density.extent();
    for (const Block& block : blocks_of(density)) {
        const int x = block.origin.x(), y = block.origin.y(), z = block.origin.z();
        for (int i = 0; i < std::min(kBlock, extent.x - x); ++i)
            for (int j = 0; j < std::min(kBlock, extent.y - y); ++j)
                for (int k = 0; k < std::min(kBlock, extent.z - z); ++k)
                    if (const float value = block.value(leaf_offset(i, j, k)); value > 0)
                        visit(std::size_t(y + j) * std::size_t(extent.x) + std::size_t(x + i), z + k, value);
    }
}

// The columns along the edge of a texel: the least that keep to kMostTexels and divide what repeats, if that is at most four
// times as coarse as it has to be. Otherwise a part of the largest number that divides both sides; 1 where that is smaller
// than a texel has to be.
double texel_columns(const Extent& extent, bool repeats_x, bool repeats_y) {
    const int least = (std::max(extent.x, extent.y) + CloudBases::kMostTexels - 1) / CloudBases::kMostTexels;
    for (int step = least; step <= 4 * least; ++step)
        if ((!repeats_x || extent.x % step == 0) && (!repeats_y || extent.y % step == 0)) return step;
    const int common = repeats_x && repeats_y ? std::gcd(extent.x, extent.y) : repeats_x ? extent.x : extent.y;
    return common < least ? 1 : double(common) / (common / least);
}

// The texels that a column lies in, along one axis: as wide as a column at least, so that these are two at most.
struct TexelsOfColumn {
    int first = 0;
    double in_first = 1;  // part of the column; the rest is in the next texel
};
TexelsOfColumn texels_of(int column, double texel) {
    const int first = int(std::floor(column / texel));
    return {first, std::min(1.0, (first + 1) * texel - column)};
}

int texels_along(int columns, double texel) { return int(std::ceil(columns / texel - 1e-9)); }

// The lowest undersides of the pieces over each texel, and what they let through together.
struct PieceColumns {
    static constexpr float kNone = std::numeric_limits<float>::infinity();
    static constexpr double kLeastOpaque = 0.1;  // of a piece that makes a base beside others
    std::vector<float> through, opaque_base_m, base_m;
    explicit PieceColumns(std::size_t texels)
        : through(texels, 1.0f), opaque_base_m(texels, kNone), base_m(texels, kNone) {}

    void add(std::size_t texel, double opacity, float underside_m) {
        through[texel] *= float(1 - opacity);
        base_m[texel] = std::min(base_m[texel], underside_m);
        if (opacity >= kLeastOpaque) opaque_base_m[texel] = std::min(opaque_base_m[texel], underside_m);
    }
};

// Adds a piece to the texels below it.
void add_piece(const CloudPiece& piece, const CloudBases& grid, PieceColumns& columns) {
    const double true_radius_m = 0.5 * piece.width_m, radius_m = std::max(true_radius_m, grid.texel_m);
    const double most = std::clamp(piece.opacity, 0.0, 1.0) * std::pow(true_radius_m / radius_m, 2);
    const double x = (piece.centre_m.x - grid.x_m) / grid.texel_m - 0.5,
                 y = (piece.centre_m.y - grid.y_m) / grid.texel_m - 0.5, reach = radius_m / grid.texel_m;
    const auto first = [&](double at) { return int(std::clamp(std::ceil(at - reach), 0.0, 1e6)); };
    const auto last = [&](double at, int count) { return int(std::clamp(std::floor(at + reach), -1.0, count - 1.0)); };
    for (int j = first(y); j <= last(y, grid.rows); ++j) {
        for (int i = first(x); i <= last(x, grid.columns); ++i) {
            const double inside = 1 - ((i - x) * (i - x) + (j - y) * (j - y)) / (reach * reach);
            if (inside <= 0) continue;
            columns.add(std::size_t(j) * std::size_t(grid.columns) + std::size_t(i), most * inside,
                        float(piece.centre_m.z - 0.5 * piece.height_m * std::sqrt(inside)));
        }
    }
}

int modulo(int n, int count) { return (n % count + count) % count; }

}  // namespace

CloudBases cloud_bases(const DensityGrid& density, double extinction_per_m, const Boundaries& boundaries) {
    const Extent extent = density.extent();
    const Placement& at = density.placement();
    CloudBases bases;
    if (extent.cells() == 0) return bases;
    const std::size_t count = std::size_t(extent.x) * std::size_t(extent.y);
    std::vector<double> sum(count, 0.0);
    std::vector<float> largest(count, 0.0f);
    for_voxels(density, [&](std::size_t column, int, float value) {
        sum[column] += double(value);
        largest[column] = std::max(largest[column], value);
    });
    std::vector<int> lowest(count, extent.z);
    for_voxels(density, [&](std::size_t column, int k, float value) {
        if (value > kBaseFraction * largest[column]) lowest[column] = std::min(lowest[column], k);
    });
    bases.repeats_x = boundaries.x == Boundary::periodic;
    bases.repeats_y = boundaries.y == Boundary::periodic;
    const double step = texel_columns(extent, bases.repeats_x, bases.repeats_y);
    bases.x_m = at.origin_m.x;
    bases.y_m = at.origin_m.y;
    bases.texel_m = step * at.cell_size_m;
    bases.columns = texels_along(extent.x, step);
    bases.rows = texels_along(extent.y, step);
    bases.water.assign(std::size_t(bases.columns) * std::size_t(bases.rows), 0.0f);
    bases.water_base_m.assign(bases.water.size(), 0.0f);
    const double to_depth = extinction_per_m * at.cell_size_m;
    for (int y = 0; y < extent.y; ++y) {
        for (int x = 0; x < extent.x; ++x) {
            const std::size_t column = std::size_t(y) * std::size_t(extent.x) + std::size_t(x);
            if (largest[column] <= 0) continue;
            const double water = (1 - std::exp(-sum[column] * to_depth / kDepthOfRain)) / (step * step);
            const double base_m = at.origin_m.z + (lowest[column] + 0.5) * at.cell_size_m;
            const TexelsOfColumn across = texels_of(x, step), up = texels_of(y, step);
            for (const int dy : {0, 1}) {
                for (const int dx : {0, 1}) {
                    const double part = (dx == 0 ? across.in_first : 1 - across.in_first) *
                                        (dy == 0 ? up.in_first : 1 - up.in_first);
                    // Rounding may name a texel beyond the last one: it has no part.
                    if (part < 1e-9 || across.first + dx >= bases.columns || up.first + dy >= bases.rows) continue;
                    const std::size_t texel = std::size_t(up.first + dy) * std::size_t(bases.columns) +
                                              std::size_t(across.first + dx);
                    bases.water[texel] += float(part * water);
                    bases.water_base_m[texel] += float(part * water * base_m);
                }
            }
        }
    }
    return bases;
}

CloudBases cloud_bases(std::span<const CloudPiece> pieces, const Vec2& low_m, const Vec2& high_m) {
    CloudBases bases;
    const double width_m = high_m.x - low_m.x, length_m = high_m.y - low_m.y;
    if (pieces.empty() || !(width_m > 0 && length_m > 0)) return bases;
    // A texel more on each side, so that those within have neighbours.
    bases.texel_m = std::max(width_m, length_m) / (CloudBases::kMostTexels - 2);
    bases.x_m = low_m.x - bases.texel_m;
    bases.y_m = low_m.y - bases.texel_m;
    bases.columns = int(std::ceil(width_m / bases.texel_m - 1e-9)) + 2;
    bases.rows = int(std::ceil(length_m / bases.texel_m - 1e-9)) + 2;
    const std::size_t count = std::size_t(bases.columns) * std::size_t(bases.rows);
    PieceColumns columns(count);
    for (const CloudPiece& piece : pieces) add_piece(piece, bases, columns);
    bases.water.resize(count);
    bases.water_base_m.assign(count, 0.0f);
    for (std::size_t n = 0; n < count; ++n) {
        bases.water[n] = 1 - columns.through[n];
        const float base_m =
            columns.opaque_base_m[n] < PieceColumns::kNone ? columns.opaque_base_m[n] : columns.base_m[n];
        if (bases.water[n] > 0) bases.water_base_m[n] = bases.water[n] * base_m;
    }
    return bases;
}

CloudBases::Column CloudBases::at(double place_x_m, double place_y_m) const {
    if (columns == 0) return {};
    double u = (place_x_m - x_m) / texel_m - 0.5, v = (place_y_m - y_m) / texel_m - 0.5;
    if (repeats_x) u -= columns * std::floor(u / columns);
    if (repeats_y) v -= rows * std::floor(v / rows);
    if (!(u > -1 && u <= columns && v > -1 && v <= rows)) return {};
    const int i = int(std::floor(u)), j = int(std::floor(v));
    double of_water = 0, of_base = 0;
    for (int dy = 0; dy < 2; ++dy) {
        for (int dx = 0; dx < 2; ++dx) {
            const int column = repeats_x ? modulo(i + dx, columns) : i + dx,
                      row = repeats_y ? modulo(j + dy, rows) : j + dy;
            if (column < 0 || row < 0 || column >= columns || row >= rows) continue;
            const double weight = (dx == 1 ? u - i : 1 - (u - i)) * (dy == 1 ? v - j : 1 - (v - j));
            const std::size_t n = std::size_t(row) * std::size_t(columns) + std::size_t(column);
            of_water += weight * double(water[n]);
            of_base += weight * double(water_base_m[n]);
        }
    }
    return of_water > 0 ? Column{of_water, of_base / of_water} : Column{};
}

}  // namespace nephos
