// SPDX-License-Identifier: Apache-2.0
#include "simulation/frame_detail.h"

#include <cmath>

#include "core/math.h"
#include "core/wind.h"
#include "density/veil.h"
#include "scenes/format/layers.h"

namespace nephos {

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
    if (layer) setting.opacity = scene.layers[*layer].opacity;
    setting.drift_m = wind_displacement_m(wind, height, time_s);
    if (veil) {
        const Rotation fibres = rotation_of_degrees(scene.layers[*layer].veil.direction_deg);
        setting.along = Vec2(fibres.cos, fibres.sin);
        return setting;
    }
    const Velocity now = wind_at(wind, height, time_s);
    const double speed = std::hypot(now.east_m_per_s, now.north_m_per_s);
    if (speed > 0) setting.along = Vec2(now.east_m_per_s, now.north_m_per_s) / speed;
    return setting;
}

}  // namespace nephos
