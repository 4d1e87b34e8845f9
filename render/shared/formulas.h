// SPDX-License-Identifier: Apache-2.0

// Formulas of light and air, one source for all back-ends. It is compiled three times:
//
//     as GLSL                      Real = float                        (included by shared.h)
//     as C++, nephos::shader       Real = float                        (included by shared.h; tests check these)
//     as C++, per instruction set  Real = a vector, one ray a lane     (included by shading/formulas-inl.h)
//
// and therefore has no include guard. The including file defines Real; mul_add(a, b, c) = a b + c, fused
// where the instruction set has it; select(condition, a, b); min(), max(), sqrt(), exp(), log2() and abs();
// and fast_exp(), an exponential with a relative error of up to 4e-5. A parameter of type `float` is the same
// for all rays. Literals end in f, which C++ needs and GLSL accepts. Pure functions.

// Returns the line integral of the field of a metaball, in units of its radius. The field with u = 1 - a^2 is
// f = u^2 (5 + 4 u) / 9. Along a line at distance b from the centre, with w = 1 - b^2 (square of half the
// chord) and s from -sqrt(w) to sqrt(w), u = w - s^2 and
//
//     integral of (w - s^2)^2 = 16/15 w^(5/2),   of (w - s^2)^3 = 32/35 w^(7/2),   so
//     line_integral(w, sqrt(w)) = w^(5/2) (16/27 + 128/315 w)
NEPHOS_FUNCTION Real line_integral(Real w, Real root_w) {
    return w * w * root_w * mul_add(Real(0.406349206349206f), w, Real(0.592592592592593f));
}

// Returns the line integral from the middle of the chord up to s, |s| <= sqrt(w); odd in s.
NEPHOS_FUNCTION Real partial_line_integral(Real w, Real s) {
    Real s2 = s * s, w2 = w * w;
    Real square = mul_add(s2, mul_add(Real(-2.0f / 3.0f), w, 0.2f * s2), w2);
    Real cube = mul_add(s2, mul_add(s2, mul_add(Real(-1.0f / 7.0f), s2, 0.6f * w), -w2), w2 * w);
    return s * mul_add(Real(5.0f / 9.0f), square, (4.0f / 9.0f) * cube);
}

// Returns the irradiance of lightning relative to that at 1 km; constant within 100 m.
NEPHOS_FUNCTION Real flash_falloff(Real squared_distance_m) {
    return Real(1.0e6f) / max(squared_distance_m, Real(1.0e4f));
}

// Map a direction to the coordinates, 0..1, of the tables of the sky (atmosphere.h). Across: sine of half the
// azimuth from the sun's. Upwards, by the sine of the elevation: sqrt(q), q = 1 - sqrt(1 - sine), which is
// even around the zenith; half of the rows are in the lowest quarter of q, where the sky changes fastest.
NEPHOS_FUNCTION Real sky_across(Real cos_azimuth) {
    return sqrt(max(mul_add(Real(-0.5f), cos_azimuth, Real(0.5f)), Real(0.0f)));
}
NEPHOS_FUNCTION Real sky_upwards(Real sine) {
    return sqrt(sine / (1.0f + sqrt(max(1.0f - sine, Real(0.0f)))));
}

// Returns the distance along rays to a sphere of ground below the eye. `horizon`: sine of the elevation of the
// ray that touches it, above which nothing is met; `across` = altitude (2 R + altitude) / (R + altitude),
// metres, R the sphere's radius.
NEPHOS_FUNCTION Real sphere_distance(Real sine, float horizon, float across) {
    Real below = max(Real(horizon) - sine, Real(0.0f));
    return Real(across) / max(sqrt(below * max(Real(-horizon) - sine, Real(0.0f))) - sine, Real(1.0e-9f));
}

