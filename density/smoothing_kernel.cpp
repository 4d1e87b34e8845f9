// SPDX-License-Identifier: Apache-2.0
#include "density/smoothing_kernel.h"

#include <algorithm>
#include <cstring>

// Machines without AVX2 run the portable form: rare by now, and every target costs seconds to compile.
#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "density/smoothing_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/aligned_allocator.h>
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr int kWord = 64;  // cells per word
constexpr int kMaxRadius = 16;

// Vectors of at most one word's cells, so that a word is a whole number of them.
template <class T>
using Tag = hn::CappedTag<T, kWord>;

// out[n] = sum over d of weights[d] * lines[d][n]; weights are symmetric; kUnit: all 1. kRadius < 0:
// `radius`.
template <class T, bool kUnit, int kRadius>
HWY_INLINE void weighted_sum_of(const T* const* lines, const T* weights, int radius, int count,
                                T* HWY_RESTRICT out) {
    const Tag<T> d;
    const int r = kRadius < 0 ? radius : kRadius;
    for (int n = 0; n < count; n += int(hn::Lanes(d))) {
        auto sum = hn::LoadU(d, lines[r] + n);
        if constexpr (!kUnit) sum = hn::Mul(sum, hn::Set(d, weights[r]));
        for (int m = 1; m <= r; ++m) {
            auto pair = hn::Add(hn::LoadU(d, lines[r - m] + n), hn::LoadU(d, lines[r + m] + n));
            if constexpr (!kUnit) pair = hn::Mul(pair, hn::Set(d, weights[r - m]));
            sum = hn::Add(sum, pair);
        }
        hn::StoreU(sum, d, out + n);
    }
}

template <class T, bool kUnit>
void weighted_sum(const T* const* lines, const std::vector<T>& weights, int count, T* out) {
    const int radius = int(weights.size()) / 2;
    const T* w = weights.data();
    switch (radius) {
        case 0:
            return weighted_sum_of<T, kUnit, 0>(lines, w, 0, count, out);
        case 1:
            return weighted_sum_of<T, kUnit, 1>(lines, w, 1, count, out);
        case 2:
            return weighted_sum_of<T, kUnit, 2>(lines, w, 2, count, out);
        default:
            return weighted_sum_of<T, kUnit, -1>(lines, w, radius, count, out);
    }
}

// values[n] += weight where bit n of `bits` is 1.
template <class T>
HWY_INLINE void add_bits(const std::uint8_t* bits, int count, T weight, T* HWY_RESTRICT values) {
    if constexpr (sizeof(T) == 8) {
        for (int n = 0; n < count; ++n) values[n] += (bits[n / 8] >> (n % 8) & 1) ? weight : T{0};
    } else {
        const Tag<T> d;
        const int lanes = int(hn::Lanes(d));
        const auto w = hn::Set(d, weight);
        for (int n = 0; n < count; n += lanes) {
            // LoadMaskBits starts at bit 0 of a byte, so vectors below 8 lanes need theirs moved there.
            std::uint8_t moved[8] = {};
            const std::uint8_t* at = bits + n / 8;
            if (lanes < 8) {
                moved[0] = std::uint8_t(*at >> (n % 8));
                at = moved;
            }
            const auto mask = hn::LoadMaskBits(d, at);
            hn::StoreU(hn::Add(hn::LoadU(d, values + n), hn::IfThenElseZero(mask, w)), d, values + n);
        }
    }
}

