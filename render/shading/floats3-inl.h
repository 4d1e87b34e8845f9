// SPDX-License-Identifier: Apache-2.0

// Vectors of three components, one a lane: directions, places and colours of several pixels or splats.

#if defined(NEPHOS_RENDER_FLOATS3_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_FLOATS3_INL_H_
#undef NEPHOS_RENDER_FLOATS3_INL_H_
#else
#define NEPHOS_RENDER_FLOATS3_INL_H_
#endif

#include <hwy/highway.h>

#include "render/shading/formulas-inl.h"
#include "render/shared/shared.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

struct Floats3 {
    Floats x, y, z;
};

HWY_INLINE Floats3 set3(const shader::vec4& v) { return {set(v.x), set(v.y), set(v.z)}; }
HWY_INLINE Floats3 add(const Floats3& a, const Floats3& b) {
    return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE Floats3 subtract(const Floats3& a, const Floats3& b) {
    return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE Floats3 times(Floats s, const Floats3& v) {
    return {hn::Mul(s, v.x), hn::Mul(s, v.y), hn::Mul(s, v.z)};
}
// s a + b
HWY_INLINE Floats3 times_add(Floats s, const Floats3& a, const Floats3& b) {
    return {hn::MulAdd(s, a.x, b.x), hn::MulAdd(s, a.y, b.y), hn::MulAdd(s, a.z, b.z)};
}
HWY_INLINE Floats3 each_times(const Floats3& a, const Floats3& b) {
    return {hn::Mul(a.x, b.x), hn::Mul(a.y, b.y), hn::Mul(a.z, b.z)};
}
HWY_INLINE Floats3 each_times_add(const Floats3& a, const Floats3& b, const Floats3& c) {
    return {hn::MulAdd(a.x, b.x, c.x), hn::MulAdd(a.y, b.y, c.y), hn::MulAdd(a.z, b.z, c.z)};
}
HWY_INLINE Floats3 mix(const Floats3& a, const Floats3& b, const Floats3& fraction) {
    return {hn::MulAdd(fraction.x, hn::Sub(b.x, a.x), a.x), hn::MulAdd(fraction.y, hn::Sub(b.y, a.y), a.y),
            hn::MulAdd(fraction.z, hn::Sub(b.z, a.z), a.z)};
}
HWY_INLINE Floats dot(const Floats3& a, const Floats3& b) {
    return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
HWY_INLINE Floats3 cross(const Floats3& a, const Floats3& b) {
    return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
            hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
