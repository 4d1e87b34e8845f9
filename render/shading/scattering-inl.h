// SPDX-License-Identifier: Apache-2.0

// render/shading/scattering.glsl for vectors: what metaballs and fog scatter of the sunlight, from the table
// (scattering_table.h).

#if defined(NEPHOS_RENDER_SCATTERING_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_RENDER_SCATTERING_INL_H_
#undef NEPHOS_RENDER_SCATTERING_INL_H_
#else
#define NEPHOS_RENDER_SCATTERING_INL_H_
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/frame/scattering_table.h"
#include "render/shading/background-inl.h"
#include "render/shading/formulas-inl.h"
#include "render/shared/shared.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

// A place between two nodes of the scattering table.
struct Between {
    hn::Vec<hn::RebindToSigned<Lanes>> below;
    Floats fraction;  // of the node above
};

HWY_INLINE Between between(Floats place, shader::uint nodes) {
    const hn::RebindToSigned<Lanes> di;
    const auto below = hn::Min(hn::ConvertTo(di, place), hn::Set(di, int(nodes) - 2));
    return {below, hn::Sub(place, hn::ConvertTo(Lanes(), below))};
}

HWY_INLINE Between scatter_column(Floats cosine) {
    return between(formulas::scatter_column(cosine), shader::kScatterAngles);
}
HWY_INLINE Between scatter_row(Floats depth) {
    return between(formulas::scatter_row(depth), shader::kScatterDepths);
}

// `first`: index of the row's first node.
HWY_INLINE Floats scattering_at(const float* HWY_RESTRICT table, hn::Vec<hn::RebindToSigned<Lanes>> first,
                                const Between& angle) {
    const auto at = hn::Add(first, angle.below);
    const Floats a = hn::GatherIndex(Lanes(), table, at), b = hn::GatherIndex(Lanes(), table + 1, at);
    return hn::MulAdd(angle.fraction, hn::Sub(b, a), a);
}

// Returns pi times the phase function of the cosine, for red, green and blue.
HWY_INLINE Floats3 scattered_once(const PictureFrame& frame, Floats cosine) {
    const hn::RebindToSigned<Lanes> di;
    const Between column = scatter_column(cosine);
    if (!frame.bows) {
        const Floats white = scattering_at(frame.scattering, hn::Zero(di), column);
        return {white, white, white};
    }
    const auto of_colour = [&](std::size_t colour) {
        const std::size_t first = (kRowsBeforeColours + colour) * shader::kScatterAngles;
        return scattering_at(frame.scattering, hn::Set(di, int(first)), column);
    };
    return {of_colour(0), of_colour(1), of_colour(2)};
}

HWY_INLINE Floats scattered_often(const PictureFrame& frame, const Floats3& ray, Floats sun_depth) {
    const hn::RebindToSigned<Lanes> di;
    const Between column = scatter_column(dot(set3(frame.to_sun), ray)), row = scatter_row(sun_depth);
    const auto angles = hn::Set(di, int(shader::kScatterAngles));
    const auto first = hn::Mul(hn::Add(row.below, hn::Set(di, 1)), angles);
    const Floats a = scattering_at(frame.scattering, first, column),
                 b = scattering_at(frame.scattering, hn::Add(first, angles), column);
    return hn::MulAdd(row.fraction, hn::Sub(b, a), a);
}

// The same at the node `angle` of the table alone: what was scattered often changes little from one to the
// next.
HWY_INLINE Floats scattered_often(const PictureFrame& frame, Words angle, Floats sun_depth) {
    const hn::RebindToSigned<Lanes> di;
    const Between row = scatter_row(sun_depth);
    const auto angles = hn::Set(di, int(shader::kScatterAngles));
    const auto at = hn::Add(hn::Mul(hn::Add(row.below, hn::Set(di, 1)), angles), angle);
    const Floats a = hn::GatherIndex(Lanes(), frame.scattering, at),
                 b = hn::GatherIndex(Lanes(), frame.scattering, hn::Add(at, angles));
    return hn::MulAdd(row.fraction, hn::Sub(b, a), a);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