// min(1, float(sum) * reciprocal) for `count` sums. count is a multiple of 64.
template <class T, bool kStream>
HWY_INLINE void to_floats(const T* HWY_RESTRICT sums, int count, float reciprocal, float* HWY_RESTRICT out) {
    const hn::CappedTag<float, sizeof(T) == 8 ? Tag<double>::kPrivateN : std::size_t{kWord}> d;
    const hn::Rebind<std::int32_t, decltype(d)> di;
    const auto scale = hn::Set(d, reciprocal);
    const auto one = hn::Set(d, 1.0f);
    for (int n = 0; n < count; n += int(hn::Lanes(d))) {
        const hn::Rebind<T, decltype(d)> dt;
        const auto sum = hn::LoadU(dt, sums + n);
        auto value = hn::Zero(d);
        if constexpr (sizeof(T) == 8) {
            value = hn::DemoteTo(d, sum);
        } else if constexpr (sizeof(T) == 4) {
            value = hn::ConvertTo(d, hn::BitCast(di, sum));  // sums are below 2^31
        } else {
            value = hn::ConvertTo(d, hn::PromoteTo(di, sum));
        }
        value = hn::Min(hn::Mul(value, scale), one);
        if constexpr (kStream) {
            hn::Stream(value, d, out + n);
        } else {
            hn::StoreU(value, d, out + n);
        }
    }
}

// Transposes one 8x8x8 block of S rows, s[z][y][x], to OpenVDB's order, block[x][y][z].
template <class T>
HWY_INLINE void transpose_block(const T* s, std::size_t stride_y, std::size_t stride_z,
                                T* HWY_RESTRICT block) {
    for (int z = 0; z < 8; ++z) {
        for (int y = 0; y < 8; ++y) {
            const T* row = s + std::size_t(z) * stride_z + std::size_t(y) * stride_y;
            for (int x = 0; x < 8; ++x) block[x * 64 + y * 8 + z] = row[x];
        }
    }
}

#if HWY_TARGET != HWY_SCALAR
// The narrow types in vectors: three rounds of interleaving turn 8 rows of z into 8 rows of x.
HWY_INLINE void transpose_block(const std::uint8_t* s, std::size_t stride_y, std::size_t stride_z,
                                std::uint8_t* HWY_RESTRICT block) {
    const hn::FixedTag<std::uint8_t, 8> d8;
    const hn::FixedTag<std::uint8_t, 16> d;
    const hn::FixedTag<std::uint16_t, 8> d16;
    const hn::FixedTag<std::uint32_t, 4> d32;
    for (int y = 0; y < 8; ++y) {
        const auto pair = [&](int z) {  // x0 z, x0 z+1, x1 z, x1 z+1 ...
            const std::uint8_t* row = s + std::size_t(z) * stride_z + std::size_t(y) * stride_y;
            const auto a = hn::ZeroExtendVector(d, hn::LoadU(d8, row));
            const auto b = hn::ZeroExtendVector(d, hn::LoadU(d8, row + stride_z));
            return hn::BitCast(d16, hn::InterleaveLower(d, a, b));
        };
        const auto z01 = pair(0), z23 = pair(2), z45 = pair(4), z67 = pair(6);
        const auto lower = hn::BitCast(d32, hn::InterleaveLower(d16, z01, z23));   // x 0..3, z 0..3
        const auto upper = hn::BitCast(d32, hn::InterleaveUpper(d16, z01, z23));   // x 4..7, z 0..3
        const auto lower4 = hn::BitCast(d32, hn::InterleaveLower(d16, z45, z67));  // x 0..3, z 4..7
        const auto upper4 = hn::BitCast(d32, hn::InterleaveUpper(d16, z45, z67));  // x 4..7, z 4..7
        const auto store = [&](int x, auto v) {
            const auto bytes = hn::BitCast(d, v);
            hn::StoreU(hn::LowerHalf(d8, bytes), d8, block + x * 64 + y * 8);
            hn::StoreU(hn::UpperHalf(d8, bytes), d8, block + (x + 1) * 64 + y * 8);
        };
        store(0, hn::InterleaveLower(d32, lower, lower4));
        store(2, hn::InterleaveUpper(d32, lower, lower4));
        store(4, hn::InterleaveLower(d32, upper, upper4));
        store(6, hn::InterleaveUpper(d32, upper, upper4));
    }
}

