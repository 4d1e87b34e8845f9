// SPDX-License-Identifier: Apache-2.0
#include "simulation/frame_detail.h"

#include <algorithm>
#include <cmath>

#include "core/math.h"
#include "core/wind.h"
#include "density/veil.h"
#include "scenes/format/layers.h"

namespace nephos {

namespace {

// Whether a grid has the box of a lattice, in whichever voxels.
bool is_box_of(const DensityGrid& grid, const AutomatonOptions& lattice) {
    const Placement &a = grid.placement(), &b = lattice.placement;
    const Extent &m = grid.extent(), &n = lattice.extent;
    return a.origin_m == b.origin_m && a.cell_size_m * m.x == b.cell_size_m * n.x &&
           a.cell_size_m * m.y == b.cell_size_m * n.y && a.cell_size_m * m.z == b.cell_size_m * n.z;
}

constexpr double kBandBumps = 1;           // large bumps in a band's height, at least
constexpr std::size_t kMostBands = 64;
constexpr double kLeastApart_m = 0.01;  // of drifts that are not the same

// Returns the drift of bands of height of a grid, `setting.drift_m` that of its middle; none where all drift alike.
DriftBands drift_bands(const Wind& wind, const DensityGrid& grid, const DetailSetting& setting, double time_s) {
    const Placement& placement = grid.placement();
    const double height_m = grid.extent().z * placement.cell_size_m,
                 band_m = kBandBumps * bump_size_m(setting.options, placement.cell_size_m);
    const auto count = std::min(std::size_t(std::ceil(height_m / band_m)), kMostBands);
    DriftBands bands{height_m / double(count), {}};
    bool all_alike = true;
    for (std::size_t n = 0; n < count; ++n) {
        const double middle_m = placement.origin_m.z + (double(n) + 0.5) * bands.height_m;
        bands.apart_m.emplace_back(wind_displacement_m(wind, middle_m, time_s) - setting.drift_m);
        all_alike = all_alike && glm::length(bands.apart_m.back()) < kLeastApart_m;
    }
    return all_alike ? DriftBands{} : bands;
}

}  // namespace

DetailSetting detail_setting(const Scene& scene, std::optional<std::size_t> layer, const DensityGrid& density,
                             double time_s) {
    const bool calm = scene.automaton.wind.keyframes.empty() && !scene.layers.empty();
    const Wind& wind = layer || calm ? layer_wind(scene, layer.value_or(0)) : scene.automaton.wind;
    const Placement& placement = density.placement();
    const bool veil = layer && scene.layers[*layer].is_veil;
    const double height = veil ? scene.layers[*layer].veil.top_m
                               : placement.origin_m.z + 0.5 * density.extent().z * placement.cell_size_m;
    DetailSetting setting;
    setting.options = layer ? layer_detail(scene, *layer) : scene.density.detail;
    setting.extinction_per_m = scene.density.extinction_per_m;
    setting.metaball_radius_cells = scene.density.metaball_radius_cells;
    // Of a veil that is about to go, no less than can be divided by.
    if (layer) setting.opacity = std::max(1e-3, opacity_at(scene.layers[*layer], scene.climate, time_s));
    // A file with another box than the lattice is not cut by its sides.
    const bool whole = layer || is_box_of(density, scene.automaton);
    if (!whole) setting.options.apron_cells = 0;
    if (whole) setting.boundaries = layer ? scene.layers[*layer].boundaries : scene.automaton.boundaries;
    setting.images = repeats(setting);
    setting.drift_m = wind_displacement_m(wind, height, time_s);
    if (veil) {
        const Rotation fibres = rotation_of_degrees(scene.layers[*layer].veil.direction_deg);
        setting.along = Vec2(fibres.cos, fibres.sin);
        return setting;
    }
    setting.bands = drift_bands(wind, density, setting, time_s);
    const Velocity now = wind_at(wind, height, time_s);
    const double speed = std::hypot(now.east_m_per_s, now.north_m_per_s);
    if (speed > 0) setting.along = Vec2(now.east_m_per_s, now.north_m_per_s) / speed;
    return setting;
}

}  // namespace nephos
