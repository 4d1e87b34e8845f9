// SPDX-License-Identifier: Apache-2.0
#include "density/smoothing_kernel.h"

#include <algorithm>
#include <cstring>
#include <new>

// Machines without AVX2 run the portable form: rare by now, and every target costs seconds to compile.
#if defined(__OPTIMIZE__) && !defined(HWY_DISABLED_TARGETS)  // with -O0 as all files (docs/determinism.md)
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4)
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "density/smoothing_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/aligned_allocator.h>
#include <hwy/highway.h>

#include "density/smoothing_blocks-inl.h"
#include "density/smoothing_vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {
namespace {

constexpr int kMaxRadius = 16;
constexpr int kLag = 8;  // rows between a row's expansion and its sum

// hwy::AllocateAligned() returns null where there is no memory.
template <class T>
hwy::AlignedFreeUniquePtr<T[]> aligned(std::size_t count) {
    auto memory = hwy::AllocateAligned<T>(count);
    if (memory == nullptr) throw std::bad_alloc();
    return memory;
}

template <class T>
std::vector<T> as(const std::vector<std::uint32_t>& weights) {
    return std::vector<T>(weights.begin(), weights.end());
}

// The state of one tile while its planes are processed from bottom to top. T is the type of the sums; kUnit:
// every weight is 1. Rows are processed in groups of 8.
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
          groups_(tile.rows / 8),
          slots_(8 + 2 * k0_),
          next_(-k0_) {
        x_rows_ = aligned<T>(std::size_t(width_) * std::size_t(tile.rows + 2 * j0_));
        expanded_ = aligned<T>(kLag * std::size_t(width_ + 2 * kWord));
        ring_ = aligned<T>(plane_size() * std::size_t(slots_));
        zero_ = aligned<T>(group_size());
        std::fill_n(zero_.get(), group_size(), T{0});
        full_.assign(std::size_t(slots_ * groups_), 0);
    }

    int width() const { return width_; }
    int groups() const { return groups_; }
    std::size_t group_size() const { return 8 * std::size_t(width_); }

    // Makes the levels below `end` ready; at most 8 of them are asked for before the next call.
    void advance(int end) {
        for (; next_ < end + k0_; ++next_) fill_plane();
    }

    // The 8 S rows of a group at level k, s[row][x]; rows and cells beyond the extent are 0. Returns false,
    // leaving `s` alone, when all of them are 0.
    bool sum_group(int k, int group, T* s) const {
        if (k >= plan_.extent.z) return false;
        const T* lines[2 * kMaxRadius + 1];
        bool any = false;
        for (int m = -k0_; m <= k0_; ++m) {
            const std::size_t p = slot(k + m);
            const bool full = full_[p * std::size_t(groups_) + std::size_t(group)] != 0;
            lines[m + k0_] =
                full ? ring_.get() + p * plane_size() + std::size_t(group) * group_size() : zero_.get();
            any = any || full;
        }
        if (any) weighted_sum<T, kUnit>(lines, wz_, int(group_size()), s);
        return any;
    }

  private:
    std::size_t plane_size() const { return group_size() * std::size_t(groups_); }
    std::size_t slot(int k) const { return std::size_t((k + k0_) % slots_); }

    // Returns the index inside the box of cell `n` of an axis of `size` cells, or -1 when it reads as 0.
    static int source(int n, int size, Boundary boundary) {
        if (n >= 0 && n < size) return n;
        if (boundary == Boundary::open) return -1;
        const int wrapped = n % size;
        return wrapped < 0 ? wrapped + size : wrapped;
    }

    // Makes the plane `next_`. A row is summed kLag steps after it was expanded: unaligned loads of what still
    // waits in the store queue would wait with it.
    void fill_plane() {
        std::uint8_t* full = &full_[slot(next_) * std::size_t(groups_)];
        std::fill_n(full, groups_, std::uint8_t{0});
        const int level = source(next_, plan_.extent.z, plan_.boundaries.z);
        const int count = tile_.rows + 2 * j0_;
        bool any_row = false;
        for (int row = 0; level >= 0 && row < count + kLag; ++row) {
            const int ready = row - kLag;
            if (ready >= 0) lines_[ready] = sum_row(lines_[ready], ready);
            if (row >= count) continue;
            const int j = source(tile_.first_row + row - j0_, plan_.extent.y, plan_.boundaries.y);
            T* expanded = expanded_.get() + std::ptrdiff_t(row % kLag) * (width_ + 2 * kWord);
            lines_[row] = j >= 0 && expand_row(j, level, expanded) ? expanded : nullptr;
            any_row = any_row || lines_[row] != nullptr;
        }
        T* plane = ring_.get() + slot(next_) * plane_size();
        for (int group = 0; any_row && group < groups_; ++group) {
            const T* const* first = lines_ + 8 * group;
            if (std::all_of(first, first + 8 + 2 * j0_, [&](const T* line) { return line == zero_.get(); }))
                continue;
            full[group] = 1;
            sum_rows(first, group, plane + std::size_t(group) * group_size());
        }
    }

