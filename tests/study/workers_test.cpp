// SPDX-License-Identifier: Apache-2.0

// Workers: what reaches them from outside, and how they end.

#include "study/workers.h"

#include <csignal>
#include <map>
#include <thread>

#include <gtest/gtest.h>
#include <unistd.h>

namespace nephos {
namespace {

struct Ends {
    std::map<std::uint64_t, std::string> results, failures;
    TaskEnd keep() {
        return
            [this](std::uint64_t task, const std::string& result, const std::optional<std::string>& failure) {
                (failure ? failures : results)[task] = failure.value_or(result);
            };
    }
};

std::function<std::optional<std::uint64_t>()> first_numbers(std::uint64_t count) {
    return [count, at = std::uint64_t(0)]() mutable -> std::optional<std::uint64_t> {
        if (at == count) return std::nullopt;
        return at++;
    };
}

// A batch system ends all processes of a job at once: a worker that hears it first must not make its run fail.
TEST(Workers, LeaveSigtermAndSigintToTheParent) {
    Ends ends;
    const Task task = [](std::uint64_t number) {
        ::raise(number % 2 == 0 ? SIGTERM : SIGINT);
        return "result " + std::to_string(number);
    };
    EXPECT_TRUE(work({2, {}, {}}, first_numbers(6), task, ends.keep()));
    EXPECT_TRUE(ends.failures.empty());
    ASSERT_EQ(ends.results.size(), 6u);
    EXPECT_EQ(ends.results[3], "result 3");
}

TEST(Workers, ACrashCostsOneTask) {
    Ends ends;
    const Task task = [](std::uint64_t number) -> std::string {
        if (number == 1) ::raise(SIGKILL);
        if (number == 2) throw std::runtime_error("no such thing");
        return "done";
    };
    EXPECT_TRUE(work({2, {}, {}}, first_numbers(5), task, ends.keep()));
    EXPECT_EQ(ends.results.size(), 3u);
    EXPECT_NE(ends.failures[1].find("signal 9"), std::string::npos);
    EXPECT_EQ(ends.failures[2], "no such thing");
}

// A worker that went while it had nothing to do costs no task.
TEST(Workers, ATaskIsHandedToAnotherWorker) {
    Ends ends;
    const Task task = [](std::uint64_t) -> std::string {
        std::thread([] {
            ::usleep(50'000);
            ::_exit(1);
        }).detach();
        return "done";
    };
    const auto next = [first = first_numbers(3), given = 0]() mutable {
        if (given++ > 0) ::usleep(300'000);
        return first();
    };
    EXPECT_TRUE(work({1, {}, {}}, next, task, ends.keep()));
    EXPECT_EQ(ends.results.size(), 3u);
    EXPECT_TRUE(ends.failures.empty());
}

// Tasks that would outlast a test are dropped when the work is stopped.
TEST(Workers, AreEndedByTheirParent) {
    Ends ends;
    const Task task = [](std::uint64_t) -> std::string {
        ::sleep(100'000);
        return "";
    };
    EXPECT_FALSE(work({2, [] { return true; }, {}}, first_numbers(4), task, ends.keep()));
    EXPECT_TRUE(ends.results.empty() && ends.failures.empty());
}

}  // namespace
}  // namespace nephos
