// SPDX-License-Identifier: Apache-2.0
#pragma once

// Functions of numbers for all modules (not installed).
//
// Sine, cosine and arc tangent are made from IEEE additions, multiplications, divisions and square roots alone, so
// that clouds have the same bits with every C library and processor (libm's functions may differ in the last
// bit). Angles are in degrees, whose reduction to a quarter turn is exact.

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace nephos {

// Returns 3 t^2 - 2 t^3 for t in 0..1: rises from 0 to 1 with slope 0 at both ends.
template <class T>
constexpr T smooth_blend(T t) {
    return t * t * (3 - 2 * t);
}

// Returns 0 at `low` and before it, 1 at `high` and beyond, smooth_blend() between. `low` may be above
// `high`; they must differ. NaN gives NaN.
template <class T>
constexpr T smoothstep(std::type_identity_t<T> low, std::type_identity_t<T> high, T x) {
    return smooth_blend(std::clamp<T>((x - low) / (high - low), 0, 1));
}

// A rotation in the plane, by the angle whose cosine and sine these are.
struct Rotation {
    double cos = 1, sin = 0;
};

// Returns a rotation followed by `quarters` quarter turns.
inline Rotation quarter_turned(const Rotation& by, long long quarters) {
    switch (quarters & 3) {
        case 0:
            return by;
        case 1:
            return {-by.sin, by.cos};
        case 2:
            return {-by.cos, -by.sin};
        default:
            return {by.sin, -by.cos};
    }
}

// Returns cosine and sine of an angle of |degrees| <= 1e6; absolute error below 4e-16. Pure.
inline Rotation rotation_of_degrees(double degrees) {
    const double quarters = std::floor(degrees / 90 + 0.5);
    const double r = (degrees - quarters * 90) * (3.14159265358979323846 / 180);  // -pi/4 .. pi/4
    const double q = r * r;
    // Taylor series by Horner's rule; the first terms left out are below 1e-18.
    const double s =
        r * (1 + q * (-1.0 / 6 +
                      q * (1.0 / 120 + q * (-1.0 / 5040 +
                                            q * (1.0 / 362880 + q * (-1.0 / 39916800 +
                                                                     q * (1.0 / 6227020800.0 +
                                                                          q * (-1.0 / 1307674368000.0))))))));
    const double c =
        1 + q * (-1.0 / 2 +
                 q * (1.0 / 24 +
                      q * (-1.0 / 720 + q * (1.0 / 40320 + q * (-1.0 / 3628800 +
                                                                q * (1.0 / 479001600 +
                                                                     q * (-1.0 / 87178291200.0 +
                                                                          q * (1.0 / 20922789888000.0))))))));
    return quarter_turned({c, s}, static_cast<long long>(quarters));
}

// Returns the same for angles of any size; absolute error below 1e-15. Its last bits differ, and golden hashes
// of automata depend on these, those of clouds on the others. Pure.
inline Rotation sin_cos_deg(double degrees) {
    const double turns = std::floor(degrees / 90 + 0.5);
    const double r = (degrees - turns * 90) * (3.14159265358979323846 / 180);  // -pi/4..pi/4
    const double r2 = r * r;
    double s = 0, c = 0;  // Taylor series; the first term left out is below 2e-17
    for (int n = 17; n >= 1; n -= 2) s = 1 - s * r2 / ((n + 1.0) * (n + 2.0));
    for (int n = 16; n >= 0; n -= 2) c = 1 - c * r2 / ((n + 1.0) * (n + 2.0));
    return quarter_turned({c, s * r}, int(std::fmod(turns, 4) + 4));
}

// Returns from * (to / from)^unit for positive ends and a unit of 0 to 1: as std::pow() gives it, but for a few parts in
// 10^15, and the same bits with every C library, as square roots are rounded alike everywhere. Pure.
inline double geometric(double from, double to, double unit) {
    if (unit >= 1) return to;
    double root = to / from, power = 1;
    for (int bit = 0; bit < 64 && unit > 0; ++bit) {  // binary digits of the unit
        root = std::sqrt(root);
        unit *= 2;
        if (unit < 1) continue;
        power *= root;
        unit -= 1;
    }
    return from * power;
}

// Returns the angle of the vector (x, y) from the x axis in degrees, counter-clockwise, -180..180; 0 for the
// null vector. Error below 1e-12 degrees. Pure.
inline double degrees_of_vector(double x, double y) {
    const double length = std::sqrt(x * x + y * y);
    if (!(length > 0)) return 0;
    // Halves the angle three times by tan(a/2) = tan a / (1 + sqrt(1 + tan^2 a)), first in the form
    // y / (length + |x|), which is exact up to |a| = 90 degrees.
    const double absolute = x < 0 ? -x : x;
    double t = y / (length + absolute);
    t = t / (1 + std::sqrt(1 + t * t));
    t = t / (1 + std::sqrt(1 + t * t));  // |t| <= tan(pi/16) < 0.2
    const double q = t * t;
    double series = 0;
    for (int n = 21; n >= 1; n -= 2) series = 1.0 / n - q * series;
    const double angle = 8 * t * series * (180 / 3.14159265358979323846);
    if (x >= 0) return angle;
    return y < 0 ? -180 - angle : 180 - angle;
}

}  // namespace nephos
