// SPDX-License-Identifier: Apache-2.0

// Conversion between the two places of bits: rows of the lattice, whose words hold 8 cells of each of 8 neighbouring blocks,
// and blocks, whose 512 bits are contiguous (CellBits). For the 64 blocks of a segment that is a matrix of 64 x 64 bytes which
// is transposed: bytes within groups of 8 blocks, then words within groups of 8 rows, where a vector holds 8 words. Narrower
// vectors transpose the bytes alone and leave each word to itself.

#if defined(NEPHOS_BLOCK_BITS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef NEPHOS_BLOCK_BITS_INL_H_
#undef NEPHOS_BLOCK_BITS_INL_H_
#else
#define NEPHOS_BLOCK_BITS_INL_H_
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "automaton/segment-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Returns a bit for each lane of a mask of at most 64 lanes.
template <class D>
HWY_INLINE std::uint64_t bits_of(D d, hn::Mask<D> mask) {
#if HWY_TARGET <= HWY_AVX3
    (void)d;
    return std::uint64_t{mask.raw};
#else
    std::uint8_t bytes[16] = {};  // StoreMaskBits may write 8 bytes from where it starts
    hn::StoreMaskBits(d, mask, bytes);
    std::uint64_t bits = 0;
    for (std::size_t n = 0; n < (hn::MaxLanes(d) + 7) / 8; ++n) bits |= std::uint64_t{bytes[n]} << (8 * n);
    return hn::Lanes(d) == 64 ? bits : bits & ((std::uint64_t{1} << hn::Lanes(d)) - 1);
#endif
}

#if HWY_TARGET == HWY_AVX2
// The lanes of each mask of 8, rising, four bits each. hn::Compress() copies such a table to the stack at each call.
inline constexpr std::array<std::uint32_t, 256> kLanesOfMask = [] {
    std::array<std::uint32_t, 256> lanes{};
    for (std::uint32_t mask = 0; mask < 256; ++mask)
        for (std::uint32_t lane = 0, n = 0; lane < 8; ++lane)
            if ((mask >> lane & 1) != 0) lanes[mask] |= lane << (4 * n++);
    return lanes;
}();
#endif

// Returns first, first + 1, ...; hn::Iota() of what is not constant stores lane by lane and loads the vector, which waits for it.
template <class D>
HWY_INLINE hn::Vec<D> rising_from(D d, hn::TFromD<D> first) {
    return hn::Add(hn::Set(d, first), hn::Iota(d, 0));
}

// Moves the lanes of a mask, 32 bits each, to the front.
template <class DU, class V = hn::Vec<DU>>
HWY_INLINE V compress([[maybe_unused]] DU du, V v, hn::Mask<DU> mask) {
#if HWY_TARGET == HWY_AVX2
    if constexpr (hn::MaxLanes(du) == 8) {
        const auto packed = hn::Set(du, kLanesOfMask[bits_of(du, mask)]);
        const auto lanes = hn::And(hn::Shr(packed, hn::ShiftLeft<2>(hn::Iota(du, 0))), hn::Set(du, 7));
        return hn::TableLookupLanes(v, hn::IndicesFromVec(du, lanes));
    }
#endif
    return hn::Compress(v, mask);
}

// Fills the bits of `count` blocks, which have the alignment of vectors.
HWY_INLINE void fill_bits(CellBits* bits, int count, std::uint64_t word) {
    const hn::CappedTag<std::uint64_t, 8> d;
    for (int n = 0; n < count; ++n)
        for (std::size_t at = 0; at < 8; at += hn::Lanes(d)) hn::Store(hn::Set(d, word), d, bits[n] + at);
}

#if HWY_TARGET <= HWY_AVX3
using WordLanes = hn::CappedTag<std::uint64_t, 8>;
using WordVectors = hn::Vec<WordLanes>[8];

// Transposes 8 x 8 words. Each turn moves the lowest bit of a lane's number to the top of its vector's.
HWY_INLINE void transpose_words(WordVectors& v) {
    const WordLanes d;
    for (int turn = 0; turn < 3; ++turn) {
        WordVectors out;
        for (int n = 0; n < 4; ++n) {
            out[n] = hn::ConcatEven(d, v[2 * n + 1], v[2 * n]);
            out[n + 4] = hn::ConcatOdd(d, v[2 * n + 1], v[2 * n]);
        }
        std::copy_n(out, 8, v);
    }
}