HWY_INLINE void transpose_block(const std::uint16_t* s, std::size_t stride_y, std::size_t stride_z,
                                std::uint16_t* HWY_RESTRICT block) {
    const hn::FixedTag<std::uint16_t, 8> d;
    const hn::FixedTag<std::uint32_t, 4> d32;
    const hn::FixedTag<std::uint64_t, 2> d64;
    for (int y = 0; y < 8; ++y) {
        const auto row = [&](int z) {
            return hn::LoadU(d, s + std::size_t(z) * stride_z + std::size_t(y) * stride_y);
        };
        // x 4h .. 4h+3 with z and z+1, as 32-bit pairs.
        const auto half = [&](int z, bool high) {
            const auto a = row(z), b = row(z + 1);
            return hn::BitCast(d32, high ? hn::InterleaveUpper(d, a, b) : hn::InterleaveLower(d, a, b));
        };
        for (int h = 0; h < 2; ++h) {
            const auto z01 = half(0, h != 0), z23 = half(2, h != 0), z45 = half(4, h != 0),
                       z67 = half(6, h != 0);
            const auto a = hn::BitCast(d64, hn::InterleaveLower(d32, z01, z23));   // x 0, 1; z 0..3
            const auto b = hn::BitCast(d64, hn::InterleaveUpper(d32, z01, z23));   // x 2, 3; z 0..3
            const auto a4 = hn::BitCast(d64, hn::InterleaveLower(d32, z45, z67));  // x 0, 1; z 4..7
            const auto b4 = hn::BitCast(d64, hn::InterleaveUpper(d32, z45, z67));  // x 2, 3; z 4..7
            std::uint16_t* out = block + h * 4 * 64 + y * 8;
            hn::StoreU(hn::BitCast(d, hn::InterleaveLower(d64, a, a4)), d, out);
            hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(d64, a, a4)), d, out + 64);
            hn::StoreU(hn::BitCast(d, hn::InterleaveLower(d64, b, b4)), d, out + 128);
            hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(d64, b, b4)), d, out + 192);
        }
    }
}
#endif

// mask: where block[n] is not 0. Returns whether all 512 are `total`.
template <class T>
HWY_INLINE bool classify_block(const T* block, T total, std::uint64_t (&mask)[8]) {
    if constexpr (HWY_TARGET != HWY_SCALAR && sizeof(T) <= 2) {  // whole bytes of mask
        const Tag<T> d;
        const int lanes = int(hn::Lanes(d));
        auto least = hn::Set(d, total);
        auto* bytes = reinterpret_cast<std::uint8_t*>(mask);
        for (int n = 0; n < 512; n += lanes) {
            const auto v = hn::LoadU(d, block + n);
            least = hn::Min(least, v);
            hn::StoreMaskBits(d, hn::Ne(v, hn::Zero(d)), bytes + n / 8);
        }
        return hn::AllTrue(d, hn::Eq(least, hn::Set(d, total)));
    } else {
        bool full = true;
        for (int word = 0; word < 8; ++word) {
            mask[word] = 0;
            for (int bit = 0; bit < 64; ++bit) {
                const T v = block[word * 64 + bit];
                mask[word] |= std::uint64_t(v != T{0}) << bit;
                full = full && v == total;
            }
        }
        return full;
    }
}

template <class T>
bool block_is_zero(const T* s, std::size_t stride_y, std::size_t stride_z) {
    constexpr int kParts = sizeof(T);  // 8 * sizeof(T) bytes in 8-byte parts
    std::uint64_t any = 0;
    for (int z = 0; z < 8; ++z) {
        for (int y = 0; y < 8; ++y) {
            std::uint64_t parts[kParts];
            std::memcpy(parts, s + std::size_t(z) * stride_z + std::size_t(y) * stride_y, sizeof(parts));
            for (std::uint64_t part : parts) any |= part;
        }
    }
    return any == 0;
}

template <class T>
std::vector<T> as(const std::vector<std::uint32_t>& weights) {
    return std::vector<T>(weights.begin(), weights.end());
}

