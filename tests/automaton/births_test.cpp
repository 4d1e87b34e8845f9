// SPDX-License-Identifier: Apache-2.0
// The memory of a thread after a part of a step that ended with an exception: the next part finds nothing of it.

#include <algorithm>
#include <new>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "automaton/background.h"
#include "automaton/births-inl.h"
#include "automaton/block_field.h"
#include "automaton/lattice.h"
#include "automaton/options.h"

namespace nephos {
namespace {

namespace target = HWY_NAMESPACE;

AutomatonOptions sparse_and_dense() {
    AutomatonOptions options{.extent = {200, 8, 8}, .seed = 5};
    options.field.background = {0.02, 0.3, 0.05};
    return options;
}

// A lattice half of cloud, and what draws in it.
struct Part {
    AutomatonOptions options = sparse_and_dense();
    Background background{options};
    BlockField field{options, {}, background};
    PoissonLadder ladder;
    BitPlane hum{options.extent}, act{options.extent}, cld{options.extent};
    StepPlanes planes{.extent = options.extent,
                      .words_per_row = hum.words_per_row(),
                      .act_next = act.words().data(),
                      .hum = hum.words().data(),
                      .cld = cld.words().data()};
    StepRandom random{options.seed, Domain::lattice, 3, &field, &ladder};

    Part() {
        for (int k = 0; k < 8; ++k)
            for (int j = 0; j < 8; ++j)
                for (int i = 0; i < 200; i += 2) cld.set(i, j, k, true);
    }
    template <class DrawSegment>
    void draw(const DrawSegment& draw_segment) {
        target::draw_part(planes, random, 0, 0, 1, draw_segment);
    }
    void draw() { draw(target::draw_segment); }
};

TEST(BirthScratch, IsEmptyAfterAPartThatFailed) {
    Part expected, after;
    std::thread([&] { expected.draw(); }).join();  // in memory of its own
    Part failing;
    const auto fail = [](const target::Segment&, target::BirthScratch& s) {
        s.job_count = target::kSegmentBlocks;
        s.counter_count = target::kMaxCounters;
        s.accepted_count = 7;
        std::fill_n(&s.events[0][0], 8 * target::kSegmentBlocks, ~std::uint64_t{0});
        std::fill_n(&s.ties[0][0], 8 * target::kSegmentBlocks, ~std::uint64_t{0});
        s.known_cloud = ~0u;
        throw std::bad_alloc();
    };
    EXPECT_THROW(failing.draw(fail), std::bad_alloc);
    after.draw();
    EXPECT_TRUE(after.hum == expected.hum);
    EXPECT_TRUE(after.act == expected.act);
    EXPECT_TRUE(after.cld == expected.cld);
    EXPECT_GT(after.hum.count(), 0u);
    EXPECT_GT(after.act.count(), 0u);
    EXPECT_LT(after.cld.count(), 200u * 64 / 2);
}

}  // namespace
}  // namespace nephos
