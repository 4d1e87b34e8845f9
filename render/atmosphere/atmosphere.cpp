// SPDX-License-Identifier: Apache-2.0
#include "render/atmosphere/atmosphere.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <boost/math/special_functions/legendre.hpp>
#include <tbb/parallel_for.h>

#include "render/atmosphere/air_path.h"
#include "render/atmosphere/atmosphere_tables.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr float kLeast = 1e-30f;  // lower limit of values stored as logarithms
constexpr std::size_t kDayParts = 56, kTwilightParts = 96, kPsiParts = 48;

// Heights of the table of irradiances: kIrradianceTop_km (k / (kIrradianceRows - 1))^2.
constexpr std::size_t kIrradianceRows = 8;
constexpr double kIrradianceTop_km = 16;

// Nodes and weights of the Gauss-Legendre rule on 0..1.
struct GaussRule {
    std::vector<double> nodes, weights;

    explicit GaussRule(int count) {
        const std::vector<double> zeros =
            boost::math::legendre_p_zeros<double>(count);  // those from 0 on, rising
        for (auto zero = zeros.rbegin(); zero != zeros.rend(); ++zero) add(count, *zero);
        for (const double zero : zeros)
            if (zero > 0) add(count, -zero);
    }

  private:
    void add(int count, double zero) {
        const double slope = boost::math::legendre_p_prime(count, zero);
        nodes.push_back(0.5 * (1 - zero));
        weights.push_back(1 / ((1 - zero * zero) * slope * slope));
    }
};

// Quadrature over directions: elevations with weights of solid angle / 2 pi, dense around the horizon, where
// radiance varies fastest.
struct Elevations {
    struct One {
        double sine, weight;
    };
    std::vector<One> above, below;

    Elevations(double horizon_sine, int count) {
        const GaussRule rule(count);
        for (std::size_t i = 0; i < rule.nodes.size(); ++i) {
            const double x = rule.nodes[i], weight = 2 * x * rule.weights[i];
            above.push_back({horizon_sine + (1 - horizon_sine) * x * x, (1 - horizon_sine) * weight});
            below.push_back({horizon_sine - (1 + horizon_sine) * x * x, (1 + horizon_sine) * weight});
        }
    }
};

// All suns of the tables' columns, each seen under kAzimuths different azimuths from one elevation.
template <std::size_t kAzimuths>
struct Suns {
    std::vector<float> sine = std::vector<float>(kAzimuths * kSunSines), cos_to_ray = sine;

    explicit Suns(double ray_sine) {
        const double ray_cosine = std::sqrt(std::max(0.0, 1 - ray_sine * ray_sine));
        for (std::size_t a = 0; a < kAzimuths; ++a) {
            const double cos_azimuth = std::cos(kPi * (double(a) + 0.5) / double(kAzimuths));
            for (std::size_t s = 0; s < kSunSines; ++s) {
                const double sun = sun_sine(double(s)), cosine = std::sqrt(std::max(0.0, 1 - sun * sun));
                sine[a * kSunSines + s] = float(sun);
                cos_to_ray[a * kSunSines + s] = float(ray_sine * sun + ray_cosine * cosine * cos_azimuth);
            }
        }
    }
};

double mix(double a, double b, double fraction) { return a + fraction * (b - a); }

}  // namespace

double between_logs(const float* plane, double column, double row, std::size_t rows) {
    const double x = std::clamp(column, 0.0, double(kSunSines - 1) - 1e-9),
                 y = std::clamp(row, 0.0, double(rows - 1) - 1e-9);
    const auto i = std::size_t(x), j = std::size_t(y);
    const float *a = plane + j * kSunSines + i, *b = a + kSunSines;
    return std::exp(mix(mix(double(a[0]), double(a[1]), x - double(i)),
                        mix(double(b[0]), double(b[1]), x - double(i)), y - double(j)));
}

