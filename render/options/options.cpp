// SPDX-License-Identifier: Apache-2.0
#include "render/options/options.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>

#include "core/error.h"
#include "render/options/camera.h"
#include "render/options/device_options.h"
#include "render/options/height_format.h"
#include "render/options/sun_position.h"
#include "render/options/veil_view.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

// Throws Error(usage) unless `good`.
void require(bool good, const char* key, const char* expected) {
    if (!good) throw Error(ErrorCode::usage, std::string(key) + ": expected " + expected);
}

// Returns true when min <= value <= max; false for NaN.
bool within(double value, double min, double max) { return value >= min && value <= max; }
bool within(const std::array<double, 3>& values, double min, double max) {
    return std::ranges::all_of(values, [&](double value) { return within(value, min, max); });
}

bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

void check_colour(const Rgb& colour, const char* name) {
    require(within(colour, 0, 1e6), name, "three numbers from 0 to 1e6");
}

void check_path(const Camera& camera) {
    for (std::size_t n = 0; n < camera.path.size(); ++n) {
        const CameraKey& key = camera.path[n];
        require(std::isfinite(key.time_s), "camera.path.time_s", "finite seconds");
        require(n == 0 || key.time_s > camera.path[n - 1].time_s, "camera.path.time_s",
                "times that rise from key to key");
        require(finite(key.position_m), "camera.path.position_m", "finite metres");
        require(finite(key.target_m), "camera.path.target_m", "finite metres");
        require(key.position_m != key.target_m, "camera.path.target_m", "another point than position_m");
    }
}

void check(const AtmosphereOptions& atmosphere) {
    require(within(atmosphere.haze, 0, 100), "atmosphere.haze", "0..100");
    require(within(atmosphere.haze_g, 0, 0.95), "atmosphere.haze_g", "0..0.95");
    require(within(atmosphere.ozone, 0, 10), "atmosphere.ozone", "0..10");
    require(within(atmosphere.ambient, 0, 10), "atmosphere.ambient", "0..10");
    require(within(atmosphere.adaptation, 0, 1), "atmosphere.adaptation", "0..1");
    check_colour(atmosphere.night, "atmosphere.night");
}

void check(const LevelOfDetailOptions& options) {
    require(within(options.pixels, 0, 1000), "level_of_detail.pixels", "0..1000 pixels");
}

void check(const WaterOptions& options) {
    require(within(options.wind_m_per_s, 0, 25), "water.wind_m_per_s", "0..25 m/s");
    require(within(options.from_deg, 0, 360), "water.from_deg", "0..360 degrees");
    require(within(options.whitecaps, 0, 10), "water.whitecaps", "0..10");
}

void check(const WetGroundOptions& options) {
    require(within(options.soaking_mm, 1e-3, 100), "wet_ground.soaking_mm", "0.001..100 mm");
    require(within(options.puddle_film_mm, 1e-3, 100), "wet_ground.puddle_film_mm", "0.001..100 mm");
    require(within(options.puddle_size_m, 0.1, 1000), "wet_ground.puddle_size_m", "0.1..1000 metres");
    require(within(options.reflection, 0, 1), "wet_ground.reflection", "0..1");
    require(within(options.reflection_scale, 0.1, 1), "wet_ground.reflection_scale", "0.1..1");
    require(within(options.sheen, 0, 1), "wet_ground.sheen", "0..1");
    require(within(options.ripples, 0, 10), "wet_ground.ripples", "0..10");
    require(within(options.snow_cover_mm, 1e-3, 1000), "wet_ground.snow_cover_mm", "0.001..1000 mm");
    require(within(options.snow_albedo, 0, 1), "wet_ground.snow_albedo", "three numbers from 0 to 1");
}

}  // namespace