// One tile on its way up. T is the type of the sums; kUnit: every weight is 1.
template <class T, bool kUnit>
class TilePass {
  public:
    TilePass(const SmoothingPlan& plan, const SmoothingTile& tile)
        : plan_(plan),
          tile_(tile),
          wx_(as<T>(plan.wx)),
          wy_(as<T>(plan.wy)),
          wz_(as<T>(plan.wz)),
          i0_(int(wx_.size()) / 2),
          j0_(int(wy_.size()) / 2),
          k0_(int(wz_.size()) / 2),
          width_(tile.words * kWord),
          slots_(8 + 2 * k0_) {
        const std::size_t row = std::size_t(width_);
        const std::size_t plane = row * std::size_t(tile.rows);
        x_rows_ = hwy::AllocateAligned<T>(row * std::size_t(tile.rows + 2 * j0_));
        ring_ = hwy::AllocateAligned<T>(plane * std::size_t(slots_));
        zero_ = hwy::AllocateAligned<T>(row);
        expanded_ = hwy::AllocateAligned<T>(row + 2 * kWord);
        std::fill_n(zero_.get(), row, T{0});
        ring_empty_.assign(std::size_t(slots_), true);
    }

    // S rows of `levels` cells of height from z on, s[level][row][x]; rows and cells beyond the extent are 0.
    // Returns false, leaving `s` alone, when all of them are 0.
    bool sums(int z, int levels, T* s) {
        const int last = z + levels + k0_;  // planes z - k0 .. last - 1
        for (next_ = std::max(next_, z - k0_); next_ < last; ++next_) fill_slot(next_);
        bool any = false;
        for (int k = z - k0_; k < last; ++k) any = any || !ring_empty_[slot(k)];
        if (!any) return false;
        for (int level = 0; level < levels; ++level)
            sum_level(z + level, s + std::size_t(level) * plane_size());
        return true;
    }

    int width() const { return width_; }
    std::size_t plane_size() const { return std::size_t(width_) * std::size_t(tile_.rows); }

  private:
    std::size_t slot(int k) const { return std::size_t((k + k0_) % slots_); }

    // The index that cell `n` of an axis of `size` cells has inside the box, or -1 when it reads as 0.
    static int source(int n, int size, Boundary boundary) {
        if (n >= 0 && n < size) return n;
        if (boundary == Boundary::open) return -1;
        const int wrapped = n % size;
        return wrapped < 0 ? wrapped + size : wrapped;
    }

    // Words first_word - 1 .. first_word + words of row (j, k) of a plane, with what lies beyond the box's
    // ends in x. Returns whether a bit that the tile needs may be 1.
    bool load_bits(const BitPlaneView& plane, int j, int k, std::uint64_t* bits) const {
        const std::uint64_t* row = plane.row(j, k);
        const int words_per_row = int(plane.words_per_row);
        std::uint64_t any = 0;
        for (int m = 0; m < tile_.words + 2; ++m) {
            const int word = tile_.first_word - 1 + m;
            bits[m] = word >= 0 && word < words_per_row ? row[word] : 0;
            any |= bits[m];
        }
        if (plan_.boundaries.x == Boundary::periodic) any |= wrap_ends(row, bits);
        return any != 0;
    }

    std::uint64_t wrap_ends(const std::uint64_t* row, std::uint64_t* bits) const {
        const int nx = plan_.extent.x;
        const int first = (tile_.first_word - 1) * kWord;  // cell of bit 0
        const int end = first + (tile_.words + 2) * kWord;
        std::uint64_t any = 0;
        const auto wrap = [&](int cell) {
            if (cell < first || cell >= end) return;
            const int from = source(cell, nx, Boundary::periodic);
            const std::uint64_t bit = row[from / kWord] >> (from % kWord) & 1;
            bits[(cell - first) / kWord] |= bit << ((cell - first) % kWord);
            any |= bit;
        };
        for (int n = 1; n <= i0_; ++n) {
            wrap(-n);
            wrap(nx - 1 + n);
        }
        return any;
    }

