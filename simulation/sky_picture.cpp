// SPDX-License-Identifier: Apache-2.0
#include "simulation/sky_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <unordered_map>
#include <utility>

#include "automaton/checkpoint.h"
#include "core/vec.h"
#include "render/ground/wet_ground.h"
#include "render/options/camera.h"
#include "render/terrain/height_map.h"
#include "seeds/light_schedule.h"
#include "seeds/parcel_absorption.h"
#include "simulation/debug_view.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

constexpr double kLeastFlash = 1.0 / 512;  // relative to the sun; less does not show

// Returns how far the shear displaces any of a cloud's billboards.
double farthest_lean_m(const SkySimulation& sky, const SkyCloud& cloud, const CloudForm& form,
                       std::span<const Billboard> billboards, double time_s) {
    double farthest = 0;
    if (sky.options().shear_s == 0) return farthest;
    const double base_m = sky.position_m(cloud).z;
    for (const Billboard& billboard : billboards)
        farthest = std::max(farthest, length(sky.lean_m(cloud, form, billboard.centre_m.z + base_m, time_s)));
    return farthest;
}

constexpr double kLeastLeft = 1e-30;  // of the light, so that depths stay finite

// What clouds take of the sunlight, and of lightning, in the voxels that they drive.
struct DepthsInVoxels {
    AddedDepth to_sun, to_flash;
};

DepthsInVoxels depths_in_voxels(std::span<const SkyLayer> layers, const Sun& sun, const std::optional<Flash>& flash,
                                double time_s) {
    std::vector<AbsorbingCloud> clouds;
    for (const SkyLayer& layer : layers) {
        if (layer.voxels == nullptr) continue;
        const WorldRectangle& world = layer.sky->options().world;
        const Boundaries& sides = layer.voxels->boundaries;
        const ParcelLight light{layer.voxels->light_absorption,
                                {sides.x == Boundary::periodic ? world.max_x_m - world.min_x_m : 0,
                                 sides.y == Boundary::periodic ? world.max_y_m - world.min_y_m : 0}};
        append_absorbing(clouds, *layer.sky, layer.clouds, layer.voxels->coupling, light, time_s);
    }
    const auto absorption = std::make_shared<const ParcelAbsorption>(clouds, direction_to_sun(sun));
    if (absorption->empty()) return {};
    const std::vector<double> content = absorption->content();
    const StateHash hash = hash_of_bytes(std::as_bytes(std::span(content)));
    const auto depth_of = [](double left) { return left < 1 ? float(-std::log(std::max(left, kLeastLeft))) : 0.0f; };
    DepthsInVoxels depths;
    depths.to_sun.key = {hash.high, hash.low};
    depths.to_sun.at = [absorption, depth_of](const Vec3& place_m) { return depth_of(absorption->sunlight_at(place_m)); };
    if (flash)
        depths.to_flash.at = [absorption, depth_of, from_m = flash->position_m](const Vec3& place_m) {
            return depth_of(absorption->lightning_at(place_m, from_m));
        };
    return depths;
}

// The surface of a height map, its slope as mean over a stride.
std::function<GroundSurface(double, double)> relief_of(std::shared_ptr<const HeightMap> map, const Ground& ground) {
    return [map = std::move(map), ground](double x_m, double y_m) {
        constexpr double kStride_m = 1;
        const double z_m = ground_height_at(map.get(), ground, x_m, y_m);
        if (!(height_at(*map, x_m, y_m) >= z_m)) return GroundSurface{z_m};
        const MeanSlope slope = mean_slope(*map, x_m, y_m, kStride_m);
        return GroundSurface{z_m, slope.x, slope.y};
    };
}

}  // namespace

Light light_of(const Sun& sun) { return {direction_to_sun(sun), true}; }
Light light_of(const Flash& flash) { return {flash.position_m, false}; }

GroundCoverView view_of(const GroundCoverMap& map) {
    return {map, map.water_mm, map.snow_mm, map.rain_mm_per_h};
}