Atmosphere::Tables::Tables(const AtmosphereModel& m) : model(m), air(m) {
    make_columns();
    ground_sun.resize(3 * kGroundSuns);
    for (std::size_t i = 0; i < kGroundSuns; ++i) {
        const double sine = sun_sine(double(i) * double(kSunSines - 1) / double(kGroundSuns - 1));
        const Rgb light = sunlight(air.ground, sine);
        for (std::size_t c = 0; c < 3; ++c)
            ground_sun[c * kGroundSuns + i] = float(light[c] * std::max(sine, 0.0));
    }
    make_psi();
    make_irradiances();
}

// Integrates from the lowest point of the ray, where the air is densest.
void Atmosphere::Tables::make_columns() {
    constexpr std::size_t kPlane = kColumnSines * kColumnRadii;
    tables.columns.resize(3 * kPlane);
    static const GaussRule rule(32);
    const auto add = [&](double radius, double sine, double length, double* sums) {
        for (std::size_t k = 0; k < rule.nodes.size(); ++k) {
            const double x = rule.nodes[k], at = length * x * x, weight = 2 * length * x * rule.weights[k];
            const double altitude =
                std::max(0.0, std::sqrt(radius * radius + at * (at + 2 * radius * sine)) - air.ground);
            sums[0] += weight * std::exp(-altitude * air.per_rayleigh_height);
            sums[1] += weight * std::exp(-altitude * air.per_mie_height);
            sums[2] +=
                weight * std::max(0.0, 1 - std::abs(altitude - air.ozone_centre) * air.per_ozone_half_width);
        }
    };
    tbb::parallel_for(std::size_t{0}, kColumnRadii, [&](std::size_t row) {
        const double radius = column_radius(air, double(row)), nearest = air.top - radius;
        const double horizontal = air.horizontal(radius), farthest = horizontal + air.most_horizontal();
        for (std::size_t i = 0; i < kColumnSines; ++i) {
            const double length =
                std::max(1e-6, mix(nearest, farthest, double(i) / double(kColumnSines - 1)));
            const double inside = (air.top - radius) * (air.top + radius);
            const double sine = std::clamp((inside - length * length) / (2 * radius * length), -1.0, 1.0);
            double sums[3] = {};
            if (sine < 0) {
                const double tangent = -radius * sine, lowest = radius * std::sqrt(1 - sine * sine);
                add(lowest, 0, tangent, sums);
                add(lowest, 0, length - tangent, sums);
            } else {
                add(radius, sine, length, sums);
            }
            for (std::size_t k = 0; k < 3; ++k)
                tables.columns[k * kPlane + row * kColumnSines + i] = float(sums[k]);
        }
    });
}

// Returns the optical depth of a ray that misses the ground; of the lowest such ray for one that meets it.
Rgb Atmosphere::Tables::optical_depth(double radius, double sine) const {
    const double nearest = air.top - radius, farthest = air.horizontal(radius) + air.most_horizontal();
    const double part = (air.to_top(radius, sine) - nearest) / std::max(farthest - nearest, 1e-9);
    const double x = std::clamp(part, 0.0, 1.0 - 1e-9) * double(kColumnSines - 1),
                 y = std::clamp(column_coordinate(air, radius), 0.0, double(kColumnRadii - 1) - 1e-9);
    const auto i = std::size_t(x), j = std::size_t(y);
    double columns[3];
    for (std::size_t k = 0; k < 3; ++k) {
        const float* a = &tables.columns[(k * kColumnRadii + j) * kColumnSines + i];
        const float* b = a + kColumnSines;
        columns[k] = mix(mix(double(a[0]), double(a[1]), x - double(i)),
                         mix(double(b[0]), double(b[1]), x - double(i)), y - double(j));
    }
    Rgb depth{};
    for (std::size_t c = 0; c < 3; ++c)
        depth[c] = air.rayleigh[c] * columns[0] + air.mie_extinction * columns[1] + air.ozone[c] * columns[2];
    return depth;
}

