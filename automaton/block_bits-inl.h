// SPDX-License-Identifier: Apache-2.0

// Conversion between the two orders of bits: rows of the lattice, whose words hold 8 cells of each of 8
// neighbouring blocks, and blocks, whose 512 bits are contiguous (CellBits). A layer of 8 blocks is a matrix
// of 8x8 bytes that is transposed; the 8 layers are the lanes of vectors.

#if defined(NEPHOS_BLOCK_BITS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_BLOCK_BITS_INL_H_
#undef NEPHOS_BLOCK_BITS_INL_H_
#else
#define NEPHOS_BLOCK_BITS_INL_H_
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "automaton/segment-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Exchanges, in every group of 2 * kShift bits, the upper half of a with the lower half of b.
template <int kShift, class D, class V = hn::Vec<D>>
HWY_INLINE void exchange(D d, std::uint64_t low_mask, V& a, V& b) {
    const V t = hn::And(hn::Xor(hn::ShiftRight<kShift>(a), b), hn::Set(d, low_mask));
    b = hn::Xor(b, t);
    a = hn::Xor(a, hn::ShiftLeft<kShift>(t));
}

// Transposes bytes: byte i of out[j][layer] = byte j of in[i][layer], for 8 layers.
HWY_INLINE void mirror_bytes(const CellBits* HWY_RESTRICT in, CellBits* HWY_RESTRICT out) {
    const hn::CappedTag<std::uint64_t, 8> d;
    for (std::size_t layer = 0; layer < 8; layer += hn::Lanes(d)) {
        hn::Vec<decltype(d)> v[8];
        for (int i = 0; i < 8; ++i) v[i] = hn::LoadU(d, in[i] + layer);
        for (int i : {0, 1, 2, 3}) exchange<32>(d, 0x00000000FFFFFFFFu, v[i], v[i + 4]);
        for (int i : {0, 1, 4, 5}) exchange<16>(d, 0x0000FFFF0000FFFFu, v[i], v[i + 2]);
        for (int i : {0, 2, 4, 6}) exchange<8>(d, 0x00FF00FF00FF00FFu, v[i], v[i + 1]);
        for (int i = 0; i < 8; ++i) hn::StoreU(v[i], d, out[i] + layer);
    }
}

// Returns the cells of a block that are cld now: only these can be extinguished.
inline const CellBits& cloud_of_block(const Segment& g, int block, BirthScratch& s) {
    const int word = block / 8;
    if ((s.known_cloud >> word & 1) == 0) {
        s.known_cloud |= 1u << word;
        alignas(64) CellBits rows[8];
        for (std::size_t row = 0; row < 64; ++row) {
            const std::ptrdiff_t at = g.row_word[row];
            rows[row % 8][row / 8] = at < 0 ? 0 : g.planes.cld[at + g.bx0 / 8 + word];
        }
        mirror_bytes(rows, s.cloud + 8 * word);
    }
    return s.cloud[block];
}

// Applies the segment's events of the dense draws to the planes and clears them.
inline void apply_dense_events(const Segment& g, BirthScratch& s) {
    const int last_word = (g.blocks + 7) / 8 - 1;
    const int cells_left = g.planes.extent.x - (g.bx0 + 8 * last_word) * kBlockEdge;
    const std::uint64_t last = cells_left >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << cells_left) - 1;
    std::uint64_t* const planes[3] = {g.planes.hum, g.planes.act_next, g.planes.cld};
    for (int draw = 0; draw < 3; ++draw) {
        for (; s.dense_words[draw] != 0; s.dense_words[draw] &= s.dense_words[draw] - 1) {
            const int word = std::countr_zero(s.dense_words[draw]);
            const std::uint64_t valid = word == last_word ? last : ~std::uint64_t{0};
            CellBits* blocks = s.dense_events[draw] + 8 * word;
            alignas(64) CellBits rows[8];
            mirror_bytes(blocks, rows);
            for (std::size_t row = 0; row < 64; ++row) {
                if (g.row_word[row] < 0) continue;
                std::uint64_t& cells = planes[draw][g.row_word[row] + g.bx0 / 8 + word];
                const std::uint64_t events = rows[row % 8][row / 8] & valid;
                cells = (cells | events) ^ (draw == kExt ? events : 0);
            }
            std::fill_n(&blocks[0][0], 64, std::uint64_t{0});
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
