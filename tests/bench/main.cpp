// SPDX-License-Identifier: Apache-2.0

// ./bench: prints the tables of docs/measurements.md. Nothing here passes or fails: figures are for people to judge.

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>

#include <fmt/core.h>

#include "automaton/kernels.h"
#include "core/memory.h"
#include "tests/bench/air_bench.h"
#include "tests/bench/atmosphere_bench.h"
#include "tests/bench/automaton_bench.h"
#include "tests/bench/billboard_bench.h"
#include "tests/bench/card_bench.h"
#include "tests/bench/density_bench.h"
#include "tests/bench/detail_bench.h"
#include "tests/bench/export_bench.h"
#include "tests/bench/files_bench.h"
#include "tests/bench/ground_bench.h"
#include "tests/bench/memory_bench.h"
#include "tests/bench/rain_bench.h"
#include "tests/bench/render_bench.h"
#include "tests/bench/seeds_bench.h"
#include "tests/bench/study_bench.h"
#include "tests/bench/study_command_bench.h"
#include "tests/bench/veil_bench.h"

namespace {

std::string processor() {
    std::ifstream info("/proc/cpuinfo");
    for (std::string line; std::getline(info, line);) {
        if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
    }
    return "unknown processor";
}

void print(const std::vector<nephos::bench::BenchRow>& rows) {
    fmt::print("| work | nephos, ms | other, ms | ratio | target | note |\n|---|---|---|---|---|---|\n");
    for (const auto& row : rows) {
        const bool faster = row.target.find("faster") != std::string::npos;
        const double ratio = faster ? row.other_ms / row.ours_ms : row.ours_ms / row.other_ms;
        const bool compared = row.other_ms > 0;  // some rows have a target in ms and no other side
        fmt::print("| {} | {:.3g} | {} | {} | {} | {} |\n", row.work, row.ours_ms,
                   compared ? fmt::format("{:.3g}", row.other_ms) : "",
                   compared ? fmt::format("{:.2f}x{}", ratio, faster ? " faster" : "") : "", row.target,
                   row.note);
        std::fflush(stdout);
    }
    fmt::print("\n");
}

}  // namespace

int main(int argc, char** argv) {
    using namespace nephos::bench;
    nephos::keep_freed_memory();  // as the command does
    const std::filesystem::path source = NEPHOS_SOURCE_DIR;
    const std::filesystem::path programs = std::filesystem::canonical("/proc/self/exe").parent_path();
    const char* const data_variable = std::getenv("NEPHOS_TEST_DATA");
    const std::filesystem::path data = data_variable != nullptr ? data_variable : NEPHOS_TEST_DATA;
    const std::pair<const char*, std::function<std::vector<BenchRow>()>> groups[] = {
        {"automaton", [&] { return automaton_rows(source, programs); }},
        {"density", [] { return density_bench_rows(); }},
        {"memory", [&] { return memory_rows(source, programs / "../../bin/nephos"); }},
        {"export", [] { return export_bench_rows(); }},
        {"files", [&] { return files_rows(source); }},
        {"veil", [] { return veil_bench_rows(); }},
        {"seeds", [] { return seeds_rows(); }},
        {"study", [] { return study_rows(); }},
        {"study_command", [&] { return study_command_rows(source, programs / "../../bin/nephos"); }},
        {"ground", [] { return ground_rows(); }},
        {"rain", [] { return rain_rows(); }},
        {"atmosphere", [] { return atmosphere_rows(); }},
        {"air", [&] { return air_rows(source); }},
        {"billboards", [] { return billboard_rows(); }},
        {"detail", [&] { return detail_rows(source); }},
        {"render", [&] { return render_rows(source, data); }},
        {"card", [&] { return card_rows(source); }},
    };
    if (argc > 1 && (std::strcmp(argv[1], "--help") == 0 || std::strcmp(argv[1], "-h") == 0)) {
        fmt::print(
            "Usage: ./bench [GROUP ...]\n\nPrints medians of nephos and of what it is compared with, "
            "measured in "
            "turn.\nGroups:");
        for (const auto& group : groups) fmt::print(" {}", group.first);
        fmt::print(". Without a name, all.\n");
        return 0;
    }
    for (int i = 1; i < argc; ++i) {
        const auto is_named = [&](const auto& group) { return std::strcmp(argv[i], group.first) == 0; };
        if (std::ranges::any_of(groups, is_named)) continue;
        fmt::print(stderr, "error: no group `{}`: `./bench --help` lists them\n", argv[i]);
        return 2;
    }
    try {
        fmt::print("{}, kernels for {}; one thread unless said; medians of runs in turn\n\n", processor(),
                   nephos::kernel_target());
        for (const auto& [name, measure] : groups) {
            bool wanted = argc == 1;
            for (int i = 1; i < argc; ++i) wanted = wanted || std::strcmp(argv[i], name) == 0;
            if (!wanted) continue;
            fmt::print("### {}\n\n", name);
            std::fflush(stdout);
            print(measure());
        }
    } catch (const std::exception& error) {
        fmt::print(stderr, "error: {}\n", error.what());
        return 1;
    }
}
