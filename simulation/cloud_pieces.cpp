// SPDX-License-Identifier: Apache-2.0
#include "simulation/cloud_pieces.h"

#include <cstdint>
#include <map>

namespace nephos {
namespace {

using ScatteredShapes = std::map<std::uint32_t, std::vector<Billboard>>;

const std::vector<Billboard>& scattered(const SkySimulation& sky, const CloudForm& form, ScatteredShapes& shapes) {
    const auto [at, added] = shapes.try_emplace(form.shape);
    if (added) {
        const CloudShape& shape = sky.shapes()[form.shape];
        at->second = scatter_billboards(sky.model(form), shape.cloud, sky.options().seed, std::uint32_t(shape.model),
                                        shape.number);
    }
    return at->second;
}

}  // namespace

std::vector<CloudPiece> cloud_pieces(const SkySimulation& sky, std::span<const SkyCloud> clouds, double time_s) {
    std::vector<CloudPiece> pieces;
    ScatteredShapes shapes;
    const double state = sky.state_at(time_s);
    for (const SkyCloud& cloud : clouds) {
        const Vec3 place = sky.position_m(cloud);
        for (const CloudForm& form : sky.forms(cloud, state)) {
            const Cloud& shape = sky.shapes()[form.shape].cloud;
            for (const Billboard& billboard : scattered(sky, form, shapes)) {
                const double opacity = phase_weight(shape.boxes[billboard.box].distance, form.phase,
                                                    sky.options().formation_softness);
                if (opacity <= 0) continue;
                Vec3 centre_m = billboard.centre_m + place;
                centre_m += sky.lean_m(cloud, form, centre_m.z, time_s);
                pieces.push_back({centre_m, billboard.width_m, billboard.height_m, opacity});
            }
        }
    }
    return pieces;
}

}  // namespace nephos