void check(const PrecipitationOptions& p) {
    require(within(p.particles, 0, 2e6), "precipitation.particles", "0..2,000,000");
    require(within(p.exposure_s, 0, 1), "precipitation.exposure_s", "0..1 seconds");
    require(within(p.visibility, 0, 1000), "precipitation.visibility", "0..1000");
    require(within(p.intensity_scale, 0, 100), "precipitation.intensity_scale", "0..100");
    require(within(p.wind_drift, 0, 10), "precipitation.wind_drift", "0..10");
    require(within(p.depth_m, 1, 1000), "precipitation.depth_m", "1..1000 metres");
    require(within(p.margin_m, 0, 100), "precipitation.margin_m", "0..100 metres");
    require(within(p.reach_m, 1, 1e5), "precipitation.reach_m", "1..100,000 metres");
    require(within(p.edge, 0, 1), "precipitation.edge", "0..1");
    require(within(p.shafts, 0, 100), "precipitation.shafts", "0..100");
    require(within(p.shaft_texture, 0, 1), "precipitation.shaft_texture", "0..1");
    require(within(p.evaporation, 0, 1), "precipitation.evaporation", "0..1");
    require(within(p.splashes, 0, 10), "precipitation.splashes", "0..10");
}

void check(const VeilView& view) {
    const TwoSampleLight& s = view.two_samples;
    require(within(view.samples, 4, 256), "slab.samples", "4..256");
    require(within(view.finer_octaves, 0, 12), "slab.finer_octaves", "0..12");
    require(within(view.height_slope, -100, 100), "slab.height_slope", "-100..100");
    require(within(view.height_offset, -100, 100), "slab.height_offset", "-100..100");
    require(within(view.g, -0.99, 0.99), "slab.g", "-0.99..0.99");
    require(within(view.halo, 0, 1), "slab.halo", "0..1");
    require(within(s.sun_step_m, 0.1, 1e5), "slab.two_samples.sun_step_m", "0.1..100,000 metres");
    require(within(s.shade_gain, -100, 100), "slab.two_samples.shade_gain", "-100..100");
    require(within(s.shade_offset, -100, 100), "slab.two_samples.shade_offset", "-100..100");
    require(within(s.shade_power, 0, 100), "slab.two_samples.shade_power", "0..100");
    require(within(s.glow_gain, 0, 100), "slab.two_samples.glow_gain", "0..100");
    require(within(s.glow_power, 0, 100), "slab.two_samples.glow_power", "0..100");
    require(within(s.bounce_power, 0, 100), "slab.two_samples.bounce_power", "0..100");
}

void check(const Shells& shells) {
    require(shells.count >= 1 && shells.count <= int(shader::kMaxShells), "shells.count", "1..128 shells");
    require(within(shells.spacing_m, 0.1, 1e5), "shells.spacing_m", "0.1..1e5 metres");
    require(within(shells.growth, 1, 2), "shells.growth", "1..2");
    require(reach_m(shells) <= 1e6, "shells.growth", "shells that end within 1000 km");
}

void check(const LightShafts& shafts) {
    require(within(shafts.strength, 0, 1), "light_shafts.strength", "0..1");
    require(within(shafts.g, -0.99, 0.99), "light_shafts.g", "-0.99..0.99");
    require(within(shafts.sun_share, 0, 1), "light_shafts.sun_share", "0..1");
}

void check(const Fog& fog) {
    require(within(fog.extinction_per_m, 0, 10), "fog.extinction_per_m", "0..10 per metre");
    require(within(fog.base_m, -1e5, 1e5), "fog.base_m", "-1e5..1e5 metres");
    require(within(fog.height_m, 0.1, 1e5), "fog.height_m", "0.1..1e5 metres");
    require(within(fog.patchiness, 0, 1), "fog.patchiness", "0..1");
    require(within(fog.patch_m, 1, 1e6), "fog.patch_m", "1..1e6 metres");
    const Vec3& v = fog.velocity_m_per_s;
    require(within({v.x, v.y, v.z}, -1e3, 1e3), "fog.velocity_m_per_s",
            "three numbers, -1000..1000 metres per second");
}