const SkyBillboards::ScatteredBillboards& SkyBillboards::scattered(const SkySimulation& sky,
                                                                   const CloudForm& form) {
    scattered_.resize(sky.shapes().size());
    std::optional<ScatteredBillboards>& result = scattered_[form.shape];
    if (result) return *result;
    const CloudShape& shape = sky.shapes()[form.shape];
    result.emplace();
    result->billboards = scatter_billboards(sky.model(form), shape.cloud, sky.options().seed,
                                            std::uint32_t(shape.model), shape.number);
    result->low_m = shape.cloud.low_m.z;
    result->high_m = std::max(shape.cloud.high_m.z, result->low_m + 1e-3);
    for (const Billboard& billboard : result->billboards) {
        result->reach_m = std::max(result->reach_m, 0.5 * std::hypot(billboard.width_m, billboard.height_m));
        result->low_m = std::min(result->low_m, billboard.centre_m.z - 0.5 * billboard.height_m);
        result->high_m = std::max(result->high_m, billboard.centre_m.z + 0.5 * billboard.height_m);
    }
    return *result;
}

std::size_t SkyBillboards::light_by_sun(const SkySimulation& sky, std::span<const FormedCloud> clouds,
                                        const RenderOptions& options, const std::optional<FilmFrame>& film) {
    const LightSchedule schedule(sky.options(), film ? options.light.cfa_clouds_per_frame : 0);
    const Light present = light_of(options.sun);
    std::unordered_map<int, Light> earlier;  // by frame
    const auto light_for = [&](const SkyCloud& cloud) -> const Light& {
        if (schedule.period() == 1) return present;
        const int frame = schedule.frame_of_light(cloud.slot, film->index);
        const auto [found, added] = earlier.try_emplace(frame);
        if (added)
            found->second = light_of(turned_sun_at(*film->sun, film->sun_path, film->heading_deg,
                                                   frame_time_s(*film->frames, frame)));
        return found->second;
    };
    std::vector<CloudToLight> lit;
    for (const auto& [cloud, form] : clouds)
        lit.push_back({light_id(*cloud, form), &sky.shapes()[form.shape].cloud, sky.position_m(*cloud),
                       light_for(*cloud), form.phase, sky.options().formation_softness});
    return sun_.update(lit);
}

void SkyBillboards::light_by_flash(const SkySimulation& sky, const Flash& flash,
                                   const std::vector<FormedCloud>& seen) {
    std::vector<CloudToLight> lit;
    for (const auto& [cloud, form] : seen) {
        const Cloud& shape = sky.shapes()[form.shape].cloud;
        const Vec3 place = sky.position_m(*cloud);
        const double nearest = std::max(
            length(place + shape.centre_m - flash.position_m) - shape.radius_m - scattered(sky, form).reach_m,
            1.0);
        if (flash.intensity * 1e6 / (nearest * nearest) < kLeastFlash) continue;
        lit.push_back({light_id(*cloud, form), &shape, place, light_of(flash), form.phase,
                       sky.options().formation_softness});
    }
    flash_.update(lit);
}

template <class Work>
void SkyBillboards::each_billboard(const SkySimulation& sky, const FormedCloud& formed, double time_s,
                                   const DrawnClouds& out, std::vector<CloudBillboard>& to,
                                   const Work& work) {
    const auto& [cloud, form] = formed;
    const Cloud& shape = sky.shapes()[form.shape].cloud;
    const Vec3 place = sky.position_m(*cloud);
    for (const Billboard& billboard : scattered(sky, form).billboards) {
        const double weight =
            phase_weight(shape.boxes[billboard.box].distance, form.phase, sky.options().formation_softness);
        if (weight <= 0) continue;
        CloudBillboard& drawn = to.emplace_back();
        drawn.centre_m = billboard.centre_m + place;
        drawn.centre_m += sky.lean_m(*cloud, form, drawn.centre_m.z, time_s);
        drawn.width_m = float(billboard.width_m);
        drawn.height_m = float(billboard.height_m);
        drawn.opacity = float(weight);
        drawn.texture = billboard.texture;
        drawn.variant = billboard.variant;
        if (out.textures) drawn.picture = out.textures->picture_of(sky.model(form), billboard.variant);
        work(billboard, drawn);
    }
}

