// SPDX-License-Identifier: Apache-2.0

// Steps a simulation with random numbers that do not depend on their place (see uncounted/): a line on
// standard input is one step, its milliseconds come back on standard output. ./bench asks in turn with its
// own steps.

#include <cstdio>

#include <tbb/global_control.h>

#include "tests/bench/bench_row.h"
#include "tests/bench/bench_scenes.h"

int main() {
    using namespace nephos;
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    Automaton automaton(bench::ellipsoid_cube(512, 0.01), bench::random_lattice({512, 512, 512}));
    for (int c = std::getchar(); c != EOF; c = std::getchar()) {
        std::printf("%.6f\n", bench::time_ms([&] { automaton.step(); }));
        std::fflush(stdout);
    }
}
