// SPDX-License-Identifier: Apache-2.0
#pragma once

// The lattice: three bit planes over a box of cells, one bit a cell and plane.
//
// Index space: integer cells (i, j, k), i = x east, j = y north, k = z up; x runs fastest everywhere.
// A plane is an array of 64-bit words, little end first:
//
//     word(i, j, k) = (k * size.y + j) * words_per_row + i / 64        bit(i) = i % 64
//
//     row (j,k)   | word 0          | word 1          | ... | last word       |
//     cells       | 0 1 2 ...    63 | 64 65 ...   127 |     | ... nx-1 0 0 0 0|
//                                                                 `-------' padding, always 0
//
// Invariants: padding bits (i >= size.x) are 0 at all times, so planes can be counted, compared and hashed as
// plain memory; rows follow each other without gaps. See docs/adr/0001-memory-layout.md.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace nephos {

// Number of cells along each axis; each 1..65536.
struct Extent {
    int x = 0, y = 0, z = 0;

    std::size_t cells() const { return std::size_t(x) * std::size_t(y) * std::size_t(z); }
    bool operator==(const Extent&) const = default;
};

inline constexpr int kMaxExtent = 65536;

// The boundary condition along one axis: open (all bits beyond the box are 0) or periodic.
enum class Boundary { open, periodic };

struct Boundaries {
    Boundary x = Boundary::open, y = Boundary::open, z = Boundary::open;
    bool operator==(const Boundaries&) const = default;
};

// Returns the position of cell (i, j, k) in any dense array over the box; x fastest. The only such formula in
// nephos.
inline std::size_t linear_index(const Extent& extent, int i, int j, int k) {
    return (std::size_t(k) * std::size_t(extent.y) + std::size_t(j)) * std::size_t(extent.x) + std::size_t(i);
}

// Read-only view of one bit plane; cheap to copy, does not own. Layout as drawn above.
struct BitPlaneView {
    Extent extent;
    std::size_t words_per_row = 0;
    const std::uint64_t* words = nullptr;  // words_per_row * extent.y * extent.z of them

    const std::uint64_t* row(int j, int k) const {
        return words + (std::size_t(k) * std::size_t(extent.y) + std::size_t(j)) * words_per_row;
    }
    bool get(int i, int j, int k) const { return (row(j, k)[i / 64] >> (i % 64)) & 1u; }
    std::size_t word_count() const { return words_per_row * std::size_t(extent.y) * std::size_t(extent.z); }
};

// One bit plane that owns its memory: 64-byte aligned, with 64 bytes of zeros before and after it, so that
// kernels may load a vector that begins or ends just outside. Not thread-safe for writing to the same row.
class BitPlane {
  public:
    BitPlane() = default;
    // Creates a plane of 0 bits. Throws Error(usage) when an axis is outside 1..kMaxExtent, std::bad_alloc
    // without memory.
    explicit BitPlane(Extent extent);

    const Extent& extent() const { return extent_; }
    std::size_t words_per_row() const { return words_per_row_; }
    BitPlaneView view() const { return {extent_, words_per_row_, data()}; }
    std::span<std::uint64_t> words() { return {data(), word_count_}; }
    std::span<const std::uint64_t> words() const { return {data(), word_count_}; }
    std::uint64_t* row(int j, int k) {
        return data() + (std::size_t(k) * std::size_t(extent_.y) + std::size_t(j)) * words_per_row_;
    }

    bool get(int i, int j, int k) const { return view().get(i, j, k); }
    void set(int i, int j, int k, bool value);
    void clear();                 // all bits 0
    std::uint64_t count() const;  // number of cells that are 1
    bool operator==(const BitPlane& other) const;

    // Returns the bytes that a plane of this extent takes, to check sizes before allocating.
    static std::size_t bytes(Extent extent);

  private:
    struct alignas(64) Line {
        std::uint64_t words[8];
    };

    std::uint64_t* data() { return lines_.empty() ? nullptr : lines_[1].words; }
    const std::uint64_t* data() const { return lines_.empty() ? nullptr : lines_[1].words; }

    Extent extent_;
    std::size_t words_per_row_ = 0;
    std::size_t word_count_ = 0;
    std::vector<Line> lines_;
};

// The state of the automaton at one step (D, growth): vapour, phase transition, cloud.
struct Lattice {
    BitPlane hum;  // enough vapour to form cloud
    BitPlane act;  // phase transition from vapour to water about to happen
    BitPlane cld;  // cloud
};

// The map from index space to world space: cell (i, j, k) has its centre at
// origin_m + (i+0.5, j+0.5, k+0.5) * cell_size_m.
struct Placement {
    Vec3 origin_m{};  // world position of the lower corner of cell (0, 0, 0); z = height above ground
    double cell_size_m = 50.0;  // edge of a cubic cell, > 0
    bool operator==(const Placement&) const = default;
};

}  // namespace nephos
