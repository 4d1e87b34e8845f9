// SPDX-License-Identifier: Apache-2.0
#include "render/atmosphere/air_colours.h"

#include <algorithm>

#include "render/atmosphere/spectrum.h"

namespace nephos {
namespace {

constexpr std::size_t kBands = 2;

// Wavelength number `c` of a band.
constexpr std::size_t wavelength(std::size_t band, std::size_t c) { return kBands * c + band; }

// Returns the reflectance at a wavelength of a surface with a colour: constant where a primary is strong,
// linear between.
double reflectance(const Rgb& colour, double nm) {
    constexpr double kBlue = 470, kGreen = 545, kRed = 605;
    if (nm <= kGreen) {
        const double green = std::clamp((nm - kBlue) / (kGreen - kBlue), 0.0, 1.0);
        return colour[2] + green * (colour[1] - colour[2]);
    }
    const double red = std::clamp((nm - kGreen) / (kRed - kGreen), 0.0, 1.0);
    return colour[1] + red * (colour[0] - colour[1]);
}

// `ozone`: relative to the Earth's.
AtmosphereModel band_model(const AtmosphereModel& given, std::size_t band, double ozone) {
    AtmosphereModel model = given;
    for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t w = wavelength(band, c);
        model.rayleigh_per_m[c] = rayleigh_per_m(kWavelengths_nm[w]);
        model.ozone_per_m[c] = ozone * kOzone_per_m[w];
        model.ground_albedo[c] = reflectance(given.ground_albedo, kWavelengths_nm[w]);
    }
    return model;
}

// Adds what a band's three wavelengths contribute to a colour.
void add_band(const Rgb& light, std::size_t band, Rgb& sum) {
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t k = 0; k < 3; ++k) sum[k] += kRgbOfWavelengths[k][wavelength(band, c)] * light[c];
}

// Replaces the texels of a layer of two bands by their colours.
std::vector<float> mixed(const std::vector<float>& first, const std::vector<float>& second) {
    std::vector<float> texels(first.size());
    for (std::size_t i = 0; i < texels.size(); i += 4) {
        Rgb sum{};
        add_band({first[i], first[i + 1], first[i + 2]}, 0, sum);
        add_band({second[i], second[i + 1], second[i + 2]}, 1, sum);
        const Rgb colour = into_gamut(sum);
        for (std::size_t c = 0; c < 3; ++c) texels[i + c] = float(colour[c]);
    }
    return texels;
}

}  // namespace

Rgb into_gamut(const Rgb& colour) {
    const double least = std::min({colour[0], colour[1], colour[2]});
    if (least >= 0) return colour;
    const double luminance = 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2];
    if (luminance <= 0) return {};
    const double kept = luminance / (luminance - least);
    Rgb result{};
    for (std::size_t c = 0; c < 3; ++c)
        result[c] = std::max(0.0, luminance + kept * (colour[c] - luminance));
    return result;
}

AirColours::AirColours(const AtmosphereModel& model, SkyColours colours) : model_(model), colours_(colours) {
    if (colours == SkyColours::primaries) {
        bands_.emplace_back(model);
        return;
    }
    const double ozone = model.ozone_per_m[1] / AtmosphereModel{}.ozone_per_m[1];
    for (std::size_t band = 0; band < kBands; ++band) bands_.emplace_back(band_model(model, band, ozone));
    model_.rayleigh_per_m = kThinRayleigh_per_m;
    for (std::size_t c = 0; c < 3; ++c) model_.ozone_per_m[c] = ozone * kThinOzone_per_m[c];
}

template <class Light>
Rgb AirColours::colour_of(const Light& light) const {
    if (bands_.size() == 1) return light(bands_.front());
    Rgb sum{};
    for (std::size_t band = 0; band < kBands; ++band) add_band(light(bands_[band]), band, sum);
    return into_gamut(sum);
}

Rgb AirColours::above_air() const {
    return colour_of([](const Atmosphere&) { return Rgb{1, 1, 1}; });
}

Rgb AirColours::transmittance(double altitude_m, double sine) const {
    return colour_of([&](const Atmosphere& air) { return air.transmittance(altitude_m, sine); });
}

Rgb AirColours::sunlight(double altitude_m, double sun_elevation_deg) const {
    return colour_of([&](const Atmosphere& air) { return air.sunlight(altitude_m, sun_elevation_deg); });
}

SkyIrradiance AirColours::irradiance(double altitude_m, double sun_elevation_deg) const {
    if (bands_.size() == 1) return bands_.front().irradiance(altitude_m, sun_elevation_deg);
    SkyIrradiance sum;
    for (std::size_t band = 0; band < kBands; ++band) {
        const SkyIrradiance light = bands_[band].irradiance(altitude_m, sun_elevation_deg);
        add_band(light.from_above, band, sum.from_above);
        add_band(light.from_below, band, sum.from_below);
        add_band(light.sideways, band, sum.sideways);
    }
    return {into_gamut(sum.from_above), into_gamut(sum.from_below), into_gamut(sum.sideways)};
}

SkyTable AirColours::sky(double eye_altitude_m, double sun_elevation_deg) const {
    SkyTable first = bands_.front().sky(eye_altitude_m, sun_elevation_deg);
    if (bands_.size() == 1) return first;
    const SkyTable second = bands_.back().sky(eye_altitude_m, sun_elevation_deg);
    return {mixed(first.scattered, second.scattered), mixed(first.haze, second.haze)};
}

AirTable AirColours::air(double eye_altitude_m, double sun_elevation_deg) const {
    AirTable air = bands_.front().air(eye_altitude_m, sun_elevation_deg);
    if (bands_.size() == 1) return air;
    const AirTable second = bands_.back().air(eye_altitude_m, sun_elevation_deg);
    air.transmittance = mixed(air.transmittance, second.transmittance);
    const Rgb white = above_air();
    for (std::size_t i = 0; i < air.transmittance.size(); ++i)
        if (i % 4 < 3) air.transmittance[i] = std::min(1.0f, air.transmittance[i] / float(white[i % 4]));
    for (std::size_t a = 0; a < 3; ++a) {
        air.scattered[a] = mixed(air.scattered[a], second.scattered[a]);
        air.haze[a] = mixed(air.haze[a], second.haze[a]);
    }
    return air;
}

}  // namespace nephos
