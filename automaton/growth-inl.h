// SPDX-License-Identifier: Apache-2.0

// Growth (D after Nagel), one row at a time, all cells of a vector at once:
//
//     hum' = hum & !act      cld' = cld | act      act' = hum' & f_act
//
// which is D's rule, because !act & hum is hum'. f_act ors act at the six neighbours, at distance two along x
// and y, and two cells below; a shift along x takes bits across words from loads that begin one word to
// either side.

#if defined(NEPHOS_GROWTH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_GROWTH_INL_H_
#undef NEPHOS_GROWTH_INL_H_
#else
#define NEPHOS_GROWTH_INL_H_
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "automaton/kernels.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The rows of act that one row reads; rows outside the lattice are rows of zeros.
struct ActRows {
    const std::uint64_t *centre, *south1, *south2, *north1, *north2, *below1, *below2, *above1;
};

// Row j + dj, k + dk of act, by the boundaries.
HWY_INLINE const std::uint64_t* act_row(const StepPlanes& p, int j, int k) {
    if (j < 0 || j >= p.extent.y) {
        if (p.boundaries.y == Boundary::open) return p.zero_row;
        j = (j % p.extent.y + p.extent.y) % p.extent.y;
    }
    if (k < 0 || k >= p.extent.z) {
        if (p.boundaries.z == Boundary::open) return p.zero_row;
        k = (k % p.extent.z + p.extent.z) % p.extent.z;
    }
    return p.act + (std::size_t(k) * std::size_t(p.extent.y) + std::size_t(j)) * p.words_per_row;
}

// Neighbours of a periodic row across its ends: at most the two cells at either end are concerned.
inline void wrap_row(const std::uint64_t* act, const std::uint64_t* hum_next, std::uint64_t* act_next,
                     int nx) {
    const auto get = [act](int i) { return (act[i / 64] >> (i % 64)) & 1u; };
    const auto feed = [&](int i, std::uint64_t bit) {
        act_next[i / 64] |= (bit << (i % 64)) & hum_next[i / 64];
    };
    if (nx >= 4) {
        const std::uint64_t first = get(0), second = get(1), last = get(nx - 1), last_but_one = get(nx - 2);
        feed(0, last | last_but_one);
        feed(1, last);
        feed(nx - 1, first | second);
        feed(nx - 2, first);
        return;
    }
    for (int i = 0; i < nx; ++i) {  // so narrow that a cell meets others, and itself, around the axis
        for (int di : {-2, -1, 1, 2}) feed(i, get(((i + di) % nx + nx) % nx));
    }
}

// The first `count` lanes from p, at least one and not all; the others are 0 and their memory is not read,
// since another thread may write it. p has the alignment of a word: hn::MaskedLoad() asks for that of a
// vector wherever the instruction set has no masked load.
template <class D>
HWY_INLINE hn::Vec<D> load_first(D d, std::size_t count, const std::uint64_t* p) {
#if HWY_TARGET <= HWY_AVX2
    return hn::MaskedLoad(hn::FirstN(d, count), d, p);
#else
    HWY_ALIGN std::uint64_t words[hn::MaxLanes(d)] = {};
    std::copy_n(p, count, words);
    return hn::Load(d, words);
#endif
}

// kEnds: the vector holds the row's first or last word, so that bits of other rows must be masked.
template <bool kEnds, bool kStream, class D>
HWY_INLINE void grow_vector(D d, const ActRows& rows, std::size_t w, std::size_t words, std::uint64_t* hum,
                            std::uint64_t* cld, std::uint64_t* act_next) {
    const std::size_t lanes = hn::Lanes(d);
    const auto act = hn::LoadU(d, rows.centre + w);
    auto west = hn::LoadU(d, rows.centre + w - 1);
    auto east = hn::LoadU(d, rows.centre + w + 1);
    if constexpr (kEnds) {
        if (w == 0) west = hn::IfThenZeroElse(hn::FirstN(d, 1), west);
        if (w + lanes >= words) east = hn::IfThenElseZero(hn::FirstN(d, words - 1 - w), east);
    }
    const auto west12 = hn::Or(hn::Or(hn::ShiftLeft<1>(act), hn::ShiftRight<63>(west)),
                               hn::Or(hn::ShiftLeft<2>(act), hn::ShiftRight<62>(west)));
    const auto east12 = hn::Or(hn::Or(hn::ShiftRight<1>(act), hn::ShiftLeft<63>(east)),
                               hn::Or(hn::ShiftRight<2>(act), hn::ShiftLeft<62>(east)));
    const auto y1 = hn::Or(hn::LoadU(d, rows.south1 + w), hn::LoadU(d, rows.north1 + w));
    const auto y2 = hn::Or(hn::LoadU(d, rows.south2 + w), hn::LoadU(d, rows.north2 + w));
    const auto z1 = hn::Or(hn::LoadU(d, rows.below1 + w), hn::LoadU(d, rows.above1 + w));
    const auto z2 = hn::LoadU(d, rows.below2 + w);
    const auto f_act = hn::Or(hn::Or(hn::Or(west12, east12), hn::Or(y1, y2)), hn::Or(z1, z2));
    if (kEnds && w + lanes > words) {
        const auto valid = hn::FirstN(d, words - w);
        const auto hum_next = hn::AndNot(act, load_first(d, words - w, hum + w));
        hn::BlendedStore(hum_next, valid, d, hum + w);
        hn::BlendedStore(hn::Or(load_first(d, words - w, cld + w), act), valid, d, cld + w);
        hn::BlendedStore(hn::And(hum_next, f_act), valid, d, act_next + w);
        return;
    }
    const auto hum_next = hn::AndNot(act, hn::LoadU(d, hum + w));
    hn::StoreU(hum_next, d, hum + w);
    hn::StoreU(hn::Or(hn::LoadU(d, cld + w), act), d, cld + w);
    if constexpr (kStream) {
        hn::Stream(hn::And(hum_next, f_act), d, act_next + w);
    } else {
        hn::StoreU(hn::And(hum_next, f_act), d, act_next + w);
    }
}

