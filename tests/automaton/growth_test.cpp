// SPDX-License-Identifier: Apache-2.0

// The conformance vector: tests/golden/growth.txt states the bits before and after each of six steps, and
// with them the orientation of the neighbourhood (two cells below feed a cell, two cells above do not).

#include <fstream>

#include <gtest/gtest.h>

#include "automaton/automaton.h"
#include "tests/reference/reference_automaton.h"

namespace nephos {
namespace {

struct Case {
    std::string name;
    AutomatonOptions options;
    std::vector<reference::Cells> states;
};

reference::Cells read_state(std::istream& in, Extent extent) {
    reference::Cells cells{extent, {}, {}, {}};
    for (int row = 0; row < extent.y * extent.z; ++row) {
        std::string digits;
        in >> digits;
        EXPECT_EQ(digits.size(), std::size_t(extent.x));
        for (char c : digits) {
            const int value = c - '0';
            cells.hum.push_back(std::uint8_t(value & 1));
            cells.act.push_back(std::uint8_t(value >> 1 & 1));
            cells.cld.push_back(std::uint8_t(value >> 2 & 1));
        }
    }
    return cells;
}

std::vector<Case> read_cases() {
    std::ifstream in(NEPHOS_GOLDEN_DIR "/growth.txt");
    EXPECT_TRUE(in) << "tests/golden/growth.txt is missing";
    std::vector<Case> cases;
    std::string word;
    while (in >> word) {
        if (word == "#") {
            std::getline(in, word);
        } else if (word == "case") {
            Case c;
            std::getline(in >> std::ws, c.name);
            bool x = false, y = false, z = false;
            Extent& e = c.options.extent;
            Probabilities& p = c.options.field.background;
            in >> word >> e.x >> e.y >> e.z >> word >> x >> y >> z >> word >> p.hum >> p.act >> p.ext;
            const auto boundary = [](bool periodic) {
                return periodic ? Boundary::periodic : Boundary::open;
            };
            c.options.boundaries = {boundary(x), boundary(y), boundary(z)};
            cases.push_back(c);
        } else if (word == "step") {
            in >> word;
            cases.back().states.push_back(read_state(in, cases.back().options.extent));
        } else {
            ADD_FAILURE() << "unexpected word " << word;
        }
    }
    return cases;
}

TEST(Growth, FollowsTheConformanceVector) {
    const std::vector<Case> cases = read_cases();
    ASSERT_EQ(cases.size(), 6u);
    for (const Case& c : cases) {
        ASSERT_EQ(c.states.size(), 7u) << c.name;
        Automaton automaton(c.options, reference::to_lattice(c.states.front()));
        for (std::size_t step = 0; step < c.states.size(); ++step) {
            EXPECT_EQ(reference::to_cells(automaton.hum(), automaton.act(), automaton.cld()), c.states[step])
                << c.name << ", step " << step;
            automaton.step();
        }
    }
}

// The sentence of the scene format in one check: from one active cell in vapour, k+2 becomes active and k-2
// not.
TEST(Growth, GoesTwoCellsUpAndNotTwoDown) {
    AutomatonOptions options{.extent = {5, 5, 9}};
    options.field.background = {0, 0, 0};
    Lattice start{BitPlane(options.extent), BitPlane(options.extent), BitPlane(options.extent)};
    for (int k = 0; k < 9; ++k) start.hum.set(2, 2, k, true);
    start.act.set(2, 2, 4, true);
    Automaton automaton(options, std::move(start));
    automaton.step();
    EXPECT_TRUE(automaton.act().get(2, 2, 6));
    EXPECT_TRUE(automaton.act().get(2, 2, 5));
    EXPECT_TRUE(automaton.act().get(2, 2, 3));
    EXPECT_FALSE(automaton.act().get(2, 2, 2));
    EXPECT_TRUE(automaton.cld().get(2, 2, 4));
    EXPECT_FALSE(automaton.hum().get(2, 2, 4));
}

}  // namespace
}  // namespace nephos
