// SPDX-License-Identifier: Apache-2.0

// Slabs of a lattice against the whole of it: after every step the same hash, for any cut, boundaries and wind.

#include "automaton/slab_automaton.h"

#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"

namespace nephos {
namespace {

AutomatonOptions scene(Boundaries boundaries, bool wind) {
    AutomatonOptions options;
    options.extent = {70, 37, 27};
    options.boundaries = boundaries;
    options.seed = 12;
    options.field.background = {0.05f, 0.01f, 0.1f};
    if (wind) options.wind.keyframes = {{0, {{0, {7.3, -4.1}}, {2000, {-23.0, 12.0}}}}};
    return options;
}

// Steps slabs that begin at `cuts`, each with halos from the others.
class Slabs {
  public:
    Slabs(const AutomatonOptions& options, const std::vector<int>& cuts) : extent_(options.extent) {
        for (std::size_t n = 0; n < cuts.size(); ++n)
            slabs_.emplace_back(options, cuts[n], n + 1 < cuts.size() ? cuts[n + 1] : extent_.z);
    }
    void step() {
        for (SlabAutomaton& slab : slabs_)
            for (const int level : slab.halo_levels())
                for (const SlabAutomaton& other : slabs_)
                    if (level >= other.first() && level < other.end())
                        slab.set_halo(level, other.act_level(level));
        for (SlabAutomaton& slab : slabs_) slab.step();
    }
    StateHash hash() const {
        std::vector<std::byte> bytes = SlabHash(extent_).bytes();
        for (const auto plane : {&SlabAutomaton::hum, &SlabAutomaton::act, &SlabAutomaton::cld})
            for (const SlabAutomaton& slab : slabs_) {
                SlabHash hash(bytes);
                hash.add((slab.*plane)());
                bytes = hash.bytes();
            }
        return SlabHash(bytes).hash();
    }

  private:
    Extent extent_;
    std::vector<SlabAutomaton> slabs_;
};

TEST(SlabAutomaton, AnyCutHasTheBitsOfTheWhole) {
    constexpr Boundary o = Boundary::open, p = Boundary::periodic;
    for (const Boundaries boundaries :
         {Boundaries{o, o, o}, Boundaries{p, p, o}, Boundaries{p, p, p}, Boundaries{o, o, p}})
        for (const bool wind : {false, true}) {
            const AutomatonOptions options = scene(boundaries, wind);
            for (const std::vector<int>& cuts :
                 std::vector<std::vector<int>>{{0}, {0, 8}, {0, 16, 24}, {0, 8, 16, 24}}) {
                Automaton whole(options);
                Slabs slabs(options, cuts);
                for (int step = 0; step < 25; ++step) {
                    ASSERT_EQ(slabs.hash().hex(), whole.hash().hex())
                        << cuts.size() << " slabs, step " << step << ", wind " << wind;
                    whole.step();
                    slabs.step();
                }
            }
        }
}

TEST(SlabAutomaton, AMissingHaloChangesTheBits) {
    const AutomatonOptions options = scene({}, false);
    Automaton whole(options);
    SlabAutomaton low(options, 0, 8), high(options, 8, 27);
    for (int step = 0; step < 5; ++step) {
        whole.step();
        low.step();
        high.step();
    }
    SlabHash hash(options.extent);
    for (const BitPlaneView& plane : {low.hum(), high.hum(), low.act(), high.act(), low.cld(), high.cld()})
        hash.add(plane);
    EXPECT_NE(hash.hash(), whole.hash());
}

TEST(SlabAutomaton, NamesTheLevelsThatItNeeds) {
    const AutomatonOptions open = scene({}, false);
    EXPECT_EQ(SlabAutomaton(open, 0, 27).halo_levels(), std::vector<int>{});
    EXPECT_EQ(SlabAutomaton(open, 0, 8).halo_levels(), std::vector{8});
    EXPECT_EQ(SlabAutomaton(open, 8, 16).halo_levels(), (std::vector{6, 7, 16}));
    const AutomatonOptions around = scene({Boundary::open, Boundary::open, Boundary::periodic}, false);
    EXPECT_EQ(SlabAutomaton(around, 0, 8).halo_levels(), (std::vector{25, 26, 8}));
    EXPECT_EQ(SlabAutomaton(around, 24, 27).halo_levels(), (std::vector{22, 23, 0}));
    EXPECT_EQ(SlabAutomaton(around, 0, 27).halo_levels(), std::vector<int>{});
}

TEST(SlabAutomaton, RefusesOtherCutsAndLevels) {
    const AutomatonOptions options = scene({}, false);
    for (const auto& [first, end] :
         std::vector<std::pair<int, int>>{{4, 16}, {0, 12}, {8, 8}, {-8, 8}, {0, 32}})
        EXPECT_THROW(SlabAutomaton(options, first, end), Error) << first << " " << end;
    SlabAutomaton slab(options, 8, 16);
    const std::vector<std::uint64_t> words(slab.act_level(8).size());
    EXPECT_NO_THROW(slab.set_halo(16, words));
    EXPECT_THROW(slab.set_halo(17, words), Error);
    EXPECT_THROW(slab.set_halo(8, words), Error);
    EXPECT_THROW(slab.set_halo(16, std::span(words).first(3)), Error);
    EXPECT_THROW(SlabHash(std::span<const std::byte>()), Error);
}

}  // namespace
}  // namespace nephos
