// SPDX-License-Identifier: Apache-2.0

// Stages beside each other: order, bound, and the way that failures take.

#include "simulation/stage.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace nephos {
namespace {

std::vector<int> numbers(int count) {
    std::vector<int> result(static_cast<std::size_t>(count));
    std::iota(result.begin(), result.end(), 0);
    return result;
}

// With a thread and without one.
class StageTest : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Threads, StageTest, testing::Values(false, true),
                         [](const auto& variant) { return variant.param ? "Beside" : "Inside"; });

TEST_P(StageTest, KeepsTheOrderThroughTwoStages) {
    std::vector<int> out;
    Stage<std::unique_ptr<int>> second(2, GetParam(),
                                       [&](std::unique_ptr<int>& job) { out.push_back(*job); });
    Stage<int> first(1, GetParam(), [&](int& job) { second.add(std::make_unique<int>(job)); });
    for (const int n : numbers(1000)) first.add(n);
    first.finish();
    second.finish();
    EXPECT_EQ(out, numbers(1000));
}

TEST_P(StageTest, HasNoMoreJobsThanItsBound) {
    std::atomic<int> handed = 0, done = 0, most = 0;
    Stage<int> stage(2, GetParam(), [&](int&) {
        std::this_thread::sleep_for(std::chrono::microseconds(200));
        ++done;
    });
    for (int n = 0; n < 100; ++n) {
        stage.add(n);
        ++handed;
        most = std::max(most.load(), handed - done);
    }
    stage.finish();
    EXPECT_EQ(done, 100);
    EXPECT_LE(most, 2);
}

// Work that waits for a next job until there is none to come never waits for nothing.
TEST_P(StageTest, KnowsWhetherTheNextJobIsThere) {
    std::vector<int> done;
    std::optional<int> kept;
    std::size_t kept_for_the_next = 0;
    Stage<int>* own = nullptr;
    Stage<int> stage(1, GetParam(), [&](int& job) {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));  // time for the next to come
        if (kept) done.push_back(*kept);
        kept = job;
        if (own->is_awaited()) {
            ++kept_for_the_next;
            return;
        }
        done.push_back(*std::exchange(kept, std::nullopt));
    });
    own = &stage;
    for (const int n : numbers(50)) stage.add(n);
    stage.finish();
    EXPECT_EQ(done, numbers(50));
    EXPECT_EQ(kept_for_the_next > 0, GetParam());
}

TEST_P(StageTest, AFailureReachesWhoeverHandsOutAndStopsTheRest) {
    std::vector<int> out;
    Stage<int> stage(3, GetParam(), [&](int& job) {
        if (job == 5) throw std::runtime_error("job 5");
        out.push_back(job);
    });
    std::string what;
    try {
        for (const int n : numbers(1000)) stage.add(n);
    } catch (const std::runtime_error& error) {
        what = error.what();
    }
    EXPECT_EQ(what, "job 5");
    EXPECT_THROW(stage.check(), std::runtime_error);
    EXPECT_THROW(stage.finish(), std::runtime_error);
    EXPECT_THROW(stage.add(1000), std::runtime_error);
    EXPECT_EQ(out, numbers(5));
}

// A writing that fails stops the drawing before it.
TEST_P(StageTest, AFailureGoesAgainstTheFlow) {
    std::vector<int> out;
    Stage<int> second(2, GetParam(), [&](int& job) {
        if (job == 3) throw std::runtime_error("full");
        out.push_back(job);
    });
    Stage<int> first(1, GetParam(), [&](int& job) { second.add(job); });
    EXPECT_THROW(
        {
            for (const int n : numbers(1000)) first.add(n);
        },
        std::runtime_error);
    EXPECT_EQ(out, numbers(3));
}

// A drawing that fails lets what was drawn before be written.
TEST_P(StageTest, StagesBehindAFailureFinishWhatTheyHave) {
    std::vector<int> out;
    Stage<int> second(2, GetParam(), [&](int& job) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        out.push_back(job);
    });
    Stage<int> first(1, GetParam(), [&](int& job) {
        if (job == 7) throw std::runtime_error("device lost");
        second.add(job);
    });
    EXPECT_THROW(
        {
            for (const int n : numbers(1000)) first.add(n);
        },
        std::runtime_error);
    EXPECT_NO_THROW(second.finish());
    EXPECT_EQ(out, numbers(7));
}

TEST(Stage, EndsWithoutDoingWhatWaits) {
    std::atomic<int> done = 0;
    std::atomic<bool> go = false;
    std::thread opener([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        go = true;
    });
    {
        Stage<int> stage(4, true, [&](int&) {
            while (!go) std::this_thread::yield();
            ++done;
        });
        for (int n = 0; n < 4; ++n) stage.add(n);
    }
    opener.join();
    EXPECT_LE(done, 1);
}

TEST(Stage, WorksBesideTheThreadThatHandsOut) {
    std::thread::id worker;
    Stage<int> stage(1, true, [&](int&) { worker = std::this_thread::get_id(); });
    stage.add(1);
    stage.finish();
    EXPECT_NE(worker, std::this_thread::get_id());
}

}  // namespace
}  // namespace nephos