    // The X row of source row (j, k): expand, sum over t', sum over i'. Returns false when it is all 0.
    bool x_row(int j, int k, T* out) {
        const Tag<T> d;
        // Around the tile only whole vectors and whole bytes of bits are expanded.
        const int step = std::max(8, int(hn::Lanes(d)));
        const int from = kWord - (i0_ + step - 1) / step * step;
        const int count = width_ + 2 * (kWord - from);
        bool any = false;
        for (std::size_t n = 0; n < plan_.planes.size(); ++n) {
            std::uint64_t bits[kMaxWords + 2];
            if (!load_bits(plan_.planes[n], j, k, bits)) continue;
            if (!any) std::fill_n(expanded_.get() + from, count, T{0});
            any = true;
            add_bits(reinterpret_cast<const std::uint8_t*>(bits) + from / 8, count, T(plan_.plane_weights[n]),
                     expanded_.get() + from);
        }
        if (!any) return false;
        const T* lines[2 * kMaxRadius + 1];
        for (int m = -i0_; m <= i0_; ++m) lines[m + i0_] = expanded_.get() + kWord + m;
        weighted_sum<T, kUnit>(lines, wx_, width_, out);
        return true;
    }

    // The Y plane of level k (which may lie beyond the box) into its place in the ring.
    void fill_slot(int k) {
        bool empty = true;
        const int from = source(k, plan_.extent.z, plan_.boundaries.z);
        const int row_count = tile_.rows + 2 * j0_;
        const T* lines[kMaxRows + 2 * kMaxRadius];
        if (from >= 0) {
            for (int n = 0; n < row_count; ++n) {
                lines[n] = zero_.get();
                const int j = source(tile_.first_row + n - j0_, plan_.extent.y, plan_.boundaries.y);
                T* row = x_rows_.get() + std::size_t(n) * std::size_t(width_);
                if (j < 0 || !x_row(j, from, row)) continue;
                lines[n] = row;
                empty = false;
            }
        }
        ring_empty_[slot(k)] = empty;
        if (empty) return;
        T* plane = ring_.get() + slot(k) * plane_size();
        const int rows = std::min(tile_.rows, plan_.extent.y - tile_.first_row);
        for (int n = 0; n < rows; ++n) {
            weighted_sum<T, kUnit>(lines + n, wy_, width_, plane + std::size_t(n) * std::size_t(width_));
        }
    }

    void sum_level(int k, T* s) const {
        if (k >= plan_.extent.z) {
            std::fill_n(s, plane_size(), T{0});
            return;
        }
        const int rows = std::min(tile_.rows, plan_.extent.y - tile_.first_row);
        const int cells = std::min(width_, plan_.extent.x - tile_.first_word * kWord);
        for (int n = 0; n < tile_.rows; ++n) {
            const std::size_t at = std::size_t(n) * std::size_t(width_);
            if (n >= rows) {
                std::fill_n(s + at, width_, T{0});
                continue;
            }
            const T* lines[2 * kMaxRadius + 1];
            for (int m = -k0_; m <= k0_; ++m) {
                const std::size_t p = slot(k + m);
                lines[m + k0_] = ring_empty_[p] ? zero_.get() : ring_.get() + p * plane_size() + at;
            }
            weighted_sum<T, kUnit>(lines, wz_, width_, s + at);
            if (cells < width_) std::fill(s + at + cells, s + at + width_, T{0});
        }
    }

    const SmoothingPlan& plan_;
    const SmoothingTile tile_;
    const std::vector<T> wx_, wy_, wz_;
    const int i0_, j0_, k0_;
    const int width_;  // cells in a row
    const int slots_;
    int next_ = -kMaxRadius;  // first level whose slot is not filled
    hwy::AlignedFreeUniquePtr<T[]> x_rows_, ring_, zero_, expanded_;
    std::vector<bool> ring_empty_;  // the plane in the slot is all 0; its memory is then undefined
};

