// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/table_rows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cloud/table_rows.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// The points [begin, end) of a line.
void add_points(const NumberTable& table, const TableLine& line, std::size_t begin, std::size_t end, float* to) {
    const hn::ScalableTag<float> d;
    const hn::RebindToSigned<decltype(d)> di;
    const std::size_t lanes = hn::Lanes(d);
    const auto number = [&](float value) { return hn::Set(d, value); };
    const auto whole = [&](std::int32_t value) { return hn::Set(di, value); };
    const auto last_x = number(float(table.width - 1)), last_y = number(float(table.height - 1));
    for (std::size_t n = begin; n < end; n += lanes) {
        const auto step = hn::Iota(d, 0);
        const auto u = hn::MulAdd(step, number(float(line.du)), number(float(line.u + double(n) * line.du))),
                   v = hn::MulAdd(step, number(float(line.dv)), number(float(line.v + double(n) * line.dv)));
        const auto u0 = hn::Floor(u), v0 = hn::Floor(v), fu = hn::Sub(u, u0), fv = hn::Sub(v, v0);
        const auto at = [&](decltype(u0) x, decltype(u0) y) {
            const auto zero = hn::Zero(d);
            const auto inside = hn::And(hn::And(hn::Ge(x, zero), hn::Le(x, last_x)),
                                        hn::And(hn::Ge(y, zero), hn::Le(y, last_y)));
            const auto index = hn::Add(hn::Mul(hn::ConvertTo(di, hn::IfThenElseZero(inside, y)), whole(table.width)),
                                       hn::ConvertTo(di, hn::IfThenElseZero(inside, x)));
            return hn::IfThenElseZero(inside, hn::GatherIndex(d, table.numbers.data(), index));
        };
        const auto u1 = hn::Add(u0, number(1)), v1 = hn::Add(v0, number(1));
        const auto mixed = [](auto a, auto b, auto weight) { return hn::MulAdd(weight, hn::Sub(b, a), a); };
        const auto value = mixed(mixed(at(u0, v0), at(u1, v0), fu), mixed(at(u0, v1), at(u1, v1), fu), fv);
        if (n + lanes <= end) {
            hn::StoreU(hn::Add(hn::LoadU(d, to + n), value), d, to + n);
            continue;
        }
        HWY_ALIGN float values[hn::MaxLanes(d)];
        hn::Store(value, d, values);
        for (std::size_t i = 0; n + i < end; ++i) to[n + i] += values[i];
    }
}

void multiply_by_exp(const float* depths, std::size_t count, float* numbers) {
    const hn::ScalableTag<float> d;
    const std::size_t lanes = hn::Lanes(d);
    std::size_t n = 0;
    for (; n + lanes <= count; n += lanes) {
        const auto depth = hn::LoadU(d, depths + n);
        if (hn::AllTrue(d, hn::Eq(depth, hn::Zero(d)))) continue;
        hn::StoreU(hn::Mul(hn::LoadU(d, numbers + n), hn::Exp(d, hn::Neg(depth))), d, numbers + n);
    }
    for (; n < count; ++n) numbers[n] *= std::exp(-depths[n]);
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(add_points);
HWY_EXPORT(multiply_by_exp);

void add_along(const NumberTable& table, const TableLine& line, std::span<float> to) {
    // The points that may lie above the table, and one more on both sides.
    double begin = 0, end = double(to.size());
    const auto clip = [&](double at, double step, int size) {
        if (std::abs(step) < 1e-12) {
            if (at < -1 || at > size) end = begin;
            return;
        }
        const double a = (-1 - at) / step, b = (size - at) / step;
        begin = std::max(begin, std::floor(std::min(a, b)) - 1);
        end = std::min(end, std::ceil(std::max(a, b)) + 2);
    };
    clip(line.u, line.du, table.width);
    clip(line.v, line.dv, table.height);
    if (!(begin < end) || table.numbers.empty()) return;
    HWY_DYNAMIC_DISPATCH(add_points)(table, line, std::size_t(begin), std::size_t(end), to.data());
}

void attenuate(std::span<const float> depths, std::span<float> numbers) {
    HWY_DYNAMIC_DISPATCH(multiply_by_exp)(depths.data(), numbers.size(), numbers.data());
}

}  // namespace nephos
#endif
