// SPDX-License-Identifier: Apache-2.0
#include "density/node_sums.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>

#include "density/metaballs.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "density/node_sums.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Sums for kRow nodes along x in each of `count` (at most 5) rows, which begin `stride` cells apart. All rows share the
// load of a weight, and their sums do not wait for each other.
void sum_rows(std::span<const NodeSums::Tap> taps, const float* cells, int stride, int count, float* out) {
    constexpr int kRow = NodeSums::kRow, kRows = CoverageField::kBrickNodes / 2 + 1;
    const hn::CappedTag<float, kRow> d;
    const int lanes = int(hn::Lanes(d));
    for (int part = 0; part < kRow; part += lanes) {
        auto a = hn::Zero(d), b = a, c = a, e = a, f = a;
        const float *const r0 = cells + part, *const r1 = r0 + std::min(1, count - 1) * stride,
                           *const r2 = r0 + std::min(2, count - 1) * stride,
                           *const r3 = r0 + std::min(3, count - 1) * stride,
                           *const r4 = r0 + std::min(4, count - 1) * stride;
        static_assert(kRows == 5);
        for (const NodeSums::Tap& tap : taps) {
            const auto weight = hn::Set(d, tap.weight);
            a = hn::MulAdd(weight, hn::LoadU(d, r0 + tap.offset), a);
            b = hn::MulAdd(weight, hn::LoadU(d, r1 + tap.offset), b);
            c = hn::MulAdd(weight, hn::LoadU(d, r2 + tap.offset), c);
            e = hn::MulAdd(weight, hn::LoadU(d, r3 + tap.offset), e);
            f = hn::MulAdd(weight, hn::LoadU(d, r4 + tap.offset), f);
        }
        hn::StoreU(a, d, out + part);
        hn::StoreU(b, d, out + kRow + part);
        hn::StoreU(c, d, out + 2 * kRow + part);
        hn::StoreU(e, d, out + 3 * kRow + part);
        hn::StoreU(f, d, out + 4 * kRow + part);
    }
}

// `growths` are those times the means.
void nodes_as_bytes(const float* means, const float* growths, float half_density, std::uint16_t* out) {
    const hn::ScalableTag<float> d;
    const hn::Rebind<std::int32_t, decltype(d)> di;
    const hn::Rebind<std::uint16_t, decltype(d)> dh;
    const auto number = [&](float value) { return hn::Set(d, value); };
    for (std::size_t n = 0; n < NodeSums::kNodes; n += hn::Lanes(d)) {
        const auto mean = hn::LoadU(d, means + n);
        const auto t = hn::Div(mean, hn::Add(mean, number(half_density)));
        const auto growth = hn::Div(hn::LoadU(d, growths + n), hn::Max(mean, number(1e-30f)));
        const auto within = hn::Min(hn::Max(growth, number(-1.0f)), number(1.0f));
        const auto low = hn::ConvertTo(di, hn::Add(hn::Mul(number(255), t), number(0.5f))),
                   high = hn::ConvertTo(di, hn::Add(number(128.5f), hn::Mul(number(127), within)));
        hn::StoreU(hn::DemoteTo(dh, hn::Or(low, hn::ShiftLeft<8>(high))), dh, out + n);
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(sum_rows);
HWY_EXPORT(nodes_as_bytes);

namespace {

constexpr int kEdge = CoverageField::kBrickNodes, kCells = CoverageField::kBrickCells;

}  // namespace

NodeSums::NodeSums(double radius) : reach_(int(std::ceil(radius)) + 1), side_(2 * reach_ + kCells + 1) {
    for (int parity = 0; parity < 8; ++parity) {
        const double at[3] = {0.5 * (parity & 1), 0.5 * (parity >> 1 & 1), 0.5 * (parity >> 2)};
        double sum = 0;
        for (int k = -reach_; k <= reach_; ++k) {
            for (int j = -reach_; j <= reach_; ++j) {
                for (int i = -reach_; i <= reach_; ++i) {
                    const double x = i + 0.5 - at[0], y = j + 0.5 - at[1], z = k + 0.5 - at[2];
                    const double field = metaball_field(std::sqrt(x * x + y * y + z * z) / radius);
                    if (!(field > 0)) continue;
                    taps_[parity].push_back({(k * side_ + j) * pitch() + i, float(field)});
                    sum += field;
                }
            }
        }
        for (Tap& tap : taps_[parity]) tap.weight = float(tap.weight / sum);
    }
}

void NodeSums::sum(const float* cells, float* nodes) const {
    float rows[2][(kEdge / 2 + 1) * kRow];  // of even and odd nodes along x
    for (int parity = 0; parity < 4; ++parity) {
        const int y0 = parity & 1, count = (kEdge - y0 + 1) / 2;
        for (int z = parity >> 1; z < kEdge; z += 2) {
            const float* const from = cells + ((z / 2 + reach_) * side_ + reach_) * pitch() + reach_;
            for (int x0 = 0; x0 < 2; ++x0)
                HWY_DYNAMIC_DISPATCH(sum_rows)(taps_[2 * parity + x0], from, pitch(), count, rows[x0]);
            for (int row = 0; row < count; ++row) {
                float* const to = nodes + (z * kEdge + y0 + 2 * row) * kEdge;
                const float *const even = rows[0] + row * kRow, *const odd = rows[1] + row * kRow;
                for (int x = 0; x < kEdge / 2; ++x) {
                    to[2 * x] = even[x];
                    to[2 * x + 1] = odd[x];
                }
                to[kEdge - 1] = even[kEdge / 2];
            }
        }
    }
}

void NodeSums::to_bytes(const Nodes& means, const Nodes& growths, float half_density, std::uint8_t* out) {
    std::uint16_t pairs[kNodes + kBehind];
    HWY_DYNAMIC_DISPATCH(nodes_as_bytes)(means.data(), growths.data(), half_density, pairs);
    std::memcpy(out, pairs, 2 * kNodes);
}

}  // namespace nephos
#endif