Rgb Atmosphere::Tables::sunlight(double radius, double sine) const {
    const double visible = visible_sun(sine, air.horizon_sine(radius));
    if (visible <= 0) return {};
    const Rgb depth = optical_depth(radius, sine);
    Rgb light{};
    for (std::size_t c = 0; c < 3; ++c) light[c] = visible * std::exp(-depth[c]);
    return light;
}

Rgb Atmosphere::Tables::from_sun_on_ground(double sine) const {
    const double x = sun_coordinate(sine) * double(kGroundSuns - 1) / double(kSunSines - 1);
    const auto i = std::min(std::size_t(x), kGroundSuns - 2);
    Rgb light{};
    for (std::size_t c = 0; c < 3; ++c) {
        const float* a = &ground_sun[c * kGroundSuns + i];
        light[c] = mix(double(a[0]), double(a[1]), x - double(i));
    }
    return light;
}

// Returns the radiance that the ground at the end of a path contributes at its start.
Rgb Atmosphere::Tables::ground_radiance(const AirPath& path, double sun, double cos_to_sun,
                                        bool with_sky) const {
    Rgb radiance{};
    if (!path.meets_ground) return radiance;
    const double sine =
        std::clamp((path.start_radius * sun + path.length * cos_to_sun) / air.ground, -1.0, 1.0);
    const Rgb direct = from_sun_on_ground(sine);
    const Rgb sky = with_sky ? irradiance(0, 0, sine) : Rgb{};
    for (std::size_t c = 0; c < 3; ++c)
        radiance[c] = path.transmittance[c] * model.ground_albedo[c] / kPi * (direct[c] + sky[c]);
    return radiance;
}

// Psi = second order / (1 - fraction that is scattered again), Hillaire's equations 5 to 9: the second order
// is the mean over all directions of light scattered once (without phase functions) or by the ground.
void Atmosphere::Tables::make_psi_row(std::size_t row, std::vector<float>& psi) const {
    constexpr std::size_t kAzimuths = 8;
    const double radius = std::min(psi_radius(air, double(row)), air.top - 1e-3);
    const Elevations elevations(air.horizon_sine(radius), 12);
    std::vector<double> second(3 * kSunSines);
    double again[3] = {};
    const auto add = [&](const Elevations::One& ray) {
        const AirPath path = air_path(air, radius, ray.sine, kPsiParts);
        const Suns<kAzimuths> suns(ray.sine);
        ScatteredPlanes light(suns.sine.size());
        scatter_along(air, {tables.columns, {}}, path, suns.sine, suns.cos_to_ray, light);
        for (std::size_t i = 0; i < suns.sine.size(); ++i) {
            const Rgb ground = ground_radiance(path, double(suns.sine[i]), double(suns.cos_to_ray[i]), false);
            for (std::size_t c = 0; c < 3; ++c) {
                const double once = double(light.rayleigh[c][i] + light.mie[c][i]) / (4 * kPi) + ground[c];
                second[c * kSunSines + i % kSunSines] += 0.5 * ray.weight / double(kAzimuths) * once;
            }
        }
        for (std::size_t c = 0; c < 3; ++c) {
            double scattered = 0;
            for (const AirPart& part : path.parts) scattered += double(part.rayleigh[c] + part.mie[c]);
            again[c] += 0.5 * ray.weight * scattered;
        }
    };
    for (const Elevations::One& ray : elevations.above) add(ray);
    for (const Elevations::One& ray : elevations.below) add(ray);
    for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t s = 0; s < kSunSines; ++s)
            psi[(c * kPsiRadii + row) * kSunSines + s] =
                std::log(std::max(float(second[c * kSunSines + s] / (1 - again[c])), kLeast));
}

void Atmosphere::Tables::make_psi() {
    std::vector<float> psi(3 * kPsiRadii * kSunSines);
    tbb::parallel_for(std::size_t{0}, kPsiRadii, [&](std::size_t row) { make_psi_row(row, psi); });
    tables.psi = std::move(psi);
}

