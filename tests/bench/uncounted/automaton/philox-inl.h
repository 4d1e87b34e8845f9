// SPDX-License-Identifier: Apache-2.0

// Stands in for automaton/philox-inl.h in the benchmark "all determinism against none": the words come from a
// xorshift128+ per thread (Vigna 2014), the fastest generator that passes as random, and depend on whoever draws
// first. Found first on the include path of that benchmark's copy of the kernels, and of nothing else.

#if defined(NEPHOS_PHILOX_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_PHILOX_INL_H_
#undef NEPHOS_PHILOX_INL_H_
#else
#define NEPHOS_PHILOX_INL_H_
#endif

#include <cstdint>

#include <hwy/highway.h>

#include "core/random.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

struct PhiloxKeys {
    explicit PhiloxKeys(std::uint64_t) {}
};

struct PhiloxBatch {
    const PhiloxKeys& keys;
    std::uint32_t word1, word3;
};

inline std::uint64_t pack_counter(std::uint32_t word0, std::uint32_t word2) {
    return word0 | std::uint64_t{word2} << 32;
}

// Writes as many words as 4 * count, in 64-bit numbers, up to the next whole vector.
HWY_INLINE void uncounted_words(int count, std::uint64_t* HWY_RESTRICT words) {
    alignas(64) static thread_local std::uint64_t states[2][8] = {
        {0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB, 0x2545F4914F6CDD1D, 0x1D872B41,
         0x5851F42D4C957F2D, 0x14057B7EF767814F, 0x369DEA0F31A53F85},
        {1, 2, 3, 4, 5, 6, 7, 8}};
    const hn::ScalableTag<std::uint64_t> d;
    const int lanes = int(hn::Lanes(d));
    auto s1 = hn::Load(d, states[0]), s0 = hn::Load(d, states[1]);
    for (int i = 0; i < 2 * count; i += lanes) {
        auto x = s1;
        const auto y = s0;
        s1 = y;
        x = hn::Xor(x, hn::ShiftLeft<23>(x));
        s0 = hn::Xor(hn::Xor(x, y), hn::Xor(hn::ShiftRight<17>(x), hn::ShiftRight<26>(y)));
        hn::StoreU(hn::Add(s0, y), d, words + i);
    }
    hn::Store(s1, d, states[0]);
    hn::Store(s0, d, states[1]);
}

HWY_INLINE void philox_counters(const PhiloxBatch&, const std::uint64_t*, int count,
                                std::uint32_t* HWY_RESTRICT out) {
    uncounted_words(count, reinterpret_cast<std::uint64_t*>(out));
}

HWY_INLINE void philox_events(const PhiloxBatch&, const std::uint64_t*, int count,
                              std::uint32_t* HWY_RESTRICT first, std::uint32_t* HWY_RESTRICT second) {
    uncounted_words((count + 1) / 2, reinterpret_cast<std::uint64_t*>(first));
    uncounted_words((count + 1) / 2, reinterpret_cast<std::uint64_t*>(second));
}

template <int kMax>
struct PhiloxTable {
    PhiloxTable(const PhiloxBatch&, Draw) {}
};

struct PhiloxBlock {
    PhiloxBlock() = default;
    PhiloxBlock(const PhiloxBatch&, std::uint32_t) {}
};

struct PhiloxJob {
    std::uint8_t block, quarter;
};

template <int kMax, class Finish>
HWY_INLINE void philox_jobs(const PhiloxBatch&, const PhiloxTable<kMax>&, const PhiloxBlock*, const PhiloxJob*,
                            int count, const Finish& finish) {
    const hn::CappedTag<std::uint64_t, 8> d;
    HWY_ALIGN std::uint64_t words[16];
    for (int n = 0; n < count; ++n) {
        uncounted_words(8, words);
        for (int i = 0; i < 8; i += int(hn::Lanes(d))) finish(n, i, hn::Load(d, words + i), hn::Load(d, words + 8 + i));
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
