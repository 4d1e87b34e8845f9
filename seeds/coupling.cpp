// SPDX-License-Identifier: Apache-2.0
#include "seeds/coupling.h"

#include <algorithm>

#include "seeds/checks.h"

namespace nephos {

void check(const CouplingOptions& options) {
    require_in("coupling: strength", options.strength, 0, 1);
    require_in("coupling: size scale", options.size_scale, 1e-3, 1e3);
    require_in("coupling: smallest semi-axis (m)", options.min_semi_axis_m, 0, 1e6);
    require_in("coupling: size at birth", options.size_at_birth, 0, 1);
    require_probabilities("coupling", options.centre);
    require_probabilities("coupling", options.rim);
    for (const GenusCoupling& of_genus : options.genera) {
        require_probabilities("coupling of a genus", of_genus.centre);
        require_probabilities("coupling of a genus", of_genus.rim);
    }
}

CentreAndRim probabilities_of(const BaseModel& model, const CouplingOptions& options) {
    CentreAndRim result{options.centre, options.rim};
    const auto of_genus = std::ranges::find(options.genera, model.genus, &GenusCoupling::genus);
    if (of_genus != options.genera.end()) result = {of_genus->centre, of_genus->rim};
    if (model.own_centre) result.centre = model.centre;
    if (model.own_rim) result.rim = model.rim;
    return result;
}

void append_ellipsoids(std::vector<ActiveEllipsoid>& out, const BaseModel& model, const Cloud& cloud,
                       const Vec3& position_m, double phase, double softness,
                       const CouplingOptions& options) {
    const CentreAndRim probabilities = probabilities_of(model, options);
    for (const SeedBox& box : cloud.boxes) {
        const double grown = phase_weight(box.distance, phase, softness);
        const double weight = options.strength * model.seeds[box.seed].strength * grown;
        if (weight <= 0) continue;
        const double scale =
            options.size_scale / 2 * (options.size_at_birth + (1 - options.size_at_birth) * grown);
        const auto semi_axis = [&](double edge) { return std::max(edge * scale, options.min_semi_axis_m); };
        ActiveEllipsoid& active = out.emplace_back();
        active.weight = weight;
        active.ellipsoid.centre_m = {position_m.x + box.centre_m.x, position_m.y + box.centre_m.y,
                                     position_m.z + box.centre_m.z};
        active.ellipsoid.semi_axes_m = {semi_axis(box.size_m.x), semi_axis(box.size_m.y),
                                        semi_axis(box.size_m.z)};
        active.ellipsoid.centre = probabilities.centre;
        active.ellipsoid.rim = probabilities.rim;
    }
}

std::vector<ActiveEllipsoid> ellipsoids_of(const SkySimulation& sky, const CouplingOptions& options) {
    check(options);
    std::size_t boxes = 0;
    for (const SkyCloud& c : sky.clouds()) boxes += sky.shape(c).boxes.size();
    std::vector<ActiveEllipsoid> out;
    out.reserve(options.strength > 0 ? boxes : 0);
    for (const SkyCloud& c : sky.clouds()) {
        for (const CloudForm& form : sky.forms(c))
            append_ellipsoids(out, sky.model(form), sky.shapes()[form.shape].cloud, sky.position_m(c), form.phase,
                              sky.options().formation_softness, options);
    }
    return out;
}

}  // namespace nephos
