// SPDX-License-Identifier: Apache-2.0
#include "render/atmosphere/sky_light.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::size_t kKept = 8;        // tables; 200 KB each
// Radiance of the sun's disc at most: without glare white in the picture, with a smooth edge; with glare, which
// hides the edge, what EXR files and devices hold as 16-bit floats.
constexpr double kBrightestDisc = 6, kBrightestGlare = 6e4;
constexpr double kLowestSun_deg = -18;  // astronomical twilight ends: below, the sky changes no more
constexpr std::size_t kTexels = std::size_t{shader::kSkyColumns} * shader::kSkyRows;

// Ranges of elevations and their tables per degree.
struct NodeRange {
    double from_deg, to_deg, per_deg;
};
constexpr NodeRange kNodes[] = {{kLowestSun_deg, -2, 5}, {-2, 2, 16}, {2, 6, 4}, {6, 16, 2}, {16, 90, 0.5}};

double radians(double degrees) { return degrees * kPi / 180; }

Rgb times(const Rgb& a, const Rgb& b) { return {a[0] * b[0], a[1] * b[1], a[2] * b[2]}; }
Rgb times(double s, const Rgb& a) { return {s * a[0], s * a[1], s * a[2]}; }

// Radiance of the disc's middle, bounded, and how it changes with the sine of the elevation near the sun.
void set_disc(const AirColours& air, const RenderOptions& options, const Rgb& sun_above_air,
              double elevation_deg, SkyLight& light) {
    // Radiance at the centre of a disc of mean radiance 1.
    constexpr Rgb kMiddle{1 + double(shader::kLimbDarkeningRed) / 2,
                          1 + double(shader::kLimbDarkeningGreen) / 2,
                          1 + double(shader::kLimbDarkeningBlue) / 2};
    const double eye = air.model().ground_radius_m + light.eye_altitude_m,
                 horizon = -std::sqrt(1 - std::pow(air.model().ground_radius_m / eye, 2)) + 1e-6;
    light.has_disc =
        options.atmosphere.sun_disc && std::sin(radians(elevation_deg + kSunRadius_deg + 0.01)) > horizon;
    if (!light.has_disc) return;
    const double radius = radians(kSunRadius_deg),
                 low = std::max(std::sin(radians(elevation_deg)) - radius, horizon);
    const Rgb below = air.transmittance(light.eye_altitude_m, low),
              above = air.transmittance(light.eye_altitude_m, std::min(low + 2 * radius, 1.0));
    // A channel that has faded away has no slope.
    const double least = 1e-9 * std::max({above[0], above[1], above[2], 1e-20});
    double brightest = 0;
    for (std::size_t c = 0; c < 3; ++c) {
        const double fade = std::log(std::max(above[c], least) / std::max(below[c], least)) / (2 * radius);
        light.disc_fade[c] = fade;
        light.disc[c] = sun_above_air[c] * kPi * kMiddle[c] * below[c] * std::exp(fade * radius) /
                        (kPi * radius * radius);
        brightest = std::max(brightest, light.disc[c]);
    }
    const double most = options.camera.glare > 0 ? kBrightestGlare : kBrightestDisc;
    if (brightest > most) light.disc = times(most / brightest, light.disc);
}

}  // namespace

double sun_node(double elevation_deg) {
    double node = 0;
    for (const NodeRange& range : kNodes)
        node +=
            std::clamp(elevation_deg - range.from_deg, 0.0, range.to_deg - range.from_deg) * range.per_deg;
    return node;
}

double elevation_of_node(double node) {
    double elevation = kLowestSun_deg;
    for (const NodeRange& range : kNodes) {
        const double here = std::clamp(node, 0.0, (range.to_deg - range.from_deg) * range.per_deg);
        elevation += here / range.per_deg;
        node -= here;
    }
    return elevation;
}