Rgb Atmosphere::Tables::irradiance(std::size_t kind, double altitude_km, double sine) const {
    const double row =
        std::sqrt(std::clamp(altitude_km / kIrradianceTop_km, 0.0, 1.0)) * double(kIrradianceRows - 1);
    Rgb light{};
    for (std::size_t c = 0; c < 3; ++c)
        light[c] = between_logs(&irradiances[kind][c * kIrradianceRows * kSunSines], sun_coordinate(sine),
                                row, kIrradianceRows);
    return light;
}

void Atmosphere::Tables::make_irradiance_row(std::size_t row, std::size_t first_kind, std::size_t end_kind) {
    constexpr std::size_t kAzimuths = 8;
    const double y = double(row) / double(kIrradianceRows - 1);
    const double radius = air.ground + kIrradianceTop_km * y * y;
    // The peak of the phase function would fall between these few directions: the similar, flatter one of
    // Joseph, Wiscombe and Weinman 1976 (delta-Eddington) has the same flux.
    const auto g = float(model.mie_g / (1 + model.mie_g));
    std::array<std::vector<double>, 3> sums;
    for (std::vector<double>& sum : sums) sum.assign(3 * kSunSines, 0.0);
    const auto add = [&](const Elevations::One& ray) {
        const AirPath path = air_path(air, radius, ray.sine, kPsiParts);
        const Suns<kAzimuths> suns(ray.sine);
        ScatteredPlanes light(suns.sine.size());
        scatter_along(air, tables, path, suns.sine, suns.cos_to_ray, light);
        const double solid_angle = 2 * kPi * ray.weight / double(kAzimuths);
        const double fraction[3] = {std::max(ray.sine, 0.0), std::max(-ray.sine, 0.0),
                                    std::sqrt(1 - ray.sine * ray.sine) / kPi};
        for (std::size_t i = 0; i < suns.sine.size(); ++i) {
            const Rgb ground = ground_radiance(path, double(suns.sine[i]), double(suns.cos_to_ray[i]),
                                               path.meets_ground && first_kind > 0);
            const float molecules = shader::molecule_phase(suns.cos_to_ray[i]),
                        particles = shader::particle_phase(suns.cos_to_ray[i], g);
            for (std::size_t c = 0; c < 3; ++c) {
                const double radiance = double(molecules * light.rayleigh[c][i] +
                                               particles * light.mie[c][i] + light.many[c][i]) +
                                        ground[c];
                for (std::size_t kind = first_kind; kind < end_kind; ++kind)
                    sums[kind][c * kSunSines + i % kSunSines] += solid_angle * fraction[kind] * radiance;
            }
        }
    };
    const Elevations elevations(air.horizon_sine(radius), 10);
    for (const Elevations::One& ray : elevations.above) add(ray);
    if (end_kind > 1)
        for (const Elevations::One& ray : elevations.below) add(ray);
    for (std::size_t kind = first_kind; kind < end_kind; ++kind)
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t s = 0; s < kSunSines; ++s)
                irradiances[kind][(c * kIrradianceRows + row) * kSunSines + s] =
                    std::log(std::max(float(sums[kind][c * kSunSines + s]), kLeast));
}

// Irradiance from above comes first, because the ground reflects it.
void Atmosphere::Tables::make_irradiances() {
    for (std::vector<float>& plane : irradiances) plane.resize(3 * kIrradianceRows * kSunSines);
    tbb::parallel_for(std::size_t{0}, kIrradianceRows,
                      [&](std::size_t row) { make_irradiance_row(row, 0, 1); });
    tbb::parallel_for(std::size_t{0}, kIrradianceRows,
                      [&](std::size_t row) { make_irradiance_row(row, 1, 3); });
}

AtmosphereModel atmosphere_model(const AtmosphereOptions& options, const Rgb& ground_albedo) {
    AtmosphereModel model;
    model.mie_scattering_per_m *= options.haze;
    model.mie_extinction_per_m *= options.haze;
    model.mie_g = options.haze_g;
    for (double& ozone : model.ozone_per_m) ozone *= options.ozone;
    model.ground_albedo = ground_albedo;
    return model;
}

