// SPDX-License-Identifier: Apache-2.0

// The part of Atmosphere that computes the air between the eye and a distance.

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "render/atmosphere/atmosphere_tables.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr std::size_t kColumns = shader::kSkyColumns, kRows = shader::kSkyRows, kSide = shader::kAirRows;
static_assert(kRows == 2 * kSide);
constexpr double kNearest_km = 0.02;    // of the first column: no air has no source
constexpr double kLongestPart_km = 6;  // of the integration
constexpr std::size_t kMostParts = 24;  // between two columns

// A ray of the table; altitudes of at least half a metre, where the ground can be met.
struct TableRay {
    double radius, sine, length;
    bool below;

    TableRay(const SphericalAir& air, double eye_altitude_m, std::size_t row) {
        radius = radius_at(air, std::max(eye_altitude_m, 0.5));
        const double horizon = air.horizon_sine(radius);
        const double v = double(row % kSide) / double(kSide - 1), q = v * v, away = q * (2 - q);
        below = row < kSide;
        sine = below ? horizon - (1 + horizon) * away : horizon + (1 - horizon) * away + 1e-7;
        const double across = (radius - air.ground) * (radius + air.ground) / radius;
        length = below ? across / (std::sqrt(std::max(0.0, (horizon - sine) * (-horizon - sine))) - sine)
                       : air.to_top(radius, sine);
    }

    // Beyond the length of a ray above the horizon there is no air.
    double distance(std::size_t column) const {
        const double share = double(column) / double(kColumns - 1);
        constexpr double kScale_km = double(shader::kAirScale) / 1000;
        const double there = below              ? share * length
                             : column == kColumns - 1 ? length
                                                      : kScale_km * share / (1 - share);
        return std::clamp(there, std::min(kNearest_km, 0.5 * length), length);
    }
};

}  // namespace

double air_table_distance_m(const AtmosphereModel& model, double eye_altitude_m, std::size_t row,
                            std::size_t column) {
    return 1000 * TableRay(SphericalAir(model), eye_altitude_m, row).distance(column);
}

AirTable Atmosphere::air(double eye_altitude_m, double sun_elevation_deg) const {
    const Tables& t = *tables_;
    const double sun = sine_of(sun_elevation_deg), sun_cosine = std::sqrt(1 - sun * sun);
    AirTable table;
    const std::size_t texels = 4 * kColumns * kRows;
    table.transmittance.resize(texels);
    for (std::vector<float>& layer : table.scattered) layer.resize(texels);
    for (std::vector<float>& layer : table.haze) layer.resize(texels);
    tbb::parallel_for(std::size_t{0}, kRows, [&](std::size_t row) {
        const TableRay ray(t.air, eye_altitude_m, row);
        const double level = std::sqrt(std::max(0.0, 1 - ray.sine * ray.sine));
        double cos_to_sun[3], phase[3];  // towards the sun, beside it, away from it
        for (std::size_t a = 0; a < 3; ++a) {
            cos_to_sun[a] = ray.sine * sun + (1 - double(a)) * double(shader::kAirAzimuth) * level * sun_cosine;
            phase[a] = double(shader::molecule_phase(float(cos_to_sun[a])));
        }
        Rgb scattered[3]{}, haze[3]{};
        double left[3] = {1, 1, 1};
        const auto add = [&](const AirPart& part) {
            const double radius = double(part.radius);
            for (std::size_t a = 0; a < 3; ++a) {
                const double sine = std::clamp(
                    (ray.radius * sun + double(part.distance) * cos_to_sun[a]) / radius, -1.0, 1.0);
                const Rgb light = t.sunlight(radius, sine);
                const double column = sun_coordinate(sine), height = psi_coordinate(t.air, radius);
                for (std::size_t c = 0; c < 3; ++c) {
                    const double many =
                        between_logs(&t.tables.psi[c * kPsiRadii * kSunSines], column, height, kPsiRadii);
                    const double of_molecules = double(part.rayleigh[c]), of_haze = double(part.mie[c]);
                    scattered[a][c] += phase[a] * light[c] * of_molecules + many * (of_molecules + of_haze);
                    haze[a][c] += light[c] * of_haze;
                }
            }
        };
        double begin = 0;
        for (std::size_t column = 0; column < kColumns; ++column) {
            const double end = ray.distance(column), step = end - begin;
            const auto parts = std::min(kMostParts, std::size_t(step / kLongestPart_km) + 1);
            for (std::size_t k = 0; k < parts && step > 0; ++k)
                add(air_part(t.air, ray.radius, ray.sine, begin + step * double(k) / double(parts),
                             begin + step * double(k + 1) / double(parts), left));
            begin = end;
            const std::size_t at = 4 * (row * kColumns + column);
            for (std::size_t c = 0; c < 3; ++c) {
                table.transmittance[at + c] = float(left[c]);
                for (std::size_t a = 0; a < 3; ++a) {
                    table.scattered[a][at + c] = float(scattered[a][c]);
                    table.haze[a][at + c] = float(haze[a][c]);
                }
            }
        }
    });
    return table;
}

}  // namespace nephos