template <class T, bool kUnit>
void blocks_of_tile(const SmoothingPlan& plan, const SmoothingTile& tile, BlockSink& sink) {
    TilePass<T, kUnit> pass(plan, tile);
    const std::size_t stride_y = std::size_t(pass.width()), stride_z = pass.plane_size();
    const auto s = hwy::AllocateAligned<T>(8 * stride_z);
    HWY_ALIGN T block[512];
    for (int z = 0; z < plan.extent.z; z += 8) {
        if (!pass.sums(z, 8, s.get())) continue;
        for (int y = 0; y < tile.rows; y += 8) {
            for (int x = 0; x < pass.width(); x += 8) {
                const T* corner = s.get() + std::size_t(y) * stride_y + x;
                if (block_is_zero(corner, stride_y, stride_z)) continue;
                transpose_block(corner, stride_y, stride_z, block);
                std::uint64_t mask[8];
                const bool full = classify_block(block, T(plan.total), mask);
                const int cell_x = tile.first_word * kWord + x, cell_y = tile.first_row + y;
                if (full) {
                    sink.saturated_block(cell_x, cell_y, z);
                } else {
                    to_floats<T, false>(block, 512, plan.reciprocal, sink.begin_block(cell_x, cell_y, z));
                    sink.end_block(mask);
                }
            }
        }
    }
}

// The first `count` floats of a row.
template <class T>
void write_row(const T* sums, int width, int count, float reciprocal, bool stream, float* out) {
    const hn::ScalableTag<float> d;
    if (count == width) {
        if (stream && reinterpret_cast<std::uintptr_t>(out) % (hn::Lanes(d) * sizeof(float)) == 0) {
            to_floats<T, true>(sums, width, reciprocal, out);
        } else {
            to_floats<T, false>(sums, width, reciprocal, out);
        }
        return;
    }
    HWY_ALIGN float row[kMaxWords * kWord];
    to_floats<T, false>(sums, width, reciprocal, row);
    std::copy_n(row, count, out);
}

template <class T, bool kUnit>
void rows_of_tile(const SmoothingPlan& plan, const SmoothingTile& tile, float* out, bool stream) {
    TilePass<T, kUnit> pass(plan, tile);
    const auto s = hwy::AllocateAligned<T>(pass.plane_size());
    const int first_cell = tile.first_word * kWord;
    const int cells = std::min(pass.width(), plan.extent.x - first_cell);
    const int rows = std::min(tile.rows, plan.extent.y - tile.first_row);
    for (int z = 0; z < plan.extent.z; ++z) {
        if (!pass.sums(z, 1, s.get())) std::fill_n(s.get(), pass.plane_size(), T{0});
        for (int n = 0; n < rows; ++n) {
            write_row(s.get() + std::size_t(n) * std::size_t(pass.width()), pass.width(), cells,
                      plan.reciprocal, stream,
                      out + linear_index(plan.extent, first_cell, tile.first_row + n, z));
        }
    }
    if (stream) hwy::FlushStream();
}

}  // namespace

void tile_to_blocks(const SmoothingPlan& plan, const SmoothingTile& tile, BlockSink& sink) {
    switch (plan.type) {
        case SumType::u8:
            return blocks_of_tile<std::uint8_t, true>(plan, tile, sink);
        case SumType::u16:
            return blocks_of_tile<std::uint16_t, false>(plan, tile, sink);
        case SumType::u32:
            return blocks_of_tile<std::uint32_t, false>(plan, tile, sink);
        case SumType::f64:
            return blocks_of_tile<double, false>(plan, tile, sink);
    }
}

void tile_to_rows(const SmoothingPlan& plan, const SmoothingTile& tile, float* out, bool stream) {
    switch (plan.type) {
        case SumType::u8:
            return rows_of_tile<std::uint8_t, true>(plan, tile, out, stream);
        case SumType::u16:
            return rows_of_tile<std::uint16_t, false>(plan, tile, out, stream);
        case SumType::u32:
            return rows_of_tile<std::uint32_t, false>(plan, tile, out, stream);
        case SumType::f64:
            return rows_of_tile<double, false>(plan, tile, out, stream);
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(tile_to_blocks);
HWY_EXPORT(tile_to_rows);

void smooth_tile(const SmoothingPlan& plan, const SmoothingTile& tile, BlockSink& sink) {
    HWY_DYNAMIC_DISPATCH(tile_to_blocks)(plan, tile, sink);
}

void smooth_tile(const SmoothingPlan& plan, const SmoothingTile& tile, float* out, bool stream) {
    HWY_DYNAMIC_DISPATCH(tile_to_rows)(plan, tile, out, stream);
}

}  // namespace nephos
#endif
