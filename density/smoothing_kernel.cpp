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

#include "density/smoothing_vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace nephos {
namespace HWY_NAMESPACE {
namespace {

constexpr int kMaxRadius = 16;
constexpr int kLag = 8;  // rows between a row's expansion and its sum

template <class T>
std::vector<T> as(const std::vector<std::uint32_t>& weights) {
    return std::vector<T>(weights.begin(), weights.end());
}

// The state of one tile while its planes are processed from bottom to top. T is the type of the sums; kUnit:
// every weight is 1. Rows are processed in groups of 8.
template <class T, bool kUnit>
class TilePass {
  public:
    // `levels`: number of levels above the present one that are used before the next advance().
    TilePass(const SmoothingPlan& plan, const SmoothingTile& tile, int levels)
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
          slots_(levels + 2 * k0_),
          next_(-k0_) {
        x_rows_ = hwy::AllocateAligned<T>(std::size_t(width_) * std::size_t(tile.rows + 2 * j0_));
        expanded_ = hwy::AllocateAligned<T>(kLag * std::size_t(width_ + 2 * kWord));
        ring_ = hwy::AllocateAligned<T>(plane_size() * std::size_t(slots_));
        zero_ = hwy::AllocateAligned<T>(group_size());
        std::fill_n(zero_.get(), group_size(), T{0});
        full_.assign(std::size_t(slots_ * groups_), 0);
    }

    int width() const { return width_; }
    int groups() const { return groups_; }
    std::size_t group_size() const { return 8 * std::size_t(width_); }

    // Makes the levels below `end` ready.
    void advance(int end) {
        while (next_ < end + k0_) {
            begin_plane();
            finish_plane();
        }
    }

    // The same in small steps, to be done between others' stores: begins the next plane ...
    void begin_plane() {
        full_now_ = &full_[slot(next_) * std::size_t(groups_)];
        std::fill_n(full_now_, groups_, std::uint8_t{0});
        source_level_ = source(next_, plan_.extent.z, plan_.boundaries.z);
        row_ = 0;
        any_row_ = false;
    }

    // ... takes one of its rows further. A row is summed kLag steps after it was expanded: unaligned loads of
    // what still waits in the store queue, behind floats on their way to memory, would wait with it.
    void step() {
        const int count = tile_.rows + 2 * j0_;
        if (source_level_ < 0 || row_ >= count + kLag) return;
        const int ready = row_ - kLag;
        if (ready >= 0) lines_[ready] = sum_row(lines_[ready], ready);
        if (row_ < count) {
            const int j = source(tile_.first_row + row_ - j0_, plan_.extent.y, plan_.boundaries.y);
            T* row = expanded_.get() + std::ptrdiff_t(row_ % kLag) * (width_ + 2 * kWord);
            lines_[row_] = j >= 0 && expand_row(j, source_level_, row) ? row : nullptr;
            any_row_ = any_row_ || lines_[row_] != nullptr;
        }
        ++row_;
    }

    // ... and completes it.
    void finish_plane() {
        const int count = tile_.rows + 2 * j0_;
        while (source_level_ >= 0 && row_ < count + kLag) step();
        T* plane = ring_.get() + slot(next_) * plane_size();
        for (int group = 0; any_row_ && group < groups_; ++group) {
            const T* const* first = lines_ + 8 * group;
            if (std::all_of(first, first + 8 + 2 * j0_, [&](const T* line) { return line == zero_.get(); }))
                continue;
            full_now_[group] = 1;
            sum_rows(first, group, plane + std::size_t(group) * group_size());
        }
        ++next_;
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
    int next_;  // the plane to be filled next, or being filled: a level, which may lie beyond the box
    int source_level_ = 0;              // where its bits come from; -1: they are 0
    int row_ = 0;                       // its rows below this are expanded, those below row_ - kLag summed
    bool any_row_ = false;              // one of them was not 0
    std::uint8_t* full_now_ = nullptr;  // its part of full_
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
    TilePass<T, kUnit> pass(plan, tile, 8);
    const std::size_t width = std::size_t(pass.width());
    const auto s = hwy::AllocateAligned<T>(8 * pass.group_size());
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

void stream_zeros(int count, float* out) {
    const hn::CappedTag<float, kWord> d;
    const int lanes = int(hn::Lanes(d));
    int n = std::min(count, floats_to_line(out));
    std::fill_n(out, n, 0.0f);
    for (; n + lanes <= count; n += lanes) hn::Stream(hn::Zero(d), d, out + n);
    std::fill(out + n, out + count, 0.0f);
}

// Floats of the tile's part of one row. sums == nullptr: all 0.
template <class T>
HWY_INLINE void write_row(const T* sums, int count, float reciprocal, bool stream, float* out) {
    if (sums != nullptr && stream) {
        to_floats<T, true>(sums, count, reciprocal, out);
    } else if (sums != nullptr) {
        to_floats<T, false>(sums, count, reciprocal, out);
    } else if (stream) {
        stream_zeros(count, out);
    } else {
        std::fill_n(out, count, 0.0f);
    }
}

template <class T, bool kUnit>
void rows_of_tile(const SmoothingPlan& plan, const SmoothingTile& tile, float* out, bool stream) {
    TilePass<T, kUnit> pass(plan, tile, 2);
    const auto s = hwy::AllocateAligned<T>(2 * pass.group_size());
    const int first_cell = tile.first_word * kWord;
    const std::ptrdiff_t width = pass.width();
    const int cells = std::min(pass.width(), plan.extent.x - first_cell);
    const bool whole_rows = width == plan.extent.x;
    pass.advance(1);
    for (int z = 0; z < plan.extent.z; ++z) {
        // While the memory takes the floats of one group, the sums of the next and the rows of the next plane
        // are made.
        bool any = pass.sum_group(z, 0, s.get());
        pass.begin_plane();
        for (int group = 0; group < pass.groups(); ++group) {
            const T* now = any ? s.get() + std::size_t(group & 1) * pass.group_size() : nullptr;
            if (group + 1 < pass.groups()) {
                any = pass.sum_group(z, group + 1, s.get() + std::size_t(~group & 1) * pass.group_size());
            }
            const int first_row = tile.first_row + 8 * group;
            const int rows = std::min(8, plan.extent.y - first_row);
            float* first = out + linear_index(plan.extent, first_cell, first_row, z);
            // Rows that follow each other without a gap are cut at cache lines instead of at their ends.
            const std::ptrdiff_t shift = whole_rows && rows > 0 ? floats_to_line(first) : 0;
            for (std::ptrdiff_t n = 0; n < rows; ++n) {
                const std::ptrdiff_t begin = n * width + (n > 0 ? shift : 0);
                const std::ptrdiff_t end = n * width + (n + 1 < rows ? cells + shift : cells);
                write_row(now ? now + begin : nullptr, int(end - begin), plan.reciprocal, stream,
                          first + n * (plan.extent.x - width) + begin);
                pass.step();
            }
        }
        pass.finish_plane();
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