// Transposes bytes: of 8 vectors of the words q = 0 .. 7, byte j of word q of vector i comes to byte i of lane
// 2 (q / 2) + j % 2 of vector 4 (q % 2) + j / 2.
HWY_INLINE void mirror_bytes(WordVectors& v) {
    const WordLanes d;
    const hn::Repartition<std::uint8_t, WordLanes> d8;
    const auto lower = [&](auto a, auto b) HWY_ATTR {
        return hn::BitCast(d, hn::InterleaveLower(d8, hn::BitCast(d8, a), hn::BitCast(d8, b)));
    };
    const auto upper = [&](auto a, auto b) HWY_ATTR {
        return hn::BitCast(d, hn::InterleaveUpper(d8, hn::BitCast(d8, a), hn::BitCast(d8, b)));
    };
    WordVectors half;  // 4 of the even words, 4 of the odd
    for (int i = 0; i < 4; ++i) {
        half[i] = lower(v[i], v[i + 4]);
        half[i + 4] = upper(v[i], v[i + 4]);
    }
    for (int odd : {0, 4}) {
        const auto a = lower(half[odd], half[odd + 2]), b = lower(half[odd + 1], half[odd + 3]);
        const auto c = upper(half[odd], half[odd + 2]), e = upper(half[odd + 1], half[odd + 3]);
        v[odd] = lower(a, b);
        v[odd + 1] = upper(a, b);
        v[odd + 2] = lower(c, e);
        v[odd + 3] = upper(c, e);
    }
}

// Collects the cells of all blocks of the segment that are set in a plane now.
inline HWY_NOINLINE void collect_cells(const Segment& g, const std::uint64_t* plane, CellBits* cells) {
    const WordLanes d;
    const auto of_segment = hn::FirstN(d, std::size_t(g.blocks + 7) / 8);
    alignas(64) std::uint64_t by_word[8][8][8];  // word of the segment's rows, y, z
    for (std::size_t y = 0; y < 8; ++y) {
        WordVectors v;
        for (std::size_t z = 0; z < 8; ++z) {
            const std::ptrdiff_t at = g.row_word[y + 8 * z];
            v[z] = at < 0 ? hn::Zero(d) : hn::MaskedLoad(of_segment, d, plane + g.bx0 / 8 + at);
        }
        transpose_words(v);
        for (int word = 0; word < 8; ++word) hn::Store(v[word], d, by_word[word][y]);
    }
    for (int word = 0; 8 * word < g.blocks; ++word) {
        WordVectors v;
        for (int y = 0; y < 8; ++y) v[y] = hn::Load(d, by_word[word][y]);
        mirror_bytes(v);
        for (int pair = 0; pair < 4; ++pair) {
            CellBits* const to = cells + 8 * word + 2 * pair;
            hn::Store(hn::InterleaveLower(d, v[pair], v[pair + 4]), d, to[0]);
            hn::Store(hn::InterleaveUpper(d, v[pair], v[pair + 4]), d, to[1]);
        }
    }
}

// Returns the cells of a block that are cld now: only these can be extinguished.
inline const CellBits& cloud_of_block(const Segment& g, int block, BirthScratch& s) {
    if (s.known_cloud == 0) collect_cells(g, g.planes.cld, s.cloud);
    s.known_cloud = ~0u;
    return s.cloud[block];
}

// Applies a draw's events of all blocks of the segment, in the order of words, to its plane.
inline HWY_NOINLINE void apply_bits(const Segment& g, int draw, const CellBits* events) {
    const WordLanes d;
    const int words = (g.blocks + 7) / 8;
    const auto of_segment = hn::FirstN(d, std::size_t(words));
    const int cells_left = g.planes.extent.x - (g.bx0 + 8 * (words - 1)) * kBlockEdge;
    HWY_ALIGN std::uint64_t inside[8];
    std::fill_n(inside, 8, ~std::uint64_t{0});
    if (cells_left < 64) inside[words - 1] = (std::uint64_t{1} << cells_left) - 1;
    const auto valid = hn::Load(d, inside);
    alignas(64) std::uint64_t mirrored[8][8][8];  // word of the rows, vector, lane
    for (int word = 0; word < words; ++word) {
        WordVectors v;
        for (int block = 0; block < 8; ++block) v[block] = hn::Load(d, events[8 * word + block]);
        mirror_bytes(v);
        for (int n = 0; n < 8; ++n) hn::Store(v[n], d, mirrored[word][n]);
    }
    std::uint64_t* const plane = (draw == kHum ? g.planes.hum : draw == kAct ? g.planes.act_next : g.planes.cld) + g.bx0 / 8;
    for (int n = 0; n < 8; ++n) {
        WordVectors v;
        for (int word = 0; word < 8; ++word) v[word] = word < words ? hn::Load(d, mirrored[word][n]) : hn::Zero(d);
        transpose_words(v);
        for (int lane = 0; lane < 8; ++lane) {
            const int row = row_of(BitOrder::words, lane / 2 * 2 + n / 4, n % 4 * 2 + lane % 2);
            const std::ptrdiff_t at = g.row_word[std::size_t(row)];
            if (at < 0) continue;
            const auto cells = hn::MaskedLoad(of_segment, d, plane + at), happens = hn::And(v[lane], valid);
            hn::BlendedStore(draw == kExt ? hn::AndNot(happens, cells) : hn::Or(cells, happens), of_segment, d, plane + at);
        }
    }
}
#else
// Exchanges, in every group of 2 * kShift bits, the upper half of a with the lower half of b.
template <int kShift, class D, class V = hn::Vec<D>>
HWY_INLINE void exchange(D d, std::uint64_t low_mask, V& a, V& b) {
    const V t = hn::And(hn::Xor(hn::ShiftRight<kShift>(a), b), hn::Set(d, low_mask));
    b = hn::Xor(b, t);
    a = hn::Xor(a, hn::ShiftLeft<kShift>(t));
}

