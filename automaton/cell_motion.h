// SPDX-License-Identifier: Apache-2.0
#pragma once

// Advection by a wind that differs from place to place (docs/adr/0021): the content of a cell, its three bits, is a
// parcel of air with a position of its own, exact to 2^-11 of a cell, that travels with it. A step
//
//     1. moves each position along the wind (mean_wind() of core/wind.h)
//     2. puts each content into the cell that holds its position; of several the one closest to the cell's centre
//     3. puts each of the others into the free cell nearest to its position, at most 14 cells away
//
// The cell of step 3 does not change the position, so nothing drifts: where the wind brings air back, each content
// returns to the cell that it came from. No content is lost or doubled but those that leave through an open side, and
// those that find no free cell because the wind converges. What is born in an empty cell stands at its centre.
//
// Steps are deterministic: step 1 runs in threads, each on its own layers, the others in the order of the cells.

#include <array>
#include <cstdint>
#include <vector>

#include "automaton/lattice.h"
#include "automaton/options.h"
#include "core/bytes.h"

namespace nephos {

class CellMotion {
  public:
    // Starts with every content at the centre of its cell.
    explicit CellMotion(const Extent& extent);

    // Moves the contents of all cells over the step that starts at `time_s`. Throws Error(usage) when the wind moves a
    // content by more than kMaxExtent cells.
    void step(Lattice& lattice, const AutomatonOptions& options, double time_s);

    // Returns the number of contents that found no free cell, in all steps.
    std::uint64_t crowded_out() const { return crowded_out_; }

    void save(ByteWriter& out) const;
    void restore(ByteReader& in);
    // Returns the bytes that a lattice of this extent takes at most.
    static std::size_t memory_bytes(const Extent& extent);

  private:
    // A position relative to a cell's centre, in units of 2^-11 cell.
    using Offset = std::array<std::int16_t, 3>;

    // A content on its way: its position in units of 2^-11 cell from the lattice's corner.
    struct Moving {
        std::array<std::int32_t, 3> at;
        std::uint8_t bits;  // hum, act and cld as bits 0, 1 and 2
    };

    std::vector<Moving> moved(const Lattice& lattice, const AutomatonOptions& options, double time_s, int layer) const;
    std::size_t free_cell(const Moving& content, const std::vector<std::uint32_t>& holders,
                          const Boundaries& boundaries) const;

    Extent extent_;
    std::vector<Offset> offsets_;  // of each cell; 0 where it is empty
    std::uint64_t crowded_out_ = 0;
};

}  // namespace nephos
