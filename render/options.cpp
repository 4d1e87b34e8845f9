// SPDX-License-Identifier: Apache-2.0
#include "render/options.h"

#include <cmath>
#include <string>

#include "automaton/error.h"
#include "render/camera.h"

namespace nephos {
namespace {

void require(bool good, const char* name, const char* expected) {
    if (!good) throw Error(ErrorCode::usage, std::string(name) + ": expected " + expected);
}

// NaN fails every comparison, so it is out of every range.
bool within(double value, double min, double max) { return value >= min && value <= max; }

bool finite(const Vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

bool colour_within(const Rgb& colour, double max) {
    for (const double value : colour)
        if (!within(value, 0, max)) return false;
    return true;
}

void check_colour(const Rgb& colour, const char* name) {
    require(colour_within(colour, 1e6), name, "three numbers from 0 to 1e6");
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
    require(within(options.sun.elevation_deg, -18, 90), "sun.elevation_deg", "-18..90 degrees");
    require(within(options.sun.azimuth_deg, -360, 360), "sun.azimuth_deg", "-360..360 degrees");
    check_colour(options.sun.colour, "sun.colour");
    const CloudLight& light = options.light;
    require(within(light.albedo, 0, 1), "light.albedo", "0..1");
    require(within(light.g, -0.99, 0.99), "light.g", "-0.99..0.99");
    require(within(light.multiple_scattering, 0, 10), "light.multiple_scattering", "0..10");
    check_colour(light.ambient_top, "light.ambient_top");
    check_colour(light.ambient_base, "light.ambient_base");
    require(colour_within(options.air.extinction_per_m, 1), "air.extinction_per_m",
            "three numbers from 0 to 1 per metre");
    check_colour(options.air.horizon, "air.horizon");
    check_colour(options.air.zenith, "air.zenith");
    require(std::isfinite(options.ground.height_m), "ground.height_m", "finite metres");
    require(colour_within(options.ground.albedo, 1), "ground.albedo", "three numbers from 0 to 1");
    require(within(options.shadow_map_size, 16, 8192), "shadow_map_size", "16..8192 texels");
}

}  // namespace nephos
