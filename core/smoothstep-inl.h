// SPDX-License-Identifier: Apache-2.0

// smooth_blend() of core/smoothstep.h for SIMD vectors of floats.

#if defined(NEPHOS_RENDER_SMOOTHSTEP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_SMOOTHSTEP_INL_H_
#undef NEPHOS_RENDER_SMOOTHSTEP_INL_H_
#else
#define NEPHOS_RENDER_SMOOTHSTEP_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class Floats>
HWY_INLINE Floats smooth_blend(Floats t) {
    const hn::DFromV<Floats> d;
    return hn::Mul(hn::Mul(t, t), hn::NegMulAdd(hn::Set(d, 2.0f), t, hn::Set(d, 3.0f)));
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
