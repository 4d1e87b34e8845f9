// SPDX-License-Identifier: Apache-2.0
#include "study/snapshot.h"

#include <limits>

#include "statistics/clouds.h"
#include "statistics/structure.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double columns(const Extent& extent) { return double(extent.x) * extent.y; }

}  // namespace

Snapshot take_snapshot(const BitPlaneView& cld, const Boundaries& boundaries, double cell_size_m,
                       const SizeRange& range) {
    const double area_km2 = columns(cld.extent) * cell_size_m * cell_size_m / 1e6;
    const std::vector<ConnectedCloud> clouds = cloud_sizes_2d(cld, boundaries);
    const double number = double(clouds.size());
    Snapshot snapshot{{}, CloudSizes(range)};
    snapshot.sizes.add(clouds);
    snapshot.values = {
        number / area_km2,
        clouds.empty() ? kNaN : double(snapshot.sizes.area()) / number * cell_size_m * cell_size_m,
        correlation_length_m(shadow_of(cld).view(), boundaries, cell_size_m),
        mean_overlap_of_neighbours(cld)};
    return snapshot;
}

double edge_per_km(double perimeter_m, const Extent& extent, double cell_size_m) {
    return 1000 * perimeter_m / (columns(extent) * cell_size_m * cell_size_m);
}

SeriesMean size_statistic(std::string_view name, const CloudSizes& sizes) {
    const Estimate estimate = name == "size_exponent"        ? sizes.likelihood_exponent()
                              : name == "size_exponent_line" ? sizes.line_exponent()
                                                             : sizes.fractal_dimension();
    return {estimate.value, estimate.error, kNaN, kNaN, kNaN};
}

}  // namespace nephos
