// SPDX-License-Identifier: Apache-2.0
#include "render/atmosphere/air_path.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/atmosphere/air_path.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "core/math.h"
#include "core/vectors-inl.h"
#include "render/shared/shared.h"

#ifndef NEPHOS_AIR_PATH_TYPES_
#define NEPHOS_AIR_PATH_TYPES_
namespace nephos {

// The input of the kernel for one part of a path: sunlight by the sun's sine, at the part's radius.
struct PartRows {
    float optical_depth[3][kColumnSines];
    float log_psi[3][kSunSines];
    float start_radius, distance, radius, per_radius;
    float horizon_sine, per_twice_disc;
    float nearest, per_reach;  // of the columns' coordinate
    float inside;              // top^2 - radius^2, km^2
    float rayleigh[3], mie[3];
    bool psi;
};

struct SunBlock {
    const float *sun_sine, *cos_to_sun;
    float *rayleigh[3], *mie[3], *many[3];
    std::size_t count;
};

// Sines map to s (1 + c) / (|s| + c): dense around the horizon.
inline constexpr double kSunBend = 0.3, kLeastSunSine = -0.5;
inline constexpr double kLeastBent = kLeastSunSine * (1 + kSunBend) / (-kLeastSunSine + kSunBend);

}  // namespace nephos
#endif

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using AirTag = hn::CappedTag<float, kAirLanes>;
using AirFloats = hn::Vec<AirTag>;

HWY_INLINE AirFloats air_set(float value) { return hn::Set(AirTag(), value); }

// A row of a table at a coordinate, linearly.
struct RowPlace {
    hn::Vec<hn::RebindToSigned<AirTag>> index;
    AirFloats fraction;
};
HWY_INLINE RowPlace place_in_row(AirFloats coordinate, std::size_t count) {
    const AirTag d;
    const AirFloats inside =
        hn::Min(hn::Max(coordinate, hn::Zero(d)), air_set(float(count - 1) - 1.0f / 256.0f));
    const AirFloats low = hn::Floor(inside);
    return {hn::ConvertTo(hn::RebindToSigned<AirTag>(), low), hn::Sub(inside, low)};
}
HWY_INLINE AirFloats look_up(const float* row, const RowPlace& place) {
    const AirTag d;
    const AirFloats a = hn::GatherIndex(d, row, place.index), b = hn::GatherIndex(d, row + 1, place.index);
    return hn::MulAdd(place.fraction, hn::Sub(b, a), a);
}