HeightFormat height_format(const std::filesystem::path& file) {
    std::string ending = file.extension().string();
    std::ranges::transform(ending, ending.begin(),
                           [](char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; });
    if (ending == ".png") return HeightFormat::png;
    if (ending == ".exr") return HeightFormat::exr;
    return ending == ".raw" || ending == ".r16" ? HeightFormat::raw : HeightFormat::none;
}

void check(const TerrainOptions& terrain) {
    require(!terrain.height_map || terrain.relief == Relief::none, "ground.height_map", "a height map or relief, not both");
    require(finite({terrain.x_m, terrain.y_m, 0}), "terrain.x_m", "finite metres");
    require(within(terrain.width_m, 10, 1e6), "terrain.width_m", "10..1e6 metres");
    require(within(terrain.length_m, 10, 1e6), "terrain.length_m", "10..1e6 metres");
    require(within(terrain.height_scale_m, 0, 20000), "terrain.height_scale_m", "0..20,000 metres");
    require(within(terrain.offset_m, -1e5, 1e5), "terrain.offset_m", "-1e5..1e5 metres");
    require(within(terrain.edge, 0, 0.5), "terrain.edge", "0..0.5");
    require(within(terrain.raw_columns, 0, 4096), "terrain.raw_columns", "0..4096 heights");
    require(within(terrain.raw_rows, 0, 4096), "terrain.raw_rows", "0..4096 heights");
    require(terrain.cells >= 16 && terrain.cells <= 4096, "terrain.cells", "16..4096 heights on a side");
    require(within(terrain.feature_m, 100, 1e5), "terrain.feature_m", "100..1e5 metres");
    require(within(terrain.rock_slope_deg, 0, 90), "terrain.rock_slope_deg", "0..90 degrees");
    for (const double part : terrain.rock_albedo) require(within(part, 0, 1), "terrain.rock_albedo", "0..1");
    require(!std::isnan(terrain.snow_line_m), "terrain.snow_line_m", "a number");
}

void check(const RenderOptions& options) {
    const Camera& camera = options.camera;
    require(finite(camera.position_m), "camera.position_m", "finite metres");
    require(finite(camera.target_m), "camera.target_m", "finite metres");
    require(camera.position_m != camera.target_m, "camera.target_m", "another point than position_m");
    require(within(camera.vertical_fov_deg, 1, 170), "camera.vertical_fov_deg", "1..170 degrees");
    require(within(camera.width, 1, 16384), "camera.width", "1..16384 pixels");
    require(within(camera.height, 1, 16384), "camera.height", "1..16384 pixels");
    require(within(camera.exposure_ev, -50, 50), "camera.exposure_ev", "-50..50 stops");
    require(within(camera.adaptation_s, 0, 60), "camera.adaptation_s", "0..60 seconds");
    require(within(camera.glare, 0, 1), "camera.glare", "0..1");
    check_path(camera);
    check(options.precipitation);
    check(options.level_of_detail);
    require(within(options.sun.elevation_deg, -18, 90), "sun.elevation_deg", "-18..90 degrees");
    require(within(options.sun.azimuth_deg, -360, 360), "sun.azimuth_deg", "-360..360 degrees");
    check_colour(options.sun.colour, "sun.colour");
    require(within(options.sun.latitude_deg, -90, 90), "sun.latitude_deg", "-90..90 degrees");
    require(within(options.sun.longitude_deg, -180, 180), "sun.longitude_deg", "-180..180 degrees");
    const CloudLight& light = options.light;
    require(within(light.albedo, 0, 1), "light.albedo", "0..1");
    require(within(light.phase.g, -0.99, 0.99), "light.g", "-0.99..0.99");
    require(within(light.phase.droplet_diameter_um, kMinDroplet_um, kMaxDroplet_um),
            "light.droplet_diameter_um", "5..50 micrometres");
    require(within(light.bows, 0, 1), "light.bows", "0..1");
    require(within(light.droplet_variance, kMinDropletVariance, kMaxDropletVariance), "light.droplet_variance",
            "0.01..0.3");
    require(within(light.octaves.count, 1, 8), "light.octaves.count", "1..8");
    require(within(light.octaves.scattering, 0, 1), "light.octaves.scattering", "0..1");
    require(within(light.octaves.extinction, 0, 1), "light.octaves.extinction", "0..1");
    require(within(light.octaves.asymmetry, 0, 1), "light.octaves.asymmetry", "0..1");
    require(within(light.multiple_scattering, 0, 10), "light.multiple_scattering", "0..10");
    check_colour(light.ambient_top, "light.ambient_top");
    check_colour(light.ambient_base, "light.ambient_base");
    require(light.light_distance_m > 0, "light.light_distance_m", "metres above 0");
    require(light.cfa_clouds_per_frame >= 0, "light.cfa_clouds_per_frame", "0 or more clouds");
    require(within(options.air.extinction_per_m, 0, 1), "air.extinction_per_m",
            "three numbers from 0 to 1 per metre");
    check_colour(options.air.horizon, "air.horizon");
    check_colour(options.air.zenith, "air.zenith");
    check(options.atmosphere);
    require(std::isfinite(options.ground.height_m), "ground.height_m", "finite metres");
    check(options.terrain);
    require(within(options.ground.field_m, 20, 5000), "ground.field_m", "20..5000 metres");
    require(within(options.ground.albedo, 0, 1), "ground.albedo", "three numbers from 0 to 1");
    check(options.water);
    check(options.wet_ground);
    require(within(options.shadow_map_size, 16, 8192), "shadow_map_size", "16..8192 texels");
    check(options.shells);
    check(options.light_shafts);
    check(options.fog);
    for (const LightningFlash& flash : options.lightning) {
        require(finite(flash.position_m), "lightning.position_m", "finite metres");
        require(flash.time_s >= 0 && std::isfinite(flash.time_s), "lightning.time_s", "0 or more seconds");
        require(flash.duration_s > 0 && std::isfinite(flash.duration_s), "lightning.duration_s",
                "seconds above 0");
        require(within(flash.colour, 0, 1), "lightning.colour", "three numbers from 0 to 1");
        require(within(flash.intensity, 0, 1e6), "lightning.intensity", "0..1e6");
    }
}

