// SPDX-License-Identifier: Apache-2.0
#include "density/optical_columns.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "density/export/volume.h"
#include "density/openvdb_access.h"

namespace nephos {
namespace {

double median(std::vector<double>& values) {
    const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

// The height below which this fraction of the mass of the levels lies, linear inside of a level.
double height_of_mass(const std::vector<double>& levels, double fraction, const Placement& at) {
    double all = 0;
    for (const double mass : levels) all += mass;
    double left = fraction * all;
    for (std::size_t k = 0; k < levels.size(); ++k) {
        if (left <= levels[k] && levels[k] > 0)
            return at.origin_m.z + (double(k) + left / levels[k]) * at.cell_size_m;
        left -= levels[k];
    }
    return at.origin_m.z + double(levels.size()) * at.cell_size_m;
}

}  // namespace

double optical_cover(const DensityGrid& density, double extinction_per_m) {
    const Extent extent = density.extent();
    if (extent.cells() == 0) return 0;
    std::vector<double> depth(std::size_t(extent.x) * std::size_t(extent.y), 0.0);
    for (const Block& block : blocks_of(density)) {
        const int x = block.origin.x(), y = block.origin.y(),
                  levels = std::min(kBlock, extent.z - block.origin.z());
        for (int i = 0; i < std::min(kBlock, extent.x - x); ++i) {
            for (int j = 0; j < std::min(kBlock, extent.y - y); ++j) {
                double& column = depth[std::size_t(y + j) * std::size_t(extent.x) + std::size_t(x + i)];
                for (int k = 0; k < levels; ++k) column += double(block.value(leaf_offset(i, j, k)));
            }
        }
    }
    const double least = 1 / (extinction_per_m * density.placement().cell_size_m);
    return double(std::ranges::count_if(depth, [&](double d) { return d > least; })) / double(depth.size());
}

OpticalColumns optical_columns(const DensityGrid& density, double extinction_per_m) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    OpticalColumns result;
    result.cloud_base_m = result.base_m = result.top_m = nan;
    const Extent extent = density.extent();
    if (extent.cells() == 0) return result;
    const Placement& at = density.placement();
    const Volume volume = lay_out(density, {});
    const std::size_t columns = std::size_t(extent.x) * std::size_t(extent.y);
    std::vector<double> depth(columns, 0.0), levels(std::size_t(extent.z), 0.0);
    std::vector<float> largest(columns, 0.0f);
    for (int k = 0; k < extent.z; ++k) {
        const float* level = volume.values.data() + std::size_t(k) * columns;
        for (std::size_t n = 0; n < columns; ++n) {
            depth[n] += double(level[n]);
            largest[n] = std::max(largest[n], level[n]);
            levels[std::size_t(k)] += double(level[n]);
        }
    }
    const double to_depth = extinction_per_m * at.cell_size_m;
    std::vector<double> deep, bases;
    double light = 0;
    for (std::size_t n = 0; n < columns; ++n) {
        const double tau = depth[n] * to_depth;
        light += std::exp(-tau);
        if (!(tau > 1)) continue;
        deep.push_back(tau);
        int k = 0;
        while (!(volume.values[std::size_t(k) * columns + n] > 0.1f * largest[n])) ++k;
        bases.push_back(at.origin_m.z + k * at.cell_size_m);
    }
    result.mean_transmittance = light / double(columns);
    result.cover = double(deep.size()) / double(columns);
    if (!deep.empty()) {
        result.median_depth = median(deep);
        result.cloud_base_m = median(bases);
    }
    if (std::ranges::any_of(levels, [](double mass) { return mass > 0; })) {
        result.base_m = height_of_mass(levels, 0.05, at);
        result.top_m = height_of_mass(levels, 0.95, at);
    }
    return result;
}

}  // namespace nephos
