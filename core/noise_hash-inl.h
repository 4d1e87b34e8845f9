// SPDX-License-Identifier: Apache-2.0

// mix_bits() of noise_hash.h for SIMD vectors of 32-bit words (not installed).

#if defined(NEPHOS_DENSITY_NOISE_HASH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_DENSITY_NOISE_HASH_INL_H_
#undef NEPHOS_DENSITY_NOISE_HASH_INL_H_
#else
#define NEPHOS_DENSITY_NOISE_HASH_INL_H_
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

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