// Map a ray and a distance to the coordinates, 0..1, of the tables of air (atmosphere.h): the share of the way
// to the ground below the horizon, distance / (distance + 80 km) above; and rows, densest at the horizon, in
// the lower half of the table below it, in the upper half above.
NEPHOS_FUNCTION Real air_distance(Real distance, Real sine, float horizon, float across) {
    Real way = max(sphere_distance(sine, horizon, across), Real(1.0e-3f));
    Real share = select(sine < Real(horizon), distance / way, distance / (distance + Real(kAirScale)));
    return min(max(share, Real(0.0f)), Real(1.0f));
}
NEPHOS_FUNCTION Real air_row(Real sine, float horizon) {
    Real away = select(sine < Real(horizon), (horizon - sine) * (1.0f / (1.0f + horizon)),
                       (sine - Real(horizon)) * (1.0f / (1.0f - horizon)));
    return sky_upwards(min(max(away, Real(0.0f)), Real(1.0f)));
}

// Returns the mean of exp(-t) for t from 0 to x, (1 - exp(-x)) / x, x >= -80; by its series where x is small,
// with the accuracy of the exponential.
NEPHOS_FUNCTION Real mean_decay(Real x) {
    Real bounded = max(x, Real(-80.0f));
    Real series =
        mul_add(-x, mul_add(-x, mul_add(-x, Real(1.0f / 24.0f), Real(1.0f / 6.0f)), Real(0.5f)), Real(1.0f));
    Real quotient = (1.0f - fast_exp(-bounded)) / select(abs(x) < Real(0.1f), Real(1.0f), bounded);
    return select(abs(x) < Real(0.1f), series, quotient);
}

// Returns the integral of exp(-altitude per_height), in metres, along rays over a flat Earth that begin at an
// altitude; `slope` is the sine of their elevation.
NEPHOS_FUNCTION Real layer_column(float altitude, Real slope, Real distance, float per_height) {
    return exp(-altitude * per_height) * distance * mean_decay(slope * distance * per_height);
}

// Returns the integral of fog's exp(-height per_height) from the height of each ray's beginning on. Computed
// from the lower end, without loss of precision where the eye is far above the fog.
NEPHOS_FUNCTION Real fog_column(Real height_of_begin, Real slope, Real distance, float per_height) {
    Real low = mul_add(min(slope, Real(0.0f)), distance, height_of_begin);
    return fast_exp(min(-low * per_height, Real(60.0f))) * distance *
           mean_decay(abs(slope) * distance * per_height);
}

// Phase functions of molecules (Rayleigh) and of particles (Cornette and Shanks 1992; Sapronov's F / 4 pi),
// per steradian; each integrates to 1 over the sphere. cos_theta: between the directions of travel before and
// after, forward is 1.
NEPHOS_FUNCTION Real molecule_phase(Real cos_theta) {
    return (3.0f / (16.0f * kPi)) * mul_add(cos_theta, cos_theta, Real(1.0f));
}
NEPHOS_FUNCTION Real particle_phase(Real cos_theta, float g) {
    float factor = 3.0f / (8.0f * kPi) * (1.0f - g * g) / (2.0f + g * g);
    Real base = mul_add(Real(-2.0f * g), cos_theta, Real(1.0f + g * g));
    return factor * mul_add(cos_theta, cos_theta, Real(1.0f)) / (base * sqrt(base));
}

// Map an angle and an optical depth to coordinates of the scattering table (scattering_table.h), in nodes.
// With v = (1 - |cos|)^(1/4) nodes are evenly spaced in v, from v = 0 (forward) over 1 (sideways) back to 0
// (backward): near both ends the angle grows with the square of the node's number.
NEPHOS_FUNCTION Real scatter_column(Real cos_theta) {
    Real v = 0.5f * sqrt(sqrt(max(1.0f - abs(cos_theta), Real(0.0f))));
    return float(kScatterAngles - 1u) * select(cos_theta < Real(0.0f), 1.0f - v, v);
}
NEPHOS_FUNCTION Real scatter_row(Real depth) {
    return min(kScatterRowsPerDoubling * log2(1.0f + depth), Real(float(kScatterDepths - 1u)));
}