// Transposes bytes: byte i of out[j][word] = byte j of in[i][word], for 8 words.
HWY_INLINE void mirror_bytes(const CellBits* HWY_RESTRICT in, CellBits* HWY_RESTRICT out) {
    const hn::CappedTag<std::uint64_t, 8> d;
    for (std::size_t word = 0; word < 8; word += hn::Lanes(d)) {
        hn::Vec<decltype(d)> v[8];
        for (int i = 0; i < 8; ++i) v[i] = hn::LoadU(d, in[i] + word);
        for (int i : {0, 1, 2, 3}) exchange<32>(d, 0x00000000FFFFFFFFu, v[i], v[i + 4]);
        for (int i : {0, 1, 4, 5}) exchange<16>(d, 0x0000FFFF0000FFFFu, v[i], v[i + 2]);
        for (int i : {0, 2, 4, 6}) exchange<8>(d, 0x00FF00FF00FF00FFu, v[i], v[i + 1]);
        for (int i = 0; i < 8; ++i) hn::StoreU(v[i], d, out[i] + word);
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

// Applies a draw's events of all blocks of the segment, in the order of words, to its plane.
inline HWY_NOINLINE void apply_bits(const Segment& g, int draw, const CellBits* events) {
    const int last_word = (g.blocks + 7) / 8 - 1;
    const int cells_left = g.planes.extent.x - (g.bx0 + 8 * last_word) * kBlockEdge;
    const std::uint64_t last = cells_left >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << cells_left) - 1;
    std::uint64_t* const plane = draw == kHum ? g.planes.hum : draw == kAct ? g.planes.act_next : g.planes.cld;
    for (int word = 0; word <= last_word; ++word) {
        const std::uint64_t valid = word == last_word ? last : ~std::uint64_t{0};
        alignas(64) CellBits rows[8];
        mirror_bytes(events + 8 * word, rows);
        for (int n = 0; n < 64; ++n) {
            const std::ptrdiff_t at = g.row_word[std::size_t(row_of(BitOrder::words, n / 8, n % 8))];
            if (at < 0) continue;
            std::uint64_t& cells = plane[at + g.bx0 / 8 + word];
            const std::uint64_t happens = rows[n % 8][n / 8] & valid;
            cells = (cells | happens) ^ (draw == kExt ? happens : 0);
        }
    }
}
#endif

// Returns the place of the set bit of a word that has `rank` set bits below it.
HWY_INLINE std::uint32_t place_in_word(std::uint64_t word, int rank) {
#if HWY_ARCH_X86_64 && HWY_TARGET <= HWY_AVX2 && !defined(HWY_DISABLE_BMI2_FMA)
    return std::uint32_t(std::countr_zero(_pdep_u64(std::uint64_t{1} << rank, word)));
#else
    for (; rank > 0; --rank) word &= word - 1;
    return std::uint32_t(std::countr_zero(word));
#endif
}

// Returns the number of cells of a block that are set.
HWY_INLINE int count_bits(const CellBits& bits) {
    int count = 0;
    for (std::uint64_t word : bits) count += std::popcount(word);
    return count;
}

// Returns the place of the set bit of a block that has `rank` set bits below it, of which below[w] are in words before w; there
// must be one.
HWY_INLINE std::uint32_t set_bit(const CellBits& bits, const int (&below)[8], int rank) {
    int word = 0;
    for (int next = 1; next < 8; ++next) word += int{below[next] <= rank};
    return std::uint32_t(64 * word) + place_in_word(bits[word], rank - below[word]);
}

// Brings bits from the order of layers to that of words: of 16 rows those with even numbers are in one word, those with odd
// numbers in the next.
inline void in_order_of_words(const CellBits& layers, CellBits& words) {
    const auto* const rows = reinterpret_cast<const std::uint8_t*>(&layers[0]);
    auto* const to = reinterpret_cast<std::uint8_t*>(&words[0]);
#if HWY_TARGET == HWY_SCALAR
    for (int n = 0; n < 64; ++n) to[n] = rows[row_of(BitOrder::words, n / 8, n % 8)];
#else
    const hn::CappedTag<std::uint8_t, 64> d;
    alignas(16) constexpr std::uint8_t kEvenThenOdd[16] = {0, 2, 4, 6, 8, 10, 12, 14, 1, 3, 5, 7, 9, 11, 13, 15};
    for (std::size_t n = 0; n < 64; n += hn::Lanes(d))
        hn::StoreU(hn::TableLookupBytes(hn::LoadU(d, rows + n), hn::LoadDup128(d, kEvenThenOdd)), d, to + n);
#endif
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
