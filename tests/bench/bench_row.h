// SPDX-License-Identifier: Apache-2.0
#pragma once

// One measurement of ./bench: two sides measured in the same run, in turn, and their medians. The machines
// that this runs on are noisy and shared; the ratio of two things measured side by side is what can be
// trusted.

#include <algorithm>
#include <chrono>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

namespace nephos::bench {

struct BenchRow {
    std::string work;     // what is measured, and against what
    double ours_ms = 0;   // median
    double other_ms = 0;  // median of the other side
    std::string target;   // as the project states it, for example "<= 1.1x"
    std::string note;     // what a reader must know to judge the figure
};

inline double median(std::vector<double> values) {
    std::ranges::sort(values);
    return values[values.size() / 2];
}

template <class F>
double time_ms(F&& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// Processor time of the calling thread: other work of the machine hardly changes it.
template <class F>
double processor_time_ms(F&& work) {
    const auto now_ms = [] {
        timespec now{};
        ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
        return double(now.tv_sec) * 1e3 + double(now.tv_nsec) * 1e-6;
    };
    const double start = now_ms();
    work();
    return now_ms() - start;
}

enum class Clock { wall, processor };

// Runs both sides `rounds` times in turn after one round that does not count; medians in ms (first, second).
template <class F, class G>
std::pair<double, double> interleave(int rounds, F&& ours, G&& other, Clock clock = Clock::wall) {
    std::vector<double> a, b;
    const auto time_of = [clock](auto&& work) {
        return clock == Clock::wall ? time_ms(work) : processor_time_ms(work);
    };
    for (int round = -1; round < rounds; ++round) {
        const double first = time_of(ours), second = time_of(other);
        if (round < 0) continue;
        a.push_back(first);
        b.push_back(second);
    }
    return {median(a), median(b)};
}

}  // namespace nephos::bench
