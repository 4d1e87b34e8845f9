// SPDX-License-Identifier: Apache-2.0

// A vector of pixels of the pass over the ground, and what its surfaces reflect to the eye.

#if defined(NEPHOS_RENDER_GROUND_PASS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_GROUND_PASS_INL_H_
#undef NEPHOS_RENDER_GROUND_PASS_INL_H_
#else
#define NEPHOS_RENDER_GROUND_PASS_INL_H_
#endif

#include <hwy/highway.h>

#include "render/ground/ground_look-inl.h"
#include "render/ground/ground_pass.h"
#include "render/shading/background-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// A pixel's ray and the ground that it meets.
struct Seen {
    Floats3 ray, point, beta;
    Floats3 veil;    // light of the air up to the ground; where there is a mirror
    Floats pixel_m;                  // size of the pixel there, the geometric mean of both directions
    Floats3 dry;                     // albedo
};

// Returns the light that a surface of this roughness reflects to the eye. Light of the sky is attenuated by
// the air in front of the ground; light of clouds in the mirrored view has passed that air, whose own light
// is subtracted.
HWY_INLINE Floats3 reflected(const GroundPass& pass, const Seen& seen, const Floats3& direction,
                             Floats blur) {
    const Mirrored view = mirrored(*pass.mirror, direction, blur);
    const Floats zero = hn::Zero(Lanes()), sky = view.transmittance, cloud = hn::Sub(set(1.0f), sky);
    const auto of = [&](Floats light, Floats beta, Floats veil) {
        const Floats beyond = hn::Max(hn::Sub(light, veil), zero);
        return hn::MulAdd(hn::Mul(light, beta), sky, hn::Mul(beyond, cloud));
    };
    return {of(view.light.x, seen.beta.x, seen.veil.x), of(view.light.y, seen.beta.y, seen.veil.y),
            of(view.light.z, seen.beta.z, seen.veil.z)};
}

// The mirrored direction of a ray that meets water with these slopes; never below the horizon.
HWY_INLINE Floats3 mirrored_ray(const Floats3& ray, Floats slope_x, Floats slope_y) {
    const Lanes d;
    const Floats per_length =
        hn::Div(set(1.0f), hn::Sqrt(hn::MulAdd(slope_x, slope_x, hn::MulAdd(slope_y, slope_y, set(1.0f)))));
    const Floats3 normal{hn::Mul(hn::Neg(slope_x), per_length), hn::Mul(hn::Neg(slope_y), per_length),
                         per_length};
    const Floats along = hn::Mul(set(-2.0f), dot(ray, normal));
    Floats3 out = times_add(along, normal, ray);
    out.z = hn::Max(out.z, hn::Min(hn::Neg(ray.z), set(1.0e-3f)));
    return hn::AllTrue(d, hn::Gt(out.z, hn::Zero(d))) ? out : Floats3{ray.x, ray.y, hn::Abs(ray.z)};
}

struct Surface {
    Floats3 albedo;     // of what scatters below the surface
    Floats3 reflected;  // light, behind the air
};

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