Vec3 direction_to_sun(const Sun& sun) {
    constexpr double kRadians = std::numbers::pi / 180.0;
    const double elevation = sun.elevation_deg * kRadians, azimuth = sun.azimuth_deg * kRadians;
    return {std::sin(azimuth) * std::cos(elevation), std::cos(azimuth) * std::cos(elevation),
            std::sin(elevation)};
}

Sun sun_at(const Sun& sun, double time_s) {
    Sun now = sun;
    if (sun.date.empty() && sun.time.empty()) return now;
    const std::optional<double> days = days_since_2000(sun.date, sun.time);
    require(days.has_value(), "sun.date and sun.time", "a moment such as 2026-06-21 and 18:30");
    const SunPosition position =
        sun_position(*days + (sun.moves ? time_s / 86400 : 0), sun.latitude_deg, sun.longitude_deg);
    now.elevation_deg = std::max(position.elevation_deg, -18.0);
    now.azimuth_deg = position.azimuth_deg;
    now.date.clear();
    now.time.clear();
    return now;
}

std::optional<Flash> flash_at(std::span<const LightningFlash> lightning, double time_s) {
    std::optional<Flash> brightest;
    for (const LightningFlash& flash : lightning) {
        const double left = 1 - (time_s - flash.time_s) / flash.duration_s;
        if (!(left > 0 && left <= 1)) continue;
        const double intensity = flash.intensity * left * left;
        if (intensity > (brightest ? brightest->intensity : 0))
            brightest = Flash{flash.position_m, flash.colour, intensity};
    }
    return brightest;
}

std::string requested_device(const DeviceOptions& options) {
    const char* environment = std::getenv("NEPHOS_DEVICE");
    return options.device.empty() && environment != nullptr ? environment : options.device;
}

bool needs_vulkan(const DeviceOptions& options) {
    if (options.splatting == Splatting::automatic) return !requested_device(options).empty();
    return options.splatting != Splatting::cpu;
}

}  // namespace nephos
