// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/stage_table.h"

#include <array>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <vector>

#include <fmt/core.h>
#include <tbb/parallel_for.h>

#include "tests/bench/bench_row.h"

namespace nephos::bench {
namespace {

constexpr std::array<const char*, kDrawStages> kNames{"has it changed, checks",
                                                      "order from the eye",
                                                      "shapes and bins for the eye",
                                                      "what is seen",
                                                      "order from the sun",
                                                      "bins for the light",
                                                      "light",
                                                      "what scatters",
                                                      "pixels"};

// Bytes that both threads together copy in a nanosecond, read and written.
double copied_bytes_per_ns() {
    constexpr std::size_t kBytes = std::size_t{1} << 26;
    std::vector<std::byte> from(kBytes, std::byte{1}), to(kBytes);
    std::vector<double> times;
    for (int round = 0; round < 7; ++round) {
        times.push_back(time_ms([&] {
            tbb::parallel_for(std::size_t{0}, std::size_t{64}, [&](std::size_t part) {
                std::memcpy(&to[part * kBytes / 64], &from[part * kBytes / 64], kBytes / 64);
            });
        }));
    }
    return 2 * double(kBytes) / (1e6 * median(times));
}

}  // namespace

void print_stages(const std::string& what, const Renderer& renderer, int rounds,
                  const std::function<void()>& draw) {
    std::array<std::vector<double>, kDrawStages> wall, processor;
    std::vector<double> whole_wall, whole_processor;
    for (int round = -1; round < rounds; ++round) {
        const std::clock_t start = std::clock();
        const double ms = time_ms(draw);
        if (round >= 0) {
            whole_wall.push_back(ms);
            whole_processor.push_back(1000.0 * double(std::clock() - start) / CLOCKS_PER_SEC);
        }
        for (std::size_t s = 0; round >= 0 && s < kDrawStages; ++s) {
            wall[s].push_back(renderer.times().stages[s].wall_ms);
            processor[s].push_back(renderer.times().stages[s].processor_ms);
        }
    }
    const double copied = copied_bytes_per_ns();
    fmt::print(
        "Stages of {}, 640x480; memory copies {:.1f} GB/s\n\n"
        "| stage | wall, ms | processor, ms | MB moved | against copying them | pairs, millions | ns a pair "
        "|\n|---|---|---|---|---|---|---|\n",
        what, copied);
    for (std::size_t s = 0; s < kDrawStages; ++s) {
        const StageTime& time = renderer.times().stages[s];
        const double ms = median(wall[s]), mega = 1e-6 * double(time.bytes),
                     pairs = 1e-6 * double(time.pairs);
        if (!(ms > 0)) continue;
        fmt::print("| {} | {:.2f} | {:.2f} | {} | {} | {} | {} |\n", kNames[s], ms, median(processor[s]),
                   time.bytes != 0 ? fmt::format("{:.1f}", mega) : "",
                   time.bytes != 0 ? fmt::format("{:.1f}x", ms * copied / mega) : "",
                   time.pairs != 0 ? fmt::format("{:.2f}", pairs) : "",
                   time.pairs != 0 ? fmt::format("{:.3f}", median(processor[s]) / pairs) : "");
    }
    fmt::print("| whole picture | {:.2f} | {:.2f} | | | | |\n\n", median(whole_wall),
               median(whole_processor));
    std::fflush(stdout);
}

}  // namespace nephos::bench
