// SPDX-License-Identifier: Apache-2.0
#include "simulation/volume_picture.h"

#include <algorithm>
#include <filesystem>
#include <tuple>

#include "core/error.h"
#include "density/metaballs.h"
#include "simulation/frame_painter.h"
#include "simulation/scene_moment.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

constexpr double kLeastVoxelWithDetail_m = 20;
constexpr std::uint64_t kMostMarchedVoxels = 16'000'000;

// `camera`: that of the scene, if there is one, at the time of the picture and with world heights.
RenderOptions render_options(const VolumePictureOptions& given, const std::optional<Scene>& scene,
                             const DensityGrid& grid, const Camera& camera) {
    RenderOptions options;
    const WorldBox box = cloud_box(grid);
    if (scene) {
        options = scene->render;
        options.camera = camera;
    } else {
        options.camera.width = 1280;
        options.camera.height = 720;
        options.ground.height_m = ground_below(box);
    }
    if (given.size) std::tie(options.camera.width, options.camera.height) = *given.size;
    if (given.fov_deg) options.camera.vertical_fov_deg = *given.fov_deg;
    if (given.exposure_ev) options.camera.exposure_ev = *given.exposure_ev;
    if (given.sun_deg) {
        std::tie(options.sun.elevation_deg, options.sun.azimuth_deg) = *given.sun_deg;
        options.sun.date.clear();
        options.sun.time.clear();
    }
    if (given.albedo) options.light.albedo = *given.albedo;
    if (given.g) options.light.phase.g = *given.g;
    if (given.view || !scene)
        frame(options.camera, box, given.view.value_or(View::side), options.ground.height_m);
    if (given.camera_m) options.camera.position_m = *given.camera_m;
    if (given.target_m) options.camera.target_m = *given.target_m;
    if (options.camera.position_m == options.camera.target_m)
        throw Error(ErrorCode::usage, "--camera and --target are the same point");
    return options;
}

// In voxels of the file: a scene's radius is in cells of the lattice, and a refined grid has several voxels a
// cell.
double radius_in_voxels(const std::optional<Scene>& scene, const LoadedDensity& loaded) {
    const DensityOptions density = scene ? scene->density : DensityOptions();
    return std::min(density.metaball_radius_cells * loaded.refine, kMaxMetaballRadius);
}

PictureMetadata metadata_of(const std::string& file, const LoadedDensity& loaded, double extinction_per_m) {
    PictureMetadata metadata;
    metadata.scene = std::filesystem::path(file).filename().string();
    metadata.version = version();
    metadata.extinction_per_m = extinction_per_m;
    if (!loaded.metadata) return metadata;
    metadata.seed = loaded.metadata->seed;
    metadata.scene_hash = loaded.metadata->scene_hash;
    metadata.state_hash = loaded.metadata->state_hash;
    metadata.time_s = loaded.metadata->time_s;
    metadata.frames_per_second = loaded.metadata->frames_per_second;
    metadata.time_scale = loaded.metadata->time_scale;
    return metadata;
}

}  // namespace

VolumePicture draw_volume(const std::string& file, const LoadedDensity& loaded,
                          const std::optional<Scene>& scene, const VolumePictureOptions& given,
                          const DeviceOptions& device) {
    const double time_s = loaded.metadata ? loaded.metadata->time_s : 0;
    VolumePicture result;
    Scene drawn = scene.value_or(Scene());
    FramePainter painter(drawn, device);
    result.options = render_options(given, scene, loaded.density, painter.camera(time_s));
    result.metaball_radius_voxels = radius_in_voxels(scene, loaded);
    if (given.extinction_per_m) {
        result.extinction_per_m = *given.extinction_per_m;
    } else if (scene) {
        result.extinction_per_m = scene->density.extinction_per_m;
    } else if (loaded.metadata) {
        result.extinction_per_m = loaded.metadata->extinction_per_m;
    } else {
        result.extinction_per_m = visible_extinction_per_m(loaded.density);
        result.extinction_was_guessed = true;
    }
    result.metadata = metadata_of(file, loaded, result.extinction_per_m);

    drawn.name = file;
    drawn.render = result.options;
    if (given.sun_deg) drawn.sun_path.clear();
    drawn.density.extinction_per_m = result.extinction_per_m;
    drawn.density.metaball_radius_cells = result.metaball_radius_voxels;
    drawn.frames.exr = given.depth;
    // Voxels that are as fine as the bumps, or were refined with detail, have what it would add. Very many are drawn as
    // metaballs alone: fields of them would take 45 bytes a voxel.
    if (loaded.density.active_voxels() > kMostMarchedVoxels) drawn.density.detail.enabled = false;
    if (drawn.density.detail.enabled && loaded.refine > 1) {  // rays march through the voxels as they are
        drawn.density.metaball_radius_cells = result.metaball_radius_voxels = 1;
        drawn.density.detail.apron_cells = 0;
    }
    if (loaded.refine > 1 || loaded.density.placement().cell_size_m < kLeastVoxelWithDetail_m)
        drawn.density.detail.strength = drawn.density.detail.thermals = 0;
    painter.set_scene(drawn, true);
    result.backend = painter.backend_name();
    result.device = painter.device_name();
    painter.note_renderer(result.metadata);
    const SceneMoment moment(drawn, time_s);
    FrameResult frame = moment.frame();
    frame.density = loaded.density;
    PendingFrame pending = painter.begin(std::move(frame));
    result.metaballs = pending.balls.size();
    result.picture = painter.finish(std::move(pending));
    result.options.sun = scene_sun_at(drawn, time_s);
    return result;
}

}  // namespace nephos
