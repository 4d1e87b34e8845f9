// SPDX-License-Identifier: Apache-2.0
#include "render/frame/marched_scene.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "core/error.h"
#include "render/shared/march.h"

namespace nephos {

static_assert(shader::kMostVolumes == kMaxDetailedClouds && 1 + shader::kPatchSpread == kMostInImages);

MarchedVolume::MarchedVolume(const CloudVolume& volume, const Vec3& eye_m, float bend_per_m)
    : kernel(volume.field), sun_depths(volume.sun_depths.data()), surroundings(volume.surroundings.data()),
      upwards(volume.diffuse.upwards.data()), sideways(volume.diffuse.sideways.data()) {
    const Vec3 from = volume.field.corner_m() - eye_m;
    for (int axis = 0; axis < 3; ++axis) corner[axis] = float(from[axis]);
    // The large noise changes by its whole width within half of a bump.
    const ErosionConstants& e = volume.field.erosion();
    cloud_odds = e.cloud_odds();
    float per_m = 0;
    for (const auto& row : e.to_noise) per_m = std::max(per_m, std::hypot(row[0], row[1], row[2]));
    reach = 1 / (16 * per_m);
    repeats = volume.field.period_m().x > 0;
    if (!repeats) return;
    bend = bend_per_m;
    most_patches = kMostInImages;
    set_repeats(volume, eye_m);
}

void MarchedVolume::set_repeats(const CloudVolume& volume, const Vec3& eye_m) {
    const CoverageField& field = volume.field;
    home = float(field.home_m());
    for (int axis = 0; axis < 2; ++axis) {
        period[axis] = float(field.period_m()[axis]);
        per_period[axis] = 1 / period[axis];
    }
    // Bumps of the noise of patches, an eighth of its period, are about as large as the lattice: smaller than what would
    // show its repetition, larger than clouds.
    const double between_m = std::sqrt(field.period_m().x * field.period_m().y), tile_m = 8 * 0.6 * between_m;
    const double turn[4] = {0.8, 0.6, -0.6, 0.8};
    for (std::size_t n = 0; n < 4; ++n) to_patches[n] = float(turn[n] / tile_m);
    patch_ramp = float(1 / (0.2 * between_m));

    const LightFront& front = volume.front;
    shade = volume.shade.data();
    mean_sunlight = volume.mean_sunlight;
    shade_columns = front.columns();
    shade_rows = front.rows();
    const Vec2 at_eye = front.place_of(eye_m);
    const auto step = [&](const Vec3& along) { return front.place_of(eye_m + along) - at_eye; };
    const Vec2 x = step({1, 0, 0}), y = step({0, 1, 0}), z = step({0, 0, 1});
    shade_u = {float(x.x), float(y.x), float(z.x), float(at_eye.x)};
    shade_v = {float(x.y), float(y.y), float(z.y), float(at_eye.y)};
    const double base_m = field.corner_m().z + double(field.erosion().base_m),
                 top_m = std::max(field.top_m(), base_m + 2 * field.node_m()), middle_m = 0.5 * (base_m + top_m);
    shade_top = float(top_m - eye_m.z);
    per_shade_height = float(1 / (top_m - base_m));
    // A line that crosses the entrance at (0, 0) is here in the middle of the cloud.
    const Vec3 home_corner = field.corner_m() + Vec3(home, home, 0);
    const Vec2 of_middle = front.place_of(Vec3(home_corner.x, home_corner.y, middle_m));
    shade_mid[0] = home - float(of_middle.x * 2 * field.node_m());
    shade_mid[1] = home - float(of_middle.y * 2 * field.node_m());
}

MarchedScene::MarchedScene(std::span<const CloudVolume> of, const CameraFrame& camera, double pixels_per_unit,
                           const CloudLight& light, float bend) {
    if (diffuses(light)) diffuse = float(light.multiple_scattering);
    mean_cosine = float(nephos::mean_cosine(light.phase));
    for (const CloudVolume& volume : of)
        if (!volume.field.places().empty()) volumes.emplace_back(volume, camera.position_m, bend);
    if (volumes.size() > shader::kMostVolumes)
        throw Error(ErrorCode::usage, std::to_string(volumes.size()) + " clouds with detail: expected at most " +
                                          std::to_string(shader::kMostVolumes));
    for (const MarchedVolume& volume : volumes) {
        if (!volume.repeats) continue;
        repeats = true;
        most_step = std::min(most_step, shader::kMostStepNodes * volume.kernel.node_m);
    }
    per_unit = float(1 / pixels_per_unit);
    // With detail a fortieth of a cell; without, half of one, the distance between two nodes.
    double least_m = double(shader::kLeastStep_m);
    for (const CloudVolume& volume : of)
        least_m = std::min(least_m, volume.field.node_m() * (volume.field.erosion().whole > 0 ? 1 : 0.05));
    least_step = float(least_m);
    const auto scale = float(footprint_scale(of));
    fade_begins = scale * shader::kMarchedFootprint_m / per_unit;
    fade_ends = scale * shader::kSplattedFootprint_m / per_unit;
}

void MarchState::find_next(const float* transmittance, const float* opaque) {
    next = std::numeric_limits<float>::max();
    for (std::size_t n = 0; n < kPixels; ++n)
        if (distance[n] < end[n] && transmittance[n] > shader::kMarchOpaqueFactor * opaque[n]) next = std::min(next, distance[n]);
    done = next == std::numeric_limits<float>::max();
}

}  // namespace nephos
