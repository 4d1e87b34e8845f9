// SPDX-License-Identifier: Apache-2.0
#pragma once

// Some levels of a lattice that is too large for one process: the same bits as those levels of an Automaton, when each
// slab is given the levels of act that its neighbours have (docs/adr/0018-distributed-lattice.md).
//
//     end                  halo: of the slab above
//     first .. end - 1     own: hum, act, cld
//     first - 1, first - 2 halo: of the slab below
//
// Growth reads act one level above and two below (D); random numbers belong to a place and a step, never to a process; and
// the wind moves whole levels. So halos of act are all that slabs exchange, once a step. Around a periodic vertical axis the
// halo of the lowest slab is the top of the highest.
//
//     for each step: exchange halo_levels() ... set_halo(k, words) ... step()

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "automaton/automaton.h"

namespace nephos {

class SlabAutomaton {
  public:
    // Starts the levels first..end - 1 from options.initial. Throws Error(usage) on bad options, and unless first is a multiple
    // of 8, end one or the number of levels, and first < end.
    SlabAutomaton(const AutomatonOptions& options, int first, int end);
    ~SlabAutomaton();
    SlabAutomaton(SlabAutomaton&&) noexcept;
    SlabAutomaton& operator=(SlabAutomaton&&) noexcept;

    const AutomatonOptions& options() const;
    int first() const;
    int end() const;
    std::uint64_t steps() const;

    // Returns the levels of other slabs whose act the next step reads; empty of a slab that is the whole lattice.
    std::vector<int> halo_levels() const;
    // Sets act of such a level to that at steps(): options().extent.y rows of words. Throws Error(usage) on any other level,
    // or another number of words.
    void set_halo(int level, std::span<const std::uint64_t> words);
    // Returns act of an own level, for other slabs. Precondition: first() <= level < end().
    std::span<const std::uint64_t> act_level(int level) const;

    // Advances by one step; all halos must have been set since the last one. Not thread-safe on one object.
    void step();

    // Return the own levels; level 0 of a view is first(). Valid until the next non-const call.
    BitPlaneView hum() const;
    BitPlaneView act() const;
    BitPlaneView cld() const;

    // Returns the bytes that a slab of that many levels takes.
    static std::size_t memory_bytes(const AutomatonOptions& options, int levels);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

// The state hash of a lattice (hash_of()) made from slab to slab: each process adds its levels of a plane and hands the bytes on,
// hum of all slabs from the lowest to the highest, then act, then cld.
class SlabHash {
  public:
    explicit SlabHash(const Extent& whole);
    // Goes on where another process stopped. Throws Error(usage) when these are not bytes().
    explicit SlabHash(std::span<const std::byte> bytes);
    ~SlabHash();
    SlabHash(const SlabHash&) = delete;
    SlabHash& operator=(const SlabHash&) = delete;

    void add(const BitPlaneView& levels);
    std::vector<std::byte> bytes() const;  // for a process of the same program
    StateHash hash() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace nephos
