// SPDX-License-Identifier: Apache-2.0
#pragma once

// The atmosphere's naive twin: integrals along rays in double precision with fine steps and without tables,
// from the definitions in atmosphere.h. Slow; shares no code with what it checks. Lengths are metres.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "render/atmosphere/atmosphere.h"

namespace nephos::reference {

struct Densities {
    double rayleigh, mie, ozone;
};

inline Densities densities(const AtmosphereModel& m, double radius) {
    const double h = std::max(0.0, radius - m.ground_radius_m);
    return {std::exp(-h / m.rayleigh_height_m), std::exp(-h / m.mie_height_m),
            std::max(0.0, 1 - std::abs(h - m.ozone_centre_m) / m.ozone_half_width_m)};
}

inline double radius_along(double radius, double sine, double t) {
    return std::sqrt(radius * radius + t * t + 2 * radius * sine * t);
}

// Length of the ray to the ground or, without it, to the top.
inline double ray_length(const AtmosphereModel& m, double radius, double sine, bool& ground) {
    const double b = radius * sine, to = b * b - radius * radius + m.ground_radius_m * m.ground_radius_m;
    ground = sine < 0 && to >= 0;
    if (ground) return -b - std::sqrt(to);
    return -b + std::sqrt(std::max(0.0, b * b - radius * radius + m.top_radius_m * m.top_radius_m));
}

// Places along a ray with weights: midpoints that crowd where the ray is lowest.
struct Place {
    double t, step;
};
inline std::vector<Place> places(double length, double lowest, int steps) {
    std::vector<Place> all;
    const auto add = [&](double from, double to) {  // crowded at `from`
        for (int i = 0; i < steps; ++i) {
            const double a = double(i) / steps, b = double(i + 1) / steps;
            const double begin = from + (to - from) * a * a, end = from + (to - from) * b * b;
            all.push_back({0.5 * (begin + end), std::abs(end - begin)});
        }
    };
    const double middle = std::clamp(lowest, 0.0, length);
    if (middle > 0) add(middle, 0);
    if (middle < length) add(middle, length);
    std::ranges::sort(all, {}, &Place::t);
    return all;
}

inline Rgb extinction(const AtmosphereModel& m, const Densities& d) {
    Rgb e{};
    for (std::size_t c = 0; c < 3; ++c)
        e[c] = m.rayleigh_per_m[c] * d.rayleigh + m.mie_extinction_per_m * d.mie + m.ozone_per_m[c] * d.ozone;
    return e;
}

// Light of the sun's disc at a point: what arrives through the air; nothing from below the horizon.
inline Rgb sunlight(const AtmosphereModel& m, double radius, double sine, int steps) {
    const double horizon = -std::sqrt(std::max(0.0, 1 - std::pow(m.ground_radius_m / radius, 2)));
    const double disc = kSunRadius_deg * std::numbers::pi / 180;
    const double x = std::clamp((sine - horizon + disc) / (2 * disc), 0.0, 1.0);
    if (x <= 0) return {};
    const double seen = std::max(sine, horizon);
    bool ground = false;
    double length = ray_length(m, radius, seen, ground);
    if (ground) length = -2 * radius * seen + ray_length(m, radius, -seen, ground);  // grazes it
    Densities sum{};
    for (const Place& p : places(length, -radius * seen, steps)) {
        const Densities d = densities(m, radius_along(radius, seen, p.t));
        sum.rayleigh += d.rayleigh * p.step;
        sum.mie += d.mie * p.step;
        sum.ozone += d.ozone * p.step;
    }
    const Rgb depth = extinction(m, sum);
    Rgb light{};
    for (std::size_t c = 0; c < 3; ++c) light[c] = x * x * (3 - 2 * x) * std::exp(-depth[c]);
    return light;
}

struct Steps {
    int view, sun;
};

// Walks along a ray: calls visit(place, radius, local sine of the sun, scattered share of rayleigh and mie
// that arrives at the start) and returns the transmittance of the whole ray.
template <class Visit>
Rgb walk(const AtmosphereModel& m, double radius, double sine, double sun, double cos_to_sun, int steps,
         bool& ground, double& length, const Visit& visit) {
    length = ray_length(m, radius, sine, ground);
    Rgb depth{};
    for (const Place& p : places(length, -radius * sine, steps)) {
        const double r = radius_along(radius, sine, p.t);
        const Densities d = densities(m, r);
        const Rgb e = extinction(m, d);
        Rgb rayleigh{}, mie{};
        for (std::size_t c = 0; c < 3; ++c) {
            const double arrives = std::exp(-depth[c] - 0.5 * e[c] * p.step) * p.step;
            rayleigh[c] = arrives * m.rayleigh_per_m[c] * d.rayleigh;
            mie[c] = arrives * m.mie_scattering_per_m * d.mie;
            depth[c] += e[c] * p.step;
        }
        visit(r, (radius * sun + p.t * cos_to_sun) / r, rayleigh, mie);
    }
    return {std::exp(-depth[0]), std::exp(-depth[1]), std::exp(-depth[2])};
}

inline double cosine_between(double a_sine, double b_sine, double azimuth) {
    return a_sine * b_sine + std::sqrt(std::max(0.0, 1 - a_sine * a_sine)) *
                                 std::sqrt(std::max(0.0, 1 - b_sine * b_sine)) * std::cos(azimuth);
}

// Psi, the mean radiance of light scattered twice and more: the definition in atmosphere.cpp.
inline Rgb multiple_scattering(const AtmosphereModel& m, double radius, double sun, int directions,
                               Steps steps) {
    constexpr double kPi = std::numbers::pi;
    const double horizon = -std::sqrt(std::max(0.0, 1 - std::pow(m.ground_radius_m / radius, 2)));
    Rgb second{}, again{};
    const auto add = [&](double sine, double weight, double azimuth) {  // weight: part of the sphere
        bool ground = false;
        double length = 0;
        const double cos_to_sun = cosine_between(sine, sun, azimuth);
        const Rgb left = walk(m, radius, sine, sun, cos_to_sun, steps.view, ground, length,
                              [&](double r, double local, const Rgb& rayleigh, const Rgb& mie) {
                                  const Rgb light = sunlight(m, r, local, steps.sun);
                                  for (std::size_t c = 0; c < 3; ++c) {
                                      second[c] += weight * (rayleigh[c] + mie[c]) * light[c] / (4 * kPi);
                                      again[c] += weight * (rayleigh[c] + mie[c]);
                                  }
                              });
        if (!ground) return;
        const double local = (radius * sun + length * cos_to_sun) / m.ground_radius_m;
        const Rgb light = sunlight(m, m.ground_radius_m, local, steps.sun);
        for (std::size_t c = 0; c < 3; ++c) {
            second[c] += weight * left[c] * m.ground_albedo[c] / kPi * light[c] * std::max(local, 0.0);
        }
    };
    for (int i = 0; i < directions; ++i) {
        const double a = double(i) / directions, b = double(i + 1) / directions;
        for (int k = 0; k < directions / 2; ++k) {
            const double azimuth = kPi * (k + 0.5) / (directions / 2.0);
            const double up = (1 - horizon) * (b * b - a * a), down = (1 + horizon) * (b * b - a * a);
            const double middle = 0.5 * (a * a + b * b);
            add(horizon + (1 - horizon) * middle, up / directions, azimuth);
            add(horizon - (1 + horizon) * middle, down / directions, azimuth);
        }
    }
    Rgb psi{};
    for (std::size_t c = 0; c < 3; ++c) psi[c] = second[c] / (1 - again[c]);
    return psi;
}

inline double rayleigh_phase(double c) { return 3 / (16 * std::numbers::pi) * (1 + c * c); }
inline double mie_phase(double c, double g) {
    return 3 / (8 * std::numbers::pi) * (1 - g * g) * (1 + c * c) /
           ((2 + g * g) * std::pow(1 + g * g - 2 * g * c, 1.5));
}

// Light of the air and its transmittance up to a distance, by `steps` equal parts.
struct AirUpTo {
    Rgb light{}, transmittance{};
};
template <class Psi>
AirUpTo air_up_to(const AtmosphereModel& m, double radius, double sine, double azimuth, double sun,
                  double distance, Steps steps, const Psi& psi) {
    const double cos_to_sun = cosine_between(sine, sun, azimuth), step = distance / steps.view;
    AirUpTo air;
    Rgb depth{};
    for (int i = 0; i < steps.view; ++i) {
        const double t = (i + 0.5) * step, r = radius_along(radius, sine, t);
        const double local = (radius * sun + t * cos_to_sun) / r;
        const Densities d = densities(m, r);
        const Rgb e = extinction(m, d), light = sunlight(m, r, local, steps.sun), many = psi(r, local);
        for (std::size_t c = 0; c < 3; ++c) {
            const double arrives = std::exp(-depth[c] - 0.5 * e[c] * step) * step;
            const double rayleigh = m.rayleigh_per_m[c] * d.rayleigh, mie = m.mie_scattering_per_m * d.mie;
            air.light[c] += arrives * (light[c] * (rayleigh * rayleigh_phase(cos_to_sun) +
                                                   mie * mie_phase(cos_to_sun, m.mie_g)) +
                                       many[c] * (rayleigh + mie));
            depth[c] += e[c] * step;
        }
    }
    for (std::size_t c = 0; c < 3; ++c) air.transmittance[c] = std::exp(-depth[c]);
    return air;
}

// Radiance along a ray; `psi(radius, sine of the sun)` is the multiple scattering there.
template <class Psi>
Rgb sky_radiance(const AtmosphereModel& m, double radius, double sine, double azimuth, double sun,
                 Steps steps, const Psi& psi) {
    const double cos_to_sun = cosine_between(sine, sun, azimuth);
    bool ground = false;
    double length = 0;
    Rgb radiance{};
    walk(m, radius, sine, sun, cos_to_sun, steps.view, ground, length,
         [&](double r, double local, const Rgb& rayleigh, const Rgb& mie) {
             const Rgb light = sunlight(m, r, local, steps.sun), many = psi(r, local);
             for (std::size_t c = 0; c < 3; ++c)
                 radiance[c] += light[c] * (rayleigh[c] * rayleigh_phase(cos_to_sun) +
                                            mie[c] * mie_phase(cos_to_sun, m.mie_g)) +
                                many[c] * (rayleigh[c] + mie[c]);
         });
    return radiance;
}

}  // namespace nephos::reference
