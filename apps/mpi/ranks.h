// SPDX-License-Identifier: Apache-2.0
#pragma once

// One lattice over the processes of an MPI communicator: each owns some levels (automaton/slab_automaton.h), and what is
// asked of the whole is put together from all. Every member function is collective: all processes call it, in one order.

#include <cstdint>
#include <vector>

#include "statistics/cloud_statistics.h"

#include "automaton/slab_automaton.h"

namespace nephos {

class Ranks {
  public:
    // Cuts the levels into as many slabs as there are processes, whole blocks of 8 levels each. Throws Error(usage) when
    // there are more processes than such blocks.
    explicit Ranks(const AutomatonOptions& options);

    int rank() const { return rank_; }
    const SlabAutomaton& slab() const { return slab_; }

    // Exchanges halos, then steps every slab.
    void step();

    // Return the same as an Automaton with these options after as many steps; on rank 0 only, nothing elsewhere.
    StateHash hash() const;
    CloudStatistics statistics() const;

  private:
    static SlabAutomaton make_slab(const AutomatonOptions& options);
    void exchange();
    int owner_of(int level) const;
    CloudCounts counts() const;

    int rank_ = 0, ranks_ = 1;
    SlabAutomaton slab_;
    std::vector<int> ends_;                    // of the slabs, by rank
    std::vector<std::vector<int>> all_halos_;  // of the slabs, by rank
};

}  // namespace nephos
