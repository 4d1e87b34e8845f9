// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/block_cover.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "render/cloud/voxel_blocks.h"

namespace nephos {
namespace {

constexpr std::size_t kNone = SIZE_MAX;
using Neighbours = std::array<std::size_t, 27>;  // of a block, itself in the middle; kNone: outside

// One pass over the sorted numbers for each of the 27 places.
std::vector<Neighbours> neighbours_of(std::span<const std::uint64_t> blocks) {
    std::vector<Neighbours> all(blocks.size());
    for (std::size_t n = 0; n < 27; ++n) {
        const auto step = [&](std::size_t digit, int axis) {
            return (std::int64_t(digit) - 1) * (std::int64_t{1} << axis * kBlockPlaceBits);
        };
        const std::int64_t offset = step(n % 3, 0) + step(n / 3 % 3, 1) + step(n / 9, 2);
        std::size_t at = 0;
        for (std::size_t b = 0; b < blocks.size(); ++b) {
            const std::uint64_t requested = blocks[b] + std::uint64_t(offset);
            while (at < blocks.size() && blocks[at] < requested) ++at;
            all[b][n] = at < blocks.size() && blocks[at] == requested ? at : kNone;
        }
    }
    return all;
}

// The positions of the 4 x 4 x 4 octants in and around a block: the neighbour, and the octant in it.
struct Halo {
    std::array<std::uint8_t, 64> neighbour, octant;
    constexpr Halo() : neighbour(), octant() {
        for (unsigned n = 0; n < 64; ++n) {
            const unsigned at[3] = {n & 3, n >> 2 & 3, n >> 4};
            unsigned block = 0, inside = 0;
            for (unsigned axis = 3; axis-- > 0;) {
                block = 3 * block + (at[axis] == 0 ? 0 : at[axis] == 3 ? 2 : 1);
                inside = 2 * inside + (at[axis] == 0 || at[axis] == 2 ? 1 : 0);
            }
            neighbour[n] = std::uint8_t(block);
            octant[n] = std::uint8_t(inside);
        }
    }
};
constexpr Halo kHalo;

// The least of three neighbours on each axis in turn: of 4 x 4 x 4 values those of the 2 x 2 x 2 in the
// middle.
OfOctants least_around(const std::array<float, 64>& values) {
    std::array<float, 32> along_x;
    for (std::size_t n = 0; n < 32; ++n) {
        const float* const at = &values[n / 2 * 4 + n % 2];
        along_x[n] = std::min(std::min(at[0], at[1]), at[2]);
    }
    std::array<float, 16> along_y;
    for (std::size_t n = 0; n < 16; ++n) {
        const float* const at = &along_x[n / 4 * 8 + n % 4];
        along_y[n] = std::min(std::min(at[0], at[2]), at[4]);
    }
    OfOctants least;
    for (std::size_t n = 0; n < 8; ++n)
        least[n] = std::min(std::min(along_y[n], along_y[n + 4]), along_y[n + 8]);
    return least;
}

class Sweeps {
  public:
    Sweeps(std::span<const std::uint64_t> blocks, std::span<const OfOctants> depths, float most)
        : neighbours_(neighbours_of(blocks)), depths_(depths), cover_(blocks.size()), due_(blocks.size(), 1) {
        for (std::size_t b = 0; b < blocks.size(); ++b)
            for (std::size_t o = 0; o < 8; ++o) cover_[b][o] = std::min(most, 2 * depths[b][o]);
    }

    // Sweeps forwards and backwards until nothing changes: values decrease from their upper bounds to the
    // greatest solution consistent with their neighbours, independent of the order of the sweeps.
    std::vector<OfOctants> run() {
        for (bool changed = true; changed;) {
            changed = false;
            for (std::size_t b = 0; b < cover_.size(); ++b) changed = visit(b) || changed;
            for (std::size_t b = cover_.size(); b-- > 0;) changed = visit(b) || changed;
        }
        return std::move(cover_);
    }

  private:
    // Updates a block; returns true if it changed, so that its neighbours must be updated.
    bool visit(std::size_t b) {
        if (due_[b] == 0) return false;
        due_[b] = 0;
        std::array<float, 64> through;  // to the far side of each octant around
        for (std::size_t n = 0; n < 64; ++n) {
            const std::size_t from = neighbours_[b][kHalo.neighbour[n]], octant = kHalo.octant[n];
            through[n] = from == kNone ? 0.0f : cover_[from][octant] + depths_[from][octant];
        }
        // The octant itself is among those around it: coming from there costs more than being there.
        const OfOctants least = least_around(through);
        bool lowered = false;
        for (std::size_t o = 0; o < 8; ++o) {
            lowered = lowered || least[o] < cover_[b][o];
            cover_[b][o] = std::min(cover_[b][o], least[o]);
        }
        if (!lowered) return false;
        for (const std::size_t neighbour : neighbours_[b])
            if (neighbour != kNone) due_[neighbour] = 1;
        return true;
    }

    std::vector<Neighbours> neighbours_;
    std::span<const OfOctants> depths_;
    std::vector<OfOctants> cover_;
    std::vector<std::uint8_t> due_;  // whether anything around changed since the last visit
};

}  // namespace

std::vector<OfOctants> cover_of_octants(std::span<const std::uint64_t> blocks,
                                        std::span<const OfOctants> depths, float most) {
    return Sweeps(blocks, depths, most).run();
}

}  // namespace nephos
