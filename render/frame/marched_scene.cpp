// SPDX-License-Identifier: Apache-2.0
#include "render/frame/marched_scene.h"

#include <cmath>
#include <string>

#include "core/error.h"
#include "render/shared/march.h"

namespace nephos {

static_assert(shader::kMostVolumes == kMaxDetailedClouds);

MarchedVolume::MarchedVolume(const CloudVolume& volume, const Vec3& eye_m)
    : kernel(volume.field), sun_depths(volume.sun_depths.data()), surroundings(volume.surroundings.data()),
      upwards(volume.diffuse.upwards.data()), sideways(volume.diffuse.sideways.data()) {
    const Vec3 from = volume.field.corner_m() - eye_m;
    for (int axis = 0; axis < 3; ++axis) corner[axis] = float(from[axis]);
    // The large noise changes by its whole width within half of a bump.
    const ErosionConstants& e = volume.field.erosion();
    float per_m = 0;
    for (const auto& row : e.to_noise) per_m = std::max(per_m, std::hypot(row[0], row[1], row[2]));
    reach = 1 / (16 * per_m);
}

MarchedScene::MarchedScene(std::span<const CloudVolume> of, const CameraFrame& camera, double pixels_per_unit,
                           const CloudLight& light) {
    if (diffuses(light)) diffuse = float(light.multiple_scattering);
    mean_cosine = float(nephos::mean_cosine(light.phase));
    for (const CloudVolume& volume : of)
        if (!volume.field.places().empty()) volumes.emplace_back(volume, camera.position_m);
    if (volumes.size() > shader::kMostVolumes)
        throw Error(ErrorCode::usage, std::to_string(volumes.size()) + " clouds with detail: expected at most " +
                                          std::to_string(shader::kMostVolumes));
    per_unit = float(1 / pixels_per_unit);
    // With detail a twentieth of a cell; without, half of one, the distance between two nodes.
    double least_m = double(shader::kLeastStep_m);
    for (const CloudVolume& volume : of)
        least_m = std::min(least_m, volume.field.node_m() * (volume.field.erosion().whole > 0 ? 1 : 0.1));
    least_step = float(least_m);
    const auto scale = float(footprint_scale(of));
    fade_begins = scale * shader::kMarchedFootprint_m / per_unit;
    fade_ends = scale * shader::kSplattedFootprint_m / per_unit;
}

}  // namespace nephos