void SkyBillboards::list(const SkySimulation& sky, const FormedCloud& formed, bool flash, double time_s,
                         DrawnClouds& out) {
    const auto& [cloud, form] = formed;
    const Cloud& shape = sky.shapes()[form.shape].cloud;
    const ScatteredBillboards& what = scattered(sky, form);
    const Vec3 place = sky.position_m(*cloud);
    const std::span<const double> sun = sun_.absorbed(light_id(*cloud, form));
    // A cloud that the lightning does not reach is as dark in it as one that absorbs it all.
    const std::span<const double> lightning =
        flash ? flash_.absorbed(light_id(*cloud, form)) : std::span<const double>{};
    const auto index = std::uint32_t(out.clouds.size());
    out.clouds.push_back({shape.centre_m + place, what.low_m + place.z, what.high_m + place.z});
    each_billboard(sky, formed, time_s, out, out.billboards,
                   [&](const Billboard& billboard, CloudBillboard& drawn) {
                       drawn.sun_absorbed = float(sun[billboard.box]);
                       drawn.flash_absorbed = lightning.empty() ? 1.0f : float(lightning[billboard.box]);
                       drawn.cloud = index;
                   });
}

void SkyBillboards::list_unseen(const SkySimulation& sky, const FormedCloud& formed, double time_s,
                                DrawnClouds& out) {
    each_billboard(sky, formed, time_s, out, out.unseen, [](const Billboard&, CloudBillboard&) {});
}

std::size_t SkyBillboards::append(const SkySimulation& sky, std::span<const SkyCloud> clouds,
                                  const RenderOptions& options, const std::optional<Flash>& flash,
                                  DrawnClouds& out, bool cull, const std::optional<Camera>& mirrored,
                                  const std::optional<FilmFrame>& film, std::optional<double> at_s) {
    const double time_s = at_s ? *at_s : sky.time_s(), state = sky.state_at(time_s);
    std::vector<FormedCloud> formed;
    for (const SkyCloud& cloud : clouds)
        for (const CloudForm& form : sky.forms(cloud, state)) formed.push_back({&cloud, form});
    const std::size_t computed = light_by_sun(sky, formed, options, film);
    const CameraFrame camera = camera_frame(options.camera),
                      mirror = camera_frame(mirrored.value_or(options.camera));
    const Frustum frustum(camera), below(mirror);
    std::vector<FormedCloud> seen, unseen;
    for (const FormedCloud& each : formed) {
        const Cloud& shape = sky.shapes()[each.form.shape].cloud;
        const Vec3 centre_m = sky.position_m(*each.cloud) + shape.centre_m;
        const ScatteredBillboards& what = scattered(sky, each.form);
        const double lean_m = farthest_lean_m(sky, *each.cloud, each.form, what.billboards, time_s),
                     radius_m = shape.radius_m + what.reach_m + lean_m;
        const bool is_seen = !cull || frustum.may_see(centre_m - camera.position_m, radius_m) ||
                             below.may_see(centre_m - mirror.position_m, radius_m);
        (is_seen ? seen : unseen).push_back(each);
    }
    if (flash) light_by_flash(sky, *flash, seen);
    std::size_t billboards = out.billboards.size(), more = out.unseen.size();
    for (const FormedCloud& each : seen) billboards += scattered(sky, each.form).billboards.size();
    for (const FormedCloud& each : unseen) more += scattered(sky, each.form).billboards.size();
    // With what the renderer makes of one: its order and its form on the device, and its shade.
    require_memory((billboards + more) * (sizeof(CloudBillboard) + 384),
                   "the billboards of " + std::to_string(formed.size()) + " clouds");
    out.billboards.reserve(billboards);
    out.unseen.reserve(more);
    for (const FormedCloud& each : seen) list(sky, each, flash.has_value(), time_s, out);
    for (const FormedCloud& each : unseen) list_unseen(sky, each, time_s, out);
    return computed;
}