// Adds what one part scatters.
void add_part(const PartRows& part, const SunBlock& suns) {
    const AirTag d;
    const AirFloats one = air_set(1.0f), zero = hn::Zero(d);
    for (std::size_t i = 0; i < suns.count; i += hn::Lanes(d)) {
        const AirFloats far =
            hn::MulAdd(air_set(part.distance), hn::LoadU(d, suns.cos_to_sun + i),
                       hn::Mul(air_set(part.start_radius), hn::LoadU(d, suns.sun_sine + i)));
        const AirFloats sine = hn::Max(hn::Min(hn::Mul(far, air_set(part.per_radius)), one), hn::Neg(one));
        const AirFloats above = hn::MulAdd(hn::Sub(sine, air_set(part.horizon_sine)),
                                           air_set(part.per_twice_disc), air_set(0.5f));
        const AirFloats fraction = hn::Max(hn::Min(above, one), zero);
        if (!hn::AllFalse(d, hn::Gt(fraction, zero))) {
            const AirFloats visible = smooth_blend(fraction);
            const AirFloats along = hn::Mul(sine, air_set(part.radius));
            const AirFloats to_top =
                hn::Sub(hn::Sqrt(hn::Max(hn::MulAdd(along, along, air_set(part.inside)), zero)), along);
            const RowPlace place = place_in_row(
                hn::Mul(hn::Sub(to_top, air_set(part.nearest)), air_set(part.per_reach)), kColumnSines);
            for (std::size_t c = 0; c < 3; ++c) {
                const AirFloats light =
                    hn::Mul(visible, hn::Exp(d, hn::Neg(look_up(part.optical_depth[c], place))));
                float *rayleigh = suns.rayleigh[c] + i, *mie = suns.mie[c] + i;
                hn::StoreU(hn::MulAdd(light, air_set(part.rayleigh[c]), hn::LoadU(d, rayleigh)), d, rayleigh);
                hn::StoreU(hn::MulAdd(light, air_set(part.mie[c]), hn::LoadU(d, mie)), d, mie);
            }
        }
        if (!part.psi) continue;
        const AirFloats bent = hn::Div(hn::Mul(sine, air_set(1.0f + float(kSunBend))),
                                       hn::Add(hn::Abs(sine), air_set(float(kSunBend))));
        const RowPlace place =
            place_in_row(hn::Mul(hn::Sub(bent, air_set(float(kLeastBent))),
                                 air_set(float(kSunSines - 1) / (1.0f - float(kLeastBent)))),
                         kSunSines);
        for (std::size_t c = 0; c < 3; ++c) {
            const AirFloats light = hn::Exp(d, look_up(part.log_psi[c], place));
            float* many = suns.many[c] + i;
            hn::StoreU(hn::MulAdd(light, air_set(part.rayleigh[c] + part.mie[c]), hn::LoadU(d, many)), d,
                       many);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(add_part);

namespace {

constexpr double kKilometre = 1000;

// Interpolates a row between two rows of a plane.
void mix_rows(const float* plane, std::size_t width, double coordinate, std::size_t rows, float* out) {
    const auto low = std::min(std::size_t(std::max(coordinate, 0.0)), rows - 2);
    const auto fraction = float(std::clamp(coordinate - double(low), 0.0, 1.0));
    const float *a = plane + low * width, *b = a + width;
    for (std::size_t i = 0; i < width; ++i) out[i] = a[i] + fraction * (b[i] - a[i]);
}

void fill_columns(const SphericalAir& air, const AirTables& tables, double radius, PartRows& rows) {
    float columns[3][kColumnSines];
    const double coordinate = column_coordinate(air, radius);
    for (std::size_t k = 0; k < 3; ++k)
        mix_rows(&tables.columns[k * kColumnSines * kColumnRadii], kColumnSines, coordinate, kColumnRadii,
                 columns[k]);
    for (std::size_t c = 0; c < 3; ++c) {
        const float rayleigh = float(air.rayleigh[c]), mie = float(air.mie_extinction),
                    ozone = float(air.ozone[c]);
        for (std::size_t i = 0; i < kColumnSines; ++i)
            rows.optical_depth[c][i] = rayleigh * columns[0][i] + mie * columns[1][i] + ozone * columns[2][i];
    }
}

void fill_rows(const SphericalAir& air, const AirTables& tables, const AirPath& path, const AirPart& part,
               PartRows& rows) {
    const double radius = double(part.radius);
    fill_columns(air, tables, radius, rows);
    rows.psi = !tables.psi.empty();
    if (rows.psi) {
        const double coordinate = psi_coordinate(air, radius);
        for (std::size_t c = 0; c < 3; ++c)
            mix_rows(&tables.psi[c * kSunSines * kPsiRadii], kSunSines, coordinate, kPsiRadii,
                     rows.log_psi[c]);
    }
    rows.start_radius = float(path.start_radius);
    rows.distance = part.distance;
    rows.radius = part.radius;
    rows.per_radius = float(1 / radius);
    rows.horizon_sine = float(air.horizon_sine(radius));
    rows.per_twice_disc = 0.5f / shader::kSunRadius;
    rows.nearest = float(air.top - radius);
    const double farthest = air.horizontal(radius) + air.most_horizontal();
    rows.per_reach = float(double(kColumnSines - 1) / (farthest - (air.top - radius)));
    rows.inside = float(air.top * air.top - radius * radius);
    std::copy_n(part.rayleigh, 3, rows.rayleigh);
    std::copy_n(part.mie, 3, rows.mie);
}

// Returns the beginnings of the parts of a ray, 0..1 of its length, closer in denser air. `tangent`: distance
// of the ray's lowest point.
std::vector<double> cuts(double length, double tangent, std::size_t parts, double even) {
    std::vector<double> at(parts + 1);
    const auto away = [even](double x) { return x * (even + (1 - even) * x); };
    if (tangent <= 0 || tangent >= length) {
        for (std::size_t i = 0; i <= parts; ++i) {
            const double x = double(i) / double(parts);
            at[i] = length * (tangent <= 0 ? away(x) : 1 - away(1 - x));
        }
        return at;
    }
    const std::size_t before = parts / 2, after = parts - before;
    for (std::size_t i = 0; i <= before; ++i) at[i] = tangent * (1 - away(1 - double(i) / double(before)));
    for (std::size_t i = 1; i <= after; ++i)
        at[before + i] = tangent + (length - tangent) * away(double(i) / double(after));
    return at;
}

struct Densities {
    double rayleigh, mie, ozone;
};

Densities densities(const SphericalAir& air, double radius) {
    const double altitude = std::max(radius - air.ground, 0.0);
    return {std::exp(-altitude * air.per_rayleigh_height), std::exp(-altitude * air.per_mie_height),
            std::max(0.0, 1 - std::abs(altitude - air.ozone_centre) * air.per_ozone_half_width)};
}

}  // namespace

AirPart air_part(const SphericalAir& air, double radius, double sine, double begin, double end,
                 double (&transmittance)[3]) {
    constexpr int kFine = 4;
    const double step = (end - begin) / kFine;
    double rayleigh[3] = {}, mie[3] = {}, moment = 0, sum = 0;
    for (int k = 0; k < kFine; ++k) {
        const double at = begin + (k + 0.5) * step;
        const Densities here = densities(air, std::sqrt(radius * radius + at * (at + 2 * radius * sine)));
        for (std::size_t c = 0; c < 3; ++c) {
            const double extinction =
                air.rayleigh[c] * here.rayleigh + air.mie_extinction * here.mie + air.ozone[c] * here.ozone;
            const double left = std::exp(-extinction * step);
            const double seen =
                transmittance[c] * (extinction * step > 1e-6 ? (1 - left) / extinction : step);
            rayleigh[c] += seen * air.rayleigh[c] * here.rayleigh;
            mie[c] += seen * air.mie_scattering * here.mie;
            const double part = seen * (air.rayleigh[c] * here.rayleigh + air.mie_scattering * here.mie);
            moment += part * at;
            sum += part;
            transmittance[c] *= left;
        }
    }
    AirPart result{};
    const double centre = sum > 0 ? moment / sum : 0.5 * (begin + end);
    result.distance = float(centre);
    const double there = std::sqrt(radius * radius + centre * (centre + 2 * radius * sine));
    result.radius = float(std::clamp(there, air.ground, air.top));
    for (std::size_t c = 0; c < 3; ++c) {
        result.rayleigh[c] = float(rayleigh[c]);
        result.mie[c] = float(mie[c]);
    }
    return result;
}

SphericalAir::SphericalAir(const AtmosphereModel& m)
    : ground(m.ground_radius_m / kKilometre),
      top(m.top_radius_m / kKilometre),
      mie_scattering(m.mie_scattering_per_m * kKilometre),
      mie_extinction(m.mie_extinction_per_m * kKilometre),
      per_rayleigh_height(kKilometre / m.rayleigh_height_m),
      per_mie_height(kKilometre / m.mie_height_m),
      ozone_centre(m.ozone_centre_m / kKilometre),
      per_ozone_half_width(kKilometre / m.ozone_half_width_m) {
    for (std::size_t c = 0; c < 3; ++c) {
        rayleigh[c] = m.rayleigh_per_m[c] * kKilometre;
        ozone[c] = m.ozone_per_m[c] * kKilometre;
    }
}

double SphericalAir::horizontal(double radius) const {
    return std::sqrt(std::max(0.0, (radius - ground) * (radius + ground)));
}
double SphericalAir::to_top(double radius, double sine) const {
    const double along = radius * sine;
    return std::sqrt(std::max(0.0, along * along + (top - radius) * (top + radius))) - along;
}
double SphericalAir::to_ground(double radius, double sine) const {
    const double along = radius * sine, inside = along * along - (radius - ground) * (radius + ground);
    return sine < 0 && inside >= 0 ? -along - std::sqrt(inside) : -1;
}
double SphericalAir::horizon_sine(double radius) const { return -horizontal(radius) / radius; }

double sun_coordinate(double sine) {
    const double s = std::clamp(sine, kLeastSunSine, 1.0);
    const double bent = s * (1 + kSunBend) / (std::abs(s) + kSunBend);
    return (bent - kLeastBent) / (1 - kLeastBent) * double(kSunSines - 1);
}
double sun_sine(double coordinate) {
    const double bent = kLeastBent + (1 - kLeastBent) * coordinate / double(kSunSines - 1);
    return bent * kSunBend / (1 + kSunBend - std::abs(bent));
}
double psi_coordinate(const SphericalAir& air, double radius) {
    return double(kPsiRadii - 1) *
           std::sqrt(std::clamp((radius - air.ground) / (air.top - air.ground), 0.0, 1.0));
}
double psi_radius(const SphericalAir& air, double coordinate) {
    const double x = coordinate / double(kPsiRadii - 1);
    return air.ground + (air.top - air.ground) * x * x;
}
double column_coordinate(const SphericalAir& air, double radius) {
    return double(kColumnRadii - 1) * air.horizontal(radius) / air.most_horizontal();
}
double column_radius(const SphericalAir& air, double coordinate) {
    return std::hypot(air.ground, air.most_horizontal() * coordinate / double(kColumnRadii - 1));
}

AirPath air_path(const SphericalAir& air, double radius, double sine, std::size_t parts, double even) {
    AirPath path;
    path.start_radius = radius;
    const double ground = air.to_ground(radius, sine);
    path.meets_ground = ground >= 0;
    path.length = path.meets_ground ? ground : air.to_top(radius, sine);
    const std::vector<double> at = cuts(path.length, -radius * sine, parts, even);
    double transmittance[3] = {1, 1, 1};
    for (std::size_t i = 0; i < parts; ++i)
        path.parts.push_back(air_part(air, radius, sine, at[i], at[i + 1], transmittance));
    std::copy_n(transmittance, 3, path.transmittance);
    return path;
}

ScatteredPlanes::ScatteredPlanes(std::size_t suns) {
    for (std::size_t c = 0; c < 3; ++c)
        for (std::vector<float>* plane : {&rayleigh[c], &mie[c], &many[c]}) plane->assign(suns, 0.0f);
}

void scatter_along(const SphericalAir& air, const AirTables& tables, const AirPath& path,
                   std::span<const float> sun_sine, std::span<const float> cos_to_sun, ScatteredPlanes& out) {
    assert(sun_sine.size() % kAirLanes == 0 && sun_sine.size() == cos_to_sun.size());
    SunBlock suns{sun_sine.data(), cos_to_sun.data(), {}, {}, {}, sun_sine.size()};
    for (std::size_t c = 0; c < 3; ++c) {
        suns.rayleigh[c] = out.rayleigh[c].data();
        suns.mie[c] = out.mie[c].data();
        suns.many[c] = out.many[c].data();
    }
    PartRows rows;
    for (const AirPart& part : path.parts) {
        fill_rows(air, tables, path, part, rows);
        HWY_DYNAMIC_DISPATCH(add_part)(rows, suns);
    }
}

double visible_sun(double sine, double horizon_sine) {
    return smoothstep(0, 1, 0.5 + 0.5 * (sine - horizon_sine) / double(shader::kSunRadius));
}

}  // namespace nephos
#endif