const SkyLights::Kept& SkyLights::table(int node, double eye_altitude_m) {
    const auto found = std::ranges::find_if(
        kept_, [&](const Kept& kept) { return kept.node == node && kept.eye_altitude_m == eye_altitude_m; });
    if (found != kept_.end()) {
        kept_.splice(kept_.begin(), kept_, found);
    } else {
        const double elevation = elevation_of_node(node);
        kept_.push_front({node, eye_altitude_m, atmosphere_->sky(eye_altitude_m, elevation),
                          atmosphere_->air(eye_altitude_m, elevation)});
        if (kept_.size() > kKept) kept_.pop_back();
    }
    return kept_.front();
}

void SkyLights::mix_tables(const RenderOptions& options, double elevation_deg) {
    const double node = sun_node(elevation_deg), low = std::floor(node);
    const auto fraction = float(node - low);
    const Kept& first = table(int(low), light_.eye_altitude_m);
    const Kept& second = fraction > 0 ? table(int(low) + 1, light_.eye_altitude_m) : first;
    const SkyTable &a = first.table, &b = second.table;
    const Rgb sun_above_air = adapted_sun(options, elevation_deg);
    light_.texels.assign(4 * kTexels * shader::kSkyLayers, 0.0f);
    float *scattered = light_.texels.data(), *haze = scattered + 4 * kTexels, *sun = haze + 4 * kTexels;
    for (std::size_t c = 0; c < 3; ++c) {
        const auto full = float(kPi * sun_above_air[c]);
        const auto night = float(options.atmosphere.night[c]);
        for (std::size_t i = c; i < 4 * kTexels; i += 4) {
            scattered[i] = full * (a.scattered[i] + fraction * (b.scattered[i] - a.scattered[i])) + night;
            haze[i] = full * (a.haze[i] + fraction * (b.haze[i] - a.haze[i]));
        }
    }
    // The lowest row, whose columns are likewise spaced.
    const double level = std::cos(radians(elevation_deg));
    for (std::size_t n = 0; n < light_.horizon.size(); ++n) {
        const double across = double(n) / double(light_.horizon.size() - 1);
        const std::size_t i = std::size_t(std::lround(across * double(shader::kSkyColumns - 1)));
        const double phase = double(shader::particle_phase(float(level * (1 - 2 * across * across)),
                                                           float(light_.model.mie_g)));
        for (std::size_t c = 0; c < 3; ++c)
            light_.horizon[n][c] = double(scattered[4 * i + c]) + phase * double(haze[4 * i + c]);
    }
    for (std::size_t i = 0; i < shader::kSkyColumns; ++i) {
        const double altitude_m = double(shader::kSunlightTop) * double(i) / double(shader::kSkyColumns - 1);
        const Rgb light = times(sun_above_air, atmosphere_->sunlight(altitude_m, options.sun.elevation_deg));
        for (std::size_t row = 0; row < shader::kSkyRows; ++row)
            for (std::size_t c = 0; c < 3; ++c)
                sun[4 * (row * shader::kSkyColumns + i) + c] = float(light[c]);
    }
    mix_air(first.air, second.air, fraction, times(kPi, sun_above_air), options.atmosphere.night);
    ++light_.serial;
}

// Fills the layers of the air up to distances: the extinction, and the sources, of which 1 - transmittance is seen.
void SkyLights::mix_air(const AirTable& a, const AirTable& b, float fraction, const Rgb& sun, const Rgb& night) {
    constexpr std::size_t kLayer = 4 * kTexels;
    const std::vector<float>* const first[] = {&a.scattered[0], &a.scattered[1], &a.scattered[2], &a.haze[0],
                                               &a.haze[1],      &a.haze[2]};
    const std::vector<float>* const second[] = {&b.scattered[0], &b.scattered[1], &b.scattered[2], &b.haze[0],
                                                &b.haze[1],      &b.haze[2]};
    float* const extinction = light_.texels.data() + std::size_t(shader::kAirLayer) * kLayer;
    for (std::size_t i = 0; i < kLayer; ++i) {
        const std::size_t c = i % 4, column = i / 4 % shader::kSkyColumns,
                          row = i / 4 / shader::kSkyColumns;
        if (c == 3) continue;
        const double left = std::clamp(double(a.transmittance[i]), 1e-12, 1 - 1e-9);
        const double distance_m =
            air_table_distance_m(light_.model, light_.eye_altitude_m, row, column);
        extinction[i] = float(-std::log(left) / distance_m);
        for (std::size_t layer = 0; layer < std::size(first); ++layer) {
            const float low = (*first[layer])[i], high = (*second[layer])[i];
            const double light = double(low + fraction * (high - low));
            // The night shines in what is scattered.
            extinction[(layer + 1) * kLayer + i] =
                float(sun[c] * light / (1 - left) + (layer < 3 ? night[c] : 0.0));
        }
    }
}