Picture SkyPainter::draw(Renderer& renderer, const MetaballCloud& voxels, std::span<const SkyLayer> layers,
                         const RenderOptions& moving, double time_s, bool depth,
                         const std::optional<GroundCoverView>& ground_cover, const Weather& weather,
                         const std::optional<FilmFrame>& film) {
    return finish(renderer,
                  begin(renderer, voxels, layers, moving, time_s, depth, ground_cover, weather, film));
}

PendingSkyPicture SkyPainter::begin(Renderer& renderer, const MetaballCloud& voxels,
                                    std::span<const SkyLayer> layers, const RenderOptions& moving,
                                    double time_s, bool depth,
                                    const std::optional<GroundCoverView>& ground_cover,
                                    const Weather& weather, const std::optional<FilmFrame>& film,
                                    std::span<const DrawnVeil> veils) {
    check(moving);
    RenderOptions options = moving;
    if (terrain_) require_above_ground(moving.camera, time_s);
    options.camera = camera(moving, time_s);
    options.sun = sun_at(moving.sun, time_s);
    const bool rain = options.precipitation.enabled && !weather.curtains.empty();
    layers_.resize(layers.size());
    DrawnClouds drawn;
    drawn.textures = textures_;
    const std::optional<Flash> flash = flash_at(options.lightning, time_s);
    std::optional<Camera> mirrored;
    if (shows_reflections(options, ground_cover.value_or(GroundCoverView{})))
        mirrored = mirrored_camera(options);
    for (std::size_t i = 0; i < layers.size(); ++i) {
        const SkyLayer& layer = layers[i];
        if (layer.direct)
            layers_[i].append(*layer.sky, layer.clouds, options, flash, drawn, true, mirrored, film, time_s);
    }
    std::vector<std::vector<WorldLine>> lines;
    for (const SkyLayer& layer : layers)
        lines.push_back(debug_lines(*layer.sky, layer.clouds, options, light_of(options.sun)));
    // Rain wants the depth of the clouds and their shadow, veils the depth.
    const bool all = depth || rain;
    std::optional<Rainfall> rainfall;
    if (rain) {
        rainfall = Rainfall{moving, weather, time_s};
        // It knows the camera's path itself, for the time that the shutter is open.
        const double half_s = 0.5 * moving.precipitation.exposure_s;
        rainfall->options.camera = standing_camera(moving.camera, terrain_.get(), moving.ground,
                                                   std::array{time_s - half_s, time_s, time_s + half_s});
        rainfall->options.sun = options.sun;
        if (terrain_) rainfall->weather.relief = relief_of(terrain_, moving.ground);
        if (ground_cover) rainfall->options.ground.albedo = mean_albedo(options, *ground_cover);
    }
    DepthsInVoxels depths = depths_in_voxels(layers, options.sun, flash, time_s);
    PendingPicture picture =
        renderer.begin({drawn.clouds, drawn.billboards, voxels, flash, time_s, all || !veils.empty(), all,
                        ground_cover, textures_ ? textures_->pictures : nullptr, drawn.unseen,
                        std::move(depths.to_sun), terrain_, std::move(depths.to_flash)},
                       options, veils, std::move(rainfall));
    return {std::move(picture), std::move(options), std::move(lines), std::move(drawn)};
}

Camera SkyPainter::camera(const RenderOptions& options, double time_s) const {
    return standing_camera(options.camera, terrain_.get(), options.ground, time_s);
}

Picture SkyPainter::finish(Renderer& renderer, PendingSkyPicture&& pending) {
    Picture picture = renderer.finish(std::move(pending.picture));
    for (const std::vector<WorldLine>& lines : pending.lines)
        draw_lines(picture, pending.options.camera, lines);
    return picture;
}

}  // namespace nephos
