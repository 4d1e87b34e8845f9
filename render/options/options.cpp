// SPDX-License-Identifier: Apache-2.0
#include "render/options/options.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/options/camera.h"
#include "render/options/option_checks.h"
#include "render/options/sun_position.h"

namespace nephos {
namespace {

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

}  // namespace

void check(const RenderOptions& options) {
    const Camera& camera = options.camera;
    require(finite(camera.position_m), "camera.position_m", "finite metres");
    require(finite(camera.target_m), "camera.target_m", "finite metres");
    require(camera.position_m != camera.target_m, "camera.target_m", "another point than position_m");
    require(within(camera.vertical_fov_deg, 1, 170), "camera.vertical_fov_deg", "1..170 degrees");
    require(within(camera.width, 1, 16384), "camera.width", "1..16384 pixels");
    require(within(camera.height, 1, 16384), "camera.height", "1..16384 pixels");
    require(within(camera.exposure_ev, -50, 50), "camera.exposure_ev", "-50..50 stops");
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
    require(within(options.ground.albedo, 0, 1), "ground.albedo", "three numbers from 0 to 1");
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

}  // namespace nephos