// Returns the sun's colour above the air, in units of radiance, with the adaptation of exposure.
Rgb SkyLights::adapted_sun(const RenderOptions& options, double elevation_deg) const {
    constexpr Rgb kLuminance{0.2126, 0.7152, 0.0722};  // Rec. 709
    const Rgb sun = atmosphere_->sunlight(0, elevation_deg),
              sky = atmosphere_->irradiance(0, elevation_deg).from_above;
    double illuminance = 1e-9;
    for (std::size_t c = 0; c < 3; ++c)
        illuminance += kLuminance[c] * (sky[c] + sun[c] * std::max(0.0, std::sin(radians(elevation_deg))));
    return times(kSunAboveAir * std::pow(1 + 0.1 / illuminance, options.atmosphere.adaptation),
                 options.sun.colour);
}

const SkyLight& SkyLights::at(const RenderOptions& options, const CloudHeights& clouds) {
    const AtmosphereModel model = atmosphere_model(options.atmosphere, options.ground.albedo);
    if (!atmosphere_ || made_of_ != model || atmosphere_->colours() != options.atmosphere.colours) {
        atmosphere_.emplace(model, options.atmosphere.colours);
        made_of_ = model;
        kept_.clear();
        light_.texels.clear();
    }
    const double elevation = std::clamp(options.sun.elevation_deg, kLowestSun_deg, 90.0);
    const double altitude = std::max(0.0, options.camera.position_m.z - options.ground.height_m);
    const bool same = !light_.texels.empty() && altitude == light_.eye_altitude_m &&
                      options.sun == last_.sun && options.atmosphere == last_.atmosphere &&
                      (options.camera.glare > 0) == (last_.camera.glare > 0);
    light_.model = atmosphere_->model();
    light_.eye_altitude_m = altitude;
    if (!same) {
        mix_tables(options, elevation);
        set_disc(*atmosphere_, options, adapted_sun(options, elevation), elevation, light_);
        last_.sun = options.sun;
        last_.atmosphere = options.atmosphere;
        last_.camera.glare = options.camera.glare;
    }

    // Irradiance / pi is the radiance of a white surface.
    const Rgb full = adapted_sun(options, elevation), night = options.atmosphere.night;
    const auto above_ground = [&](double z_m) { return std::max(0.0, z_m - options.ground.height_m); };
    const SkyIrradiance ground = atmosphere_->irradiance(0, elevation),
                        top = atmosphere_->irradiance(above_ground(clouds.top_m), elevation),
                        base = atmosphere_->irradiance(above_ground(clouds.base_m), elevation);
    light_.ground_sun = times(full, atmosphere_->sunlight(0, options.sun.elevation_deg));
    const double ambient = options.atmosphere.ambient;
    for (std::size_t c = 0; c < 3; ++c) {
        light_.ground_sky[c] = full[c] * ground.from_above[c] + night[c];
        // A top faces the sky; a base faces the ground and, past the cloud's own shadow, the horizon.
        light_.ambient_top[c] = ambient * (full[c] * top.from_above[c] + night[c]);
        light_.ambient_base[c] =
            ambient * (full[c] * 0.5 * (base.from_below[c] + base.sideways[c]) + 0.5 * night[c]);
    }
    return light_;
}

}  // namespace nephos