    // Words first_word - 1 .. first_word + words of row (j, k) of a plane, with what lies beyond the box's
    // ends in x. Returns whether a bit that the tile needs may be 1.
    bool load_bits(const BitPlaneView& plane, int j, int k, std::uint64_t* bits) const {
        const std::uint64_t* row = plane.row(j, k) + tile_.first_word;
        const bool last = tile_.first_word + tile_.words >= int(plane.words_per_row);
        bits[0] = tile_.first_word > 0 ? row[-1] : 0;
        bits[tile_.words + 1] = last ? 0 : row[tile_.words];
        std::uint64_t any = bits[0] | bits[tile_.words + 1];
        int m = 0;
        for (; m + 4 <= tile_.words; m += 4) {
            std::memcpy(bits + m + 1, row + m, 4 * sizeof(std::uint64_t));
            any |= row[m] | row[m + 1] | row[m + 2] | row[m + 3];
        }
        for (; m < tile_.words; ++m) any |= bits[m + 1] = row[m];
        if (plan_.boundaries.x == Boundary::periodic) any |= wrap_ends(plane.row(j, k), bits);
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

    // Expands row (j, k) of all planes into `out`, summed over t'. Returns false when all of it is 0.
    bool expand_row(int j, int k, T* out) const {
        // Around the tile only whole vectors and whole bytes of bits are expanded.
        const int step = std::max(8, int(hn::Lanes(Tag<T>())));
        const int from = kWord - (i0_ + step - 1) / step * step;
        const int count = width_ + 2 * (kWord - from);
        bool any = false;
        for (std::size_t n = 0; n < plan_.planes.size(); ++n) {
            std::uint64_t bits[kMaxWords + 2];
            if (!load_bits(plan_.planes[n], j, k, bits)) continue;
            const auto* bytes = reinterpret_cast<const std::uint8_t*>(bits) + from / 8;
            const T weight = T(plan_.plane_weights[n]);
            if (any) {
                expand_bits<T, true>(bytes, count, weight, out + from);
            } else {
                expand_bits<T, false>(bytes, count, weight, out + from);
            }
            any = true;
        }
        return any;
    }

    // The X row of an expanded row, or the zero row when there is none.
    const T* sum_row(const T* expanded, int n) {
        if (expanded == nullptr) return zero_.get();
        T* out = x_rows_.get() + std::size_t(n) * std::size_t(width_);
        const T* lines[2 * kMaxRadius + 1];
        for (int m = -i0_; m <= i0_; ++m) lines[m + i0_] = expanded + kWord + m;
        weighted_sum<T, kUnit>(lines, wx_, width_, out);
        const int cells = std::min(width_, plan_.extent.x - tile_.first_word * kWord);
        std::fill(out + cells, out + width_, T{0});
        return out;
    }

    void sum_rows(const T* const* lines, int group, T* out) const {
        if constexpr (kUnit) {
            running_sums(lines, j0_, width_, out);
        } else {
            for (int n = 0; n < 8; ++n)
                weighted_sum<T, false>(lines + n, wy_, width_, out + std::ptrdiff_t(n) * width_);
        }
        const int rows = std::clamp(plan_.extent.y - tile_.first_row - 8 * group, 0, 8);
        std::fill(out + std::ptrdiff_t(rows) * width_, out + group_size(), T{0});
    }

    const SmoothingPlan& plan_;
    const SmoothingTile tile_;
    const std::vector<T> wx_, wy_, wz_;
    const int i0_, j0_, k0_;
    const int width_;   // cells in a row
    const int groups_;  // of 8 rows
    const int slots_;
    int next_;  // the plane to be filled next: a level, which may lie beyond the box
    const T* lines_[kMaxRows + 2 * kMaxRadius];
    hwy::AlignedFreeUniquePtr<T[]> x_rows_, expanded_, ring_, zero_;
    std::vector<std::uint8_t>
        full_;  // [slot][group]: 0 when the group is all 0; its memory is then undefined
};

// One 8x8x8 block of S rows to the sink.
template <class T>
HWY_INLINE void emit_block(const SmoothingPlan& plan, const T* s, std::size_t width, int x, int y, int z,
                           BlockSink& sink) {
    const std::size_t stride_z = 8 * width;
    if (block_is_zero(s, width, stride_z)) return;
    HWY_ALIGN T block[512];
    transpose_block(s, width, stride_z, block);
    std::uint64_t mask[8];
    if (classify_block(block, T(plan.total), mask)) {
        sink.saturated_block(x, y, z);
    } else {
        block_to_floats(block, plan.reciprocal, sink.begin_block(x, y, z));
        sink.end_block(mask);
    }
}

template <class T, bool kUnit>
void blocks_of_tile(const SmoothingPlan& plan, const SmoothingTile& tile, BlockSink& sink) {
    TilePass<T, kUnit> pass(plan, tile);
    const std::size_t width = std::size_t(pass.width());
    const auto s = aligned<T>(8 * pass.group_size());
    for (int z = 0; z < plan.extent.z; z += 8) {
        pass.advance(z + 8);
        for (int group = 0; group < pass.groups(); ++group) {
            bool any = false;
            for (int level = 0; level < 8; ++level) {
                T* rows = s.get() + std::size_t(level) * pass.group_size();
                if (pass.sum_group(z + level, group, rows)) {
                    any = true;
                } else {
                    std::fill_n(rows, pass.group_size(), T{0});
                }
            }
            for (std::size_t x = 0; any && x < width; x += 8) {
                emit_block(plan, s.get() + x, width, tile.first_word * kWord + int(x),
                           tile.first_row + 8 * group, z, sink);
            }
        }
    }
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

}  // namespace HWY_NAMESPACE
}  // namespace nephos
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(tile_to_blocks);

void smooth_tile(const SmoothingPlan& plan, const SmoothingTile& tile, BlockSink& sink) {
    HWY_DYNAMIC_DISPATCH(tile_to_blocks)(plan, tile, sink);
}

}  // namespace nephos
#endif
