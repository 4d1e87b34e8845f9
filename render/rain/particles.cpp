// SPDX-License-Identifier: Apache-2.0
#include "render/rain/particles.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/rain/particles.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::ScalableTag<double>;
using Floats = hn::Rebind<float, Doubles>;  // as many
using DoubleVector = hn::Vec<Doubles>;

// Returns the fractional part less a half: -0.5 .. 0.5.
HWY_INLINE DoubleVector centred_fraction(DoubleVector v) {
    const Doubles d;
    return hn::Sub(hn::Sub(v, hn::Floor(v)), hn::Set(d, 0.5));
}

// In doubles: after days of rain a float would count fall in metres. No fused products, so that all
// processors round alike.
void place_some(const Particles& p, const ParticleBoxes& boxes, std::size_t begin, std::size_t count,
                float* HWY_RESTRICT x_m, float* HWY_RESTRICT y_m, float* HWY_RESTRICT z_m) {
    const Doubles d;
    const Floats f;
    const DoubleVector half = hn::Set(d, 0.5), depth2 = hn::Set(d, 2 * boxes.depth_m),
                       margin = hn::Set(d, boxes.margin_m), height = hn::Set(d, boxes.height_m);
    const DoubleVector away_x = hn::Set(d, boxes.carried_x_m - boxes.centre_x_m),
                       away_y = hn::Set(d, boxes.carried_y_m - boxes.centre_y_m);
    const DoubleVector away_z = hn::Set(d, -boxes.centre_z_m / boxes.height_m),
                       fall = hn::Set(d, -boxes.time_s / boxes.height_m);
    const auto load = [&](const std::vector<float>& from, std::size_t i) {
        return hn::PromoteTo(d, hn::LoadU(f, from.data() + begin + i));
    };
    const auto place = [&](std::size_t i) HWY_ATTR {
        const DoubleVector width = hn::Add(hn::Mul(load(p.reach, i), depth2), margin);
        const DoubleVector per_width = hn::Div(hn::Set(d, 1.0), width);
        const auto across = [&](const std::vector<float>& phase, DoubleVector away) HWY_ATTR {
            const DoubleVector at = hn::Add(hn::Add(load(phase, i), hn::Mul(away, per_width)), half);
            return hn::DemoteTo(f, hn::Mul(centred_fraction(at), width));
        };
        const DoubleVector fallen = hn::Add(hn::Mul(load(p.speed, i), fall), away_z);
        const DoubleVector at = hn::Add(hn::Add(load(p.z, i), fallen), half);
        hn::StoreU(across(p.x, away_x), f, x_m + i);
        hn::StoreU(across(p.y, away_y), f, y_m + i);
        hn::StoreU(hn::DemoteTo(f, hn::Mul(centred_fraction(at), height)), f, z_m + i);
    };
    const std::size_t lanes = hn::Lanes(d);
    if (count < lanes) return;
    for (std::size_t i = 0; i + lanes <= count; i += lanes) place(i);
    if (count % lanes != 0) place(count - lanes);  // some a second time
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <cmath>

#include "core/random.h"
#include "render/rain/drop_sizes.h"

namespace nephos {
namespace {

HWY_EXPORT(place_some);

constexpr std::size_t kMostLanes = 8;  // doubles in the widest vector of any target

// Even numbers of a sequence of low discrepancy (Roberts 2018): any run of particles has all sizes and
// reaches in their fractions.
double weyl(std::size_t i, double step, double start) {
    const double value = start + double(i) * step;
    return value - std::floor(value);
}

}  // namespace

Particles make_particles(PrecipitationKind kind, std::uint64_t seed, std::size_t count) {
    // The two irrational steps of the plane's sequence: powers of the real root of x^3 = x + 1.
    constexpr double kStepA = 0.7548776662466927, kStepB = 0.5698402909980532;
    Particles p;
    p.kind = kind;
    for (std::vector<float>* all : {&p.x, &p.y, &p.z, &p.reach, &p.speed, &p.diameter_mm}) all->resize(count);
    const PhiloxWords start = philox(seed, item_counter(Domain::particles, 0, 0, 0, 1));
    for (std::size_t i = 0; i < count; ++i) {
        const PhiloxWords w = philox(seed, item_counter(Domain::particles, 0, std::uint32_t(i), 0, 0));
        p.x[i] = float(unit_interval(w[0] & ~0xffu));  // 24 bits: never rounded up to 1
        p.y[i] = float(unit_interval(w[1] & ~0xffu));
        p.z[i] = float(unit_interval(w[2] & ~0xffu));
        p.reach[i] = float(std::cbrt(weyl(i, kStepA, unit_interval(start[0]))));
        const double diameter = drawn_diameter_mm(kind, weyl(i, kStepB, unit_interval(start[1])));
        p.diameter_mm[i] = float(diameter);
        p.speed[i] = float(fall_speed_m_per_s(kind, diameter));
    }
    return p;
}

void place_particles(const Particles& particles, const ParticleBoxes& boxes, std::size_t begin,
                     std::size_t end, float* x_m, float* y_m, float* z_m) {
    if (end - begin >= kMostLanes || begin == end) {
        if (begin != end)
            HWY_DYNAMIC_DISPATCH(place_some)(particles, boxes, begin, end - begin, x_m, y_m, z_m);
        return;
    }
    // Fewer than a vector holds: a copy with room.
    Particles few;
    few.kind = particles.kind;
    const std::size_t count = end - begin;
    const auto copy = [&](std::vector<float>& to, const std::vector<float>& from) {
        to.assign(kMostLanes, 0.0f);
        for (std::size_t i = 0; i < count; ++i) to[i] = from[begin + i];
    };
    copy(few.x, particles.x);
    copy(few.y, particles.y);
    copy(few.z, particles.z);
    copy(few.reach, particles.reach);
    copy(few.speed, particles.speed);
    float places[3][kMostLanes];
    HWY_DYNAMIC_DISPATCH(place_some)(few, boxes, 0, kMostLanes, places[0], places[1], places[2]);
    for (std::size_t i = 0; i < count; ++i) {
        x_m[i] = places[0][i];
        y_m[i] = places[1][i];
        z_m[i] = places[2][i];
    }
}

}  // namespace nephos
#endif
