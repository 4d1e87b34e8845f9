// SPDX-License-Identifier: Apache-2.0

// mix_bits() of core/noise_hash.h for vectors of 32-bit words, smooth_blend() of core/math.h for vectors of
// floats (not installed).

#if defined(NEPHOS_CORE_VECTORS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_CORE_VECTORS_INL_H_
#undef NEPHOS_CORE_VECTORS_INL_H_
#else
#define NEPHOS_CORE_VECTORS_INL_H_
#endif

#include <hwy/highway.h>

#include "core/noise_hash.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class Words>
HWY_INLINE Words mixed(Words h) {
    const hn::DFromV<Words> d;
    h = hn::Mul(hn::Xor(h, hn::ShiftRight<16>(h)), hn::Set(d, kMixFirst));
    h = hn::Mul(hn::Xor(h, hn::ShiftRight<15>(h)), hn::Set(d, kMixSecond));
    return hn::Xor(h, hn::ShiftRight<16>(h));
}

template <class Floats>
HWY_INLINE Floats smooth_blend(Floats t) {
    const hn::DFromV<Floats> d;
    return hn::Mul(hn::Mul(t, t), hn::NegMulAdd(hn::Set(d, 2.0f), t, hn::Set(d, 3.0f)));
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
