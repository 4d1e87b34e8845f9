// SPDX-License-Identifier: Apache-2.0
#pragma once

// One measurement of ./bench: two sides measured in the same run, in turn, and their medians. The machines
// that this runs on are noisy and shared; the ratio of two things measured side by side is what can be
// trusted.

#include <algorithm>
#include <chrono>
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

// Runs both sides `rounds` times in turn after one round that does not count; medians in ms (first, second).
template <class F, class G>
std::pair<double, double> interleave(int rounds, F&& ours, G&& other) {
    std::vector<double> a, b;
    for (int round = -1; round < rounds; ++round) {
        const double first = time_ms(ours), second = time_ms(other);
        if (round < 0) continue;
        a.push_back(first);
        b.push_back(second);
    }
    return {median(a), median(b)};
}

}  // namespace nephos::bench