Atmosphere::Atmosphere(const AtmosphereModel& model) : tables_(std::make_unique<const Tables>(model)) {}
Atmosphere::~Atmosphere() = default;
Atmosphere::Atmosphere(Atmosphere&&) noexcept = default;
Atmosphere& Atmosphere::operator=(Atmosphere&&) noexcept = default;

const AtmosphereModel& Atmosphere::model() const { return tables_->model; }

Rgb Atmosphere::transmittance(double altitude_m, double sine) const {
    const double radius = radius_at(tables_->air, altitude_m);
    if (sine < tables_->air.horizon_sine(radius)) return {};
    const Rgb depth = tables_->optical_depth(radius, sine);
    return {std::exp(-depth[0]), std::exp(-depth[1]), std::exp(-depth[2])};
}

Rgb Atmosphere::sunlight(double altitude_m, double sun_elevation_deg) const {
    return tables_->sunlight(radius_at(tables_->air, altitude_m), sine_of(sun_elevation_deg));
}

Rgb Atmosphere::multiple_scattering(double altitude_m, double sun_sine_) const {
    const SphericalAir& air = tables_->air;
    Rgb light{};
    for (std::size_t c = 0; c < 3; ++c)
        light[c] = between_logs(&tables_->tables.psi[c * kPsiRadii * kSunSines], sun_coordinate(sun_sine_),
                                psi_coordinate(air, radius_at(air, altitude_m)), kPsiRadii);
    return light;
}

SkyIrradiance Atmosphere::irradiance(double altitude_m, double sun_elevation_deg) const {
    const double sine = sine_of(sun_elevation_deg), altitude_km = altitude_m / 1000;
    return {tables_->irradiance(0, altitude_km, sine), tables_->irradiance(1, altitude_km, sine),
            tables_->irradiance(2, altitude_km, sine)};
}

SkyTable Atmosphere::sky(double eye_altitude_m, double sun_elevation_deg) const {
    const SphericalAir& air = tables_->air;
    const double radius = radius_at(air, eye_altitude_m), sun = sine_of(sun_elevation_deg),
                 sun_cosine = std::sqrt(1 - sun * sun);
    const double horizon = air.horizon_sine(radius) + 1e-7;  // misses the ground
    constexpr std::size_t kColumns = shader::kSkyColumns, kRows = shader::kSkyRows;
    static_assert(kColumns % kAirLanes == 0);
    SkyTable sky;
    sky.scattered.resize(4 * kColumns * kRows);
    sky.haze.resize(4 * kColumns * kRows);
    // In twilight only the far end of a ray is in the sun.
    const bool twilight = sun_elevation_deg < -3;
    const std::vector<float> suns(kColumns, float(sun));
    tbb::parallel_for(std::size_t{0}, kRows, [&](std::size_t row) {
        const double v = double(row) / double(kRows - 1), q = v * v;
        const double sine = horizon + (1 - horizon) * q * (2 - q);
        const AirPath path = twilight ? air_path(air, radius, sine, kTwilightParts, 0.5)
                                      : air_path(air, radius, sine, kDayParts);
        std::vector<float> cos_to_sun(kColumns);
        for (std::size_t i = 0; i < kColumns; ++i) {
            const double u = double(i) / double(kColumns - 1), cos_azimuth = 1 - 2 * u * u;
            cos_to_sun[i] =
                float(sine * sun + std::sqrt(std::max(0.0, 1 - sine * sine)) * sun_cosine * cos_azimuth);
        }
        ScatteredPlanes light(kColumns);
        scatter_along(air, tables_->tables, path, suns, cos_to_sun, light);
        for (std::size_t i = 0; i < kColumns; ++i) {
            const float phase = shader::molecule_phase(cos_to_sun[i]);
            const std::size_t at = 4 * (row * kColumns + i);
            for (std::size_t c = 0; c < 3; ++c) {
                sky.scattered[at + c] = phase * light.rayleigh[c][i] + light.many[c][i];
                sky.haze[at + c] = light.mie[c][i];
            }
        }
    });
    return sky;
}

}  // namespace nephos