// Asks for what the row above the row at `at`, in layer k, will read first. A part takes some 4 KiB of each layer, too little
// for the processor to foresee the next one.
HWY_INLINE void fetch_next_layer(const StepPlanes& p, std::size_t at, int k) {
    const std::size_t layer = std::size_t(p.extent.y) * p.words_per_row;
    const bool act = k + 2 < p.extent.z;
    for (std::size_t w = 0; w < p.words_per_row; w += 8) {
        hwy::Prefetch(p.hum + at + layer + w);
        hwy::Prefetch(p.cld + at + layer + w);
        if (act) hwy::Prefetch(p.act + at + 2 * layer + w);
    }
}

// Rows y0..y1 of layers z0..z1. kStream writes act past the caches: for planes that are not read again this
// step.
template <bool kStream, bool kLarge>
HWY_NOINLINE void grow(const StepPlanes& p, int z0, int z1, int y0, int y1) {
    const hn::ScalableTag<std::uint64_t> d;
    const std::size_t lanes = hn::Lanes(d);
    const std::size_t words = p.words_per_row;
    for (int k = z0; k < z1; ++k) {
        for (int j = y0; j < y1; ++j) {
            const std::size_t at = (std::size_t(k) * std::size_t(p.extent.y) + std::size_t(j)) * words;
            ActRows rows{};
            rows.centre = p.act + at;
            if (j >= 2 && j + 2 < p.extent.y && k >= 2 && k + 1 < p.extent.z) {
                const std::size_t layer = std::size_t(p.extent.y) * words;
                rows.south1 = rows.centre - words, rows.south2 = rows.south1 - words;
                rows.north1 = rows.centre + words, rows.north2 = rows.north1 + words;
                rows.below1 = rows.centre - layer, rows.below2 = rows.below1 - layer;
                rows.above1 = rows.centre + layer;
            } else {
                rows.south1 = act_row(p, j - 1, k), rows.south2 = act_row(p, j - 2, k);
                rows.north1 = act_row(p, j + 1, k), rows.north2 = act_row(p, j + 2, k);
                rows.below1 = act_row(p, j, k - 1), rows.below2 = act_row(p, j, k - 2);
                rows.above1 = act_row(p, j, k + 1);
            }
            std::uint64_t *hum = p.hum + at, *cld = p.cld + at, *act_next = p.act_next + at;
            if constexpr (kLarge) {
                if (k + 1 < z1) fetch_next_layer(p, at, k);
            }
            grow_vector<true, kStream>(d, rows, 0, words, hum, cld, act_next);
            std::size_t w = lanes;
            for (; w + lanes < words; w += lanes) {
                grow_vector<false, kStream>(d, rows, w, words, hum, cld, act_next);
            }
            if (w < words) grow_vector<true, kStream>(d, rows, w, words, hum, cld, act_next);
        }
        // After the layer, not after each row: words that have just been stored as part of a vector are not there to load yet.
        if (p.boundaries.x != Boundary::periodic) continue;
        for (int j = y0; j < y1; ++j) {
            const std::size_t at = (std::size_t(k) * std::size_t(p.extent.y) + std::size_t(j)) * words;
            wrap_row(p.act + at, p.hum + at, p.act_next + at, p.extent.x);
        }
    }
    if constexpr (kStream) hwy::FlushStream();  // others read act_next in the next step
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
