// SPDX-License-Identifier: Apache-2.0
#include "simulation/frame_painter.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "core/wind.h"
#include "density/veil.h"
#include "scenes/format/layers.h"
#include "simulation/cloud_pieces.h"
#include "simulation/frame_detail.h"
#include "simulation/memory.h"
#include "simulation/scene_files.h"

namespace nephos {
namespace {

constexpr double kAboveGround_m = 50;
constexpr double kMostLean = 1;

const Wind& common_wind(const Scene& scene) {
    return scene.automaton.wind.keyframes.empty() && !scene.layers.empty() ? layer_wind(scene, 0)
                                                                           : scene.automaton.wind;
}

// Relative to its cloud, rain falls back with the wind's difference below it.
void lean(RainCurtain& curtain, const Wind& wind, const PrecipitationOptions& p, double time_s) {
    const double fall = p.kind == PrecipitationKind::snow ? 1 : 6;
    const double height = curtain.base_m - curtain.ground_m;
    const Velocity cloud = wind_at(wind, curtain.base_m, time_s),
                   below = wind_at(wind, curtain.ground_m + 0.5 * height, time_s);
    curtain.lean_x = p.wind_drift * (cloud.east_m_per_s - below.east_m_per_s) / fall;
    curtain.lean_y = p.wind_drift * (cloud.north_m_per_s - below.north_m_per_s) / fall;
    const double most = std::hypot(curtain.lean_x, curtain.lean_y) / kMostLean;
    if (most <= 1) return;
    curtain.lean_x /= most;
    curtain.lean_y /= most;
}

constexpr double kLeastWater = 0.05;  // of columns in an area that rain
constexpr int kProbes = 24;           // of the cloud, along each axis of an area

// Lets rain begin where the cloud is: at the highest base within the area, or not at all.
void fall_from(const std::shared_ptr<const CloudBases>& cloud, RainCurtain& curtain) {
    double highest_m = curtain.ground_m;
    for (int j = 0; j < kProbes; ++j) {
        for (int i = 0; i < kProbes; ++i) {
            const double u = (2 * i + 1.0) / kProbes - 1, v = (2 * j + 1.0) / kProbes - 1;
            if (u * u + v * v >= 1) continue;
            const double a = u * curtain.semi_a_m, b = v * curtain.semi_b_m;
            const CloudBases::Column column =
                cloud->at(curtain.x_m + a * curtain.axis_x - b * curtain.axis_y,
                          curtain.y_m + a * curtain.axis_y + b * curtain.axis_x);
            if (column.water >= kLeastWater) highest_m = std::max(highest_m, column.base_m);
        }
    }
    curtain.base_m = highest_m;
    curtain.cloud = cloud;
}

// Returns the cloud of billboards above the rain areas of a layer.
std::shared_ptr<const CloudBases> cloud_of_billboards(const LayerFrame& layer, double time_s) {
    const double most = std::numeric_limits<double>::max();
    Vec2 low_m{most, most}, high_m{-most, -most};
    for (const RainArea& area : layer.rain) {
        const double x_m = std::hypot(area.semi_a_m * area.axis_x, area.semi_b_m * area.axis_y),
                     y_m = std::hypot(area.semi_a_m * area.axis_y, area.semi_b_m * area.axis_x);
        low_m = {std::min(low_m.x, area.x_m - x_m), std::min(low_m.y, area.y_m - y_m)};
        high_m = {std::max(high_m.x, area.x_m + x_m), std::max(high_m.y, area.y_m + y_m)};
    }
    return std::make_shared<CloudBases>(
        cloud_bases(cloud_pieces(*layer.sky, layer.clouds, time_s), low_m, high_m));
}

// The cloud that the rain of a layer falls from: its own, or of a layer whose density is not known that of all. Null: none
// is known.
std::shared_ptr<const CloudBases> cloud_of(const Scene& scene, std::size_t n, const LayerFrame& layer,
                                           const DensityGrid& all, double time_s) {
    const bool own = layer.density.extent().cells() > 0;
    if (!own && layer.direct) return layer.sky != nullptr ? cloud_of_billboards(layer, time_s) : nullptr;
    const DensityGrid& density = own ? layer.density : all;
    if (density.extent().cells() == 0) return nullptr;
    const LayerOptions& options = scene.layers[n];
    const bool whole = density.extent() == options.extent && density.placement() == options.placement;
    return std::make_shared<CloudBases>(
        cloud_bases(density, scene.density.extinction_per_m, whole ? layer.boundaries : Boundaries{}));
}

}  // namespace

FramePainter::FramePainter(const Scene& scene, const DeviceOptions& device)
    : scene_(scene), renderer_(device), ground_(ground_of(scene)), textures_(textures_of(scene)) {
    painter_.use_textures(read_textures(scene));
    painter_.use_terrain(read_terrain(scene));
}

// Without what only covers it.
FramePainter::Ground FramePainter::ground_of(const Scene& scene) {
    Ground ground{.options = scene.render.terrain, .height_m = scene.render.ground.height_m};
    const TerrainOptions plain;
    ground.options.rock_slope_deg = plain.rock_slope_deg;
    ground.options.rock_albedo = plain.rock_albedo;
    ground.options.snow_line_m = plain.snow_line_m;
    if (ground.options.height_map) ground.file = file_stamp(*ground.options.height_map);
    return ground;
}

FileStamps FramePainter::textures_of(const Scene& scene) {
    FileStamps stamps;
    for (const TextureFile& texture : texture_files(scene))
        stamps.emplace(texture.file, file_stamp(texture.file));
    return stamps;
}

void FramePainter::set_scene(const Scene& scene, bool same_layers) {
    Ground ground = ground_of(scene);  // before they are read
    FileStamps files = textures_of(scene);
    const bool same_textures = files == textures_, same_terrain = ground == ground_;
    if (same_layers && same_textures && same_terrain) {
        scene_ = scene;
        return;
    }
    std::shared_ptr<const ModelTextures> textures = read_textures(scene);
    std::shared_ptr<const HeightMap> terrain =
        same_terrain ? painter_.terrain() : read_terrain(scene);
    scene_ = scene;
    if (!same_layers) painter_ = SkyPainter();
    painter_.use_textures(std::move(textures));
    painter_.use_terrain(std::move(terrain));
    ground_ = std::move(ground);
    textures_ = std::move(files);
}

void FramePainter::add_detail(const DensityGrid& density, const std::optional<DensityGrid>& moisture,
                              std::optional<std::size_t> layer, double time_s, std::size_t first,
                              std::size_t count, std::vector<DetailedVoxels>& to) const {
    const DetailSetting setting = detail_setting(scene_, layer, density, time_s);
    if (!setting.options.enabled || count == 0) return;
    to.push_back(
        {.density = density, .moisture = moisture, .setting = setting, .first = first, .count = count});
}

// The metaballs of every lattice, each with the size of its own cells.
std::vector<Metaball> FramePainter::metaballs_of(const FrameResult& frame,
                                                 std::vector<DetailedVoxels>& detailed) const {
    const double radius = scene_.density.metaball_radius_cells;
    std::uint64_t count = 0;
    for (const LayerFrame& layer : frame.layers) count += layer.density.active_voxels();
    const bool of_layers = count > 0;
    if (!of_layers) count = frame.density.active_voxels();
    require_memory(count * 4 * sizeof(Metaball),
                   frame.number > 0 ? fmt::format("{}: drawing frame {}", scene_.name, frame.number)
                                    : scene_.name + ": drawing its voxels");
    if (!of_layers) {
        std::vector<Metaball> balls = metaballs(frame.density, radius);
        add_detail(frame.density, frame.moisture, std::nullopt, frame.time_s, 0, balls.size(), detailed);
        return balls;
    }
    std::vector<Metaball> balls;
    for (std::size_t n = 0; n < frame.layers.size(); ++n) {
        const LayerFrame& layer = frame.layers[n];
        if (layer.direct || scene_.layers[n].is_slab) continue;
        const std::vector<Metaball> more = metaballs(layer.density, radius);
        add_detail(layer.density, layer.moisture, n, frame.time_s, balls.size(), more.size(), detailed);
        balls.insert(balls.end(), more.begin(), more.end());
    }
    return balls;
}

std::vector<DrawnVeil> FramePainter::veils_of(const FrameResult& frame) const {
    std::vector<DrawnVeil> veils;
    for (std::size_t n = 0; n < frame.layers.size(); ++n) {
        const LayerOptions& layer = scene_.layers[n];
        if (!layer.is_slab || frame.layers[n].density.extent().cells() == 0) continue;
        const double opacity = opacity_at(layer, scene_.climate, frame.time_s);
        if (opacity <= 0) continue;
        std::optional<VeilSides> sides;
        if (!layer.slab.to_horizon && !scene_.tile) {
            const Vec3& low = layer.placement.origin_m;
            const double cell = layer.placement.cell_size_m;
            sides = VeilSides{{low.x, low.y},
                              {low.x + layer.extent.x * cell, low.y + layer.extent.y * cell},
                              layer.veil.margin_m};
        }
        veils.push_back({std::make_shared<VeilSlab>(veil_options(scene_, n), layer_wind(scene_, n),
                                                    frame.time_s, layer.slab.finer_octaves, sides),
                         opacity * scene_.density.extinction_per_m, layer.slab});
    }
    return veils;
}

PendingFrame FramePainter::begin(FrameResult frame) {
    std::vector<DetailedVoxels> detailed;
    std::vector<Metaball> balls = metaballs_of(frame, detailed);
    const double radius = scene_.density.metaball_radius_cells;
    const MetaballCloud cloud{balls, scene_.density.extinction_per_m, metaball_normalisation(radius),
                              detailed};
    std::vector<DrawnVeil> veils = veils_of(frame);
    std::vector<SkyLayer> layers;
    for (std::size_t n = 0; n < frame.layers.size(); ++n) {
        const LayerFrame& layer = frame.layers[n];
        if (layer.sky != nullptr)
            layers.push_back({layer.sky, layer.clouds, layer.direct,
                              absorbs_in_voxels(scene_, n) ? &scene_.layers[n] : nullptr});
    }
    std::optional<GroundCoverView> ground;
    if (frame.ground) ground = view_of(*frame.ground);
    const Georeference& place = scene_.georeference;
    RenderOptions options = scene_.render;
    options.sun = scene_sun_at(scene_, frame.time_s);
    std::optional<FilmFrame> film;
    if (frame.number > 0)
        film = FilmFrame{frame.number - 1, &scene_.frames, &scene_.render.sun,
                         place.given ? place.heading_deg : 0, scene_.sun_path};
    PendingSkyPicture picture =
        painter_.begin(renderer_, cloud, layers, options, frame.time_s, scene_.frames.exr, ground,
                       weather_of(scene_, frame.layers, frame.density, frame.time_s), film, veils);
    return {std::move(frame), std::move(balls), std::move(detailed), std::move(veils), std::move(picture)};
}

Picture FramePainter::finish(PendingFrame&& pending) {
    return painter_.finish(renderer_, std::move(pending.picture));
}

Picture FramePainter::draw(const FrameResult& frame) { return finish(begin(frame)); }

Weather weather_of(const Scene& scene, std::span<const LayerFrame> layers, const DensityGrid& all,
                   double time_s) {
    const PrecipitationOptions& p = scene.render.precipitation;
    Weather weather;
    weather.seed = scene.automaton.seed;
    if (!p.enabled) return weather;
    const double ground_m = scene.render.ground.height_m;
    const Wind& wind = common_wind(scene);
    const Velocity now = wind_at(wind, ground_m + kAboveGround_m, time_s);
    const Vec3 path = wind_displacement_m(wind, ground_m + kAboveGround_m, time_s);
    weather.wind_x_m_per_s = p.wind_drift * now.east_m_per_s;
    weather.wind_y_m_per_s = p.wind_drift * now.north_m_per_s;
    weather.carried_x_m = p.wind_drift * path.x;
    weather.carried_y_m = p.wind_drift * path.y;
    for (std::size_t n = 0; n < layers.size(); ++n) {
        const Range& base = scene.layers[n].base_height_m;
        const std::shared_ptr<const CloudBases> cloud =
            layers[n].rain.empty() ? nullptr : cloud_of(scene, n, layers[n], all, time_s);
        for (const RainArea& area : layers[n].rain) {
            RainCurtain curtain;
            curtain.id = area.id;
            curtain.x_m = area.x_m;
            curtain.y_m = area.y_m;
            curtain.semi_a_m = area.semi_a_m;
            curtain.semi_b_m = area.semi_b_m;
            curtain.axis_x = area.axis_x;
            curtain.axis_y = area.axis_y;
            curtain.ground_m = ground_m;
            curtain.base_m = 0.5 * (base.min + base.max);
            if (cloud) fall_from(cloud, curtain);
            if (curtain.base_m <= ground_m) continue;  // no cloud above
            curtain.rate_mm_per_h = area.intensity_mm_per_h;
            lean(curtain, layer_wind(scene, n), p, time_s);
            if (curtain.cloud) {  // its top is below the cloud, its foot lags
                curtain.x_m -= curtain.lean_x * (curtain.base_m - ground_m);
                curtain.y_m -= curtain.lean_y * (curtain.base_m - ground_m);
            }
            weather.curtains.push_back(curtain);
        }
    }
    return weather;
}

}  // namespace nephos
