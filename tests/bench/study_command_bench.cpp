// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/study_command_bench.h"

#include <fstream>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <unistd.h>

#include "tests/bench/program_cost.h"

namespace nephos::bench {
namespace {

namespace fs = std::filesystem;

double processor_ms(const std::vector<std::string>& arguments, int rounds) {
    std::vector<double> times;
    for (int round = 0; round < rounds; ++round) times.push_back(cost_of(arguments).processor_ms);
    return median(times);
}

// A row whose target is a number of its own unit.
BenchRow against_target(std::string work, double figure, double target, const std::string& unit,
                        std::string note = "") {
    note = fmt::format("{:.2f}x of the target{}{}", figure / target, note.empty() ? "" : "; ", note);
    return {std::move(work), figure, 0, fmt::format("<= {} {}", target, unit), std::move(note)};
}

class Commands {
  public:
    Commands(const fs::path& source, const fs::path& command)
        : nephos_(command.string()),
          fair_((source / "docs/research/fair.toml").string()),
          folder_(fs::temp_directory_path() / ("nephos_bench_study_" + std::to_string(::getpid()))) {
        fs::create_directories(folder_);
        std::ofstream(folder_ / "small.toml") << "[lattice]\ncells = [16, 8, 4]\ninitial = \"empty\"\n"
                                                 "boundaries = [\"periodic\", \"periodic\", \"open\"]\n"
                                                 "[time]\nsteps = 300\n[field.background]\nhum = 0.003\n"
                                                 "act = 0.001\next = 0.12\n[frames]\nenabled = false\n";
    }
    Commands(const Commands&) = delete;
    Commands& operator=(const Commands&) = delete;
    ~Commands() { fs::remove_all(folder_); }

    BenchRow start() const {
        return against_target("`nephos --version`, processor time", processor_ms({nephos_, "--version"}, 21),
                              15, "ms");
    }

    // Other work of the machine meets both in turn.
    BenchRow statistics_only() const {
        std::vector<double> statistics, hash;
        for (int round = 0; round < 7; ++round) {
            fs::remove_all(folder_ / "run");
            statistics.push_back(cost_of({nephos_, "run", fair_, "--statistics-only", "--threads", "1",
                                          "--quiet", "--out", path("run")})
                                     .processor_ms);
            hash.push_back(
                cost_of({nephos_, "hash", fair_, "--steps", "300", "--threads", "1"}).processor_ms);
        }
        return {
            "`nephos run --statistics-only`, 256x128x20 x 300 steps, against `nephos hash`, processor time",
            median(statistics), median(hash), "<= 1.1x", ""};
    }

    BenchRow sweep(const std::string& clouds_every, const std::string& what, double runs_per_s) const {
        constexpr int kRuns = 32;
        fs::remove_all(folder_ / "fair");
        const Cost cost = cost_of({nephos_, "sweep", fair_, "--axis", "field.background.ext=0.12",
                                   "--replicates", std::to_string(kRuns), "--steps", "300", "--clouds-every",
                                   clouds_every, "--workers", "2", "--quiet", "--out", path("fair")});
        const double free = 2000 * kRuns / cost.processor_ms;
        return {fmt::format("a run of a sweep of {}, 256x128x20 x 300 steps, {}, 2 workers, wall clock",
                            kRuns, what),
                cost.wall_ms / kRuns, 0, fmt::format(">= {} runs/s", runs_per_s),
                fmt::format("{:.1f} runs/s, {:.2f}x of the target; two free cores, by the processor time: "
                            "{:.1f} runs/s, {:.2f}x",
                            1000 * kRuns / cost.wall_ms, 1000 * kRuns / cost.wall_ms / runs_per_s, free,
                            free / runs_per_s)};
    }

    // Tables, report and a second call of a sweep of 2,000 points and 10,000 runs.
    std::vector<BenchRow> many_runs() const {
        const std::vector<std::string> sweep{nephos_,
                                             "sweep",
                                             path("small.toml"),
                                             "--axis",
                                             "field.background.ext=0.05..0.4:2000",
                                             "--steps",
                                             "300",
                                             "--clouds-every",
                                             "0",
                                             "--workers",
                                             "2",
                                             "--quiet",
                                             "--out",
                                             path("many")};
        cost_of(sweep);
        const Cost again = cost_of(sweep), merge = cost_of({nephos_, "merge", path("many"), "--quiet"}),
                   report = cost_of({nephos_, "report", path("many"), "--quiet"});
        return {against_target("`nephos merge` and `report` of 10,000 runs of 300 steps, processor time",
                               merge.processor_ms + report.processor_ms, 10000, "ms",
                               fmt::format("{:.0f} and {:.0f} ms", merge.processor_ms, report.processor_ms)),
                against_target("`nephos sweep` that finds 10,000 runs done, processor time",
                               again.processor_ms, 1000, "ms")};
    }

    BenchRow planned_runs() const {
        const auto peak = [&](const std::string& ext, const std::string& act) {
            return cost_of({nephos_, "sweep", path("small.toml"), "--axis",
                            "field.background.ext=0.05..0.4:" + ext, "--axis",
                            "field.background.act=log:1e-5..1e-2:" + act, "--dry-run", "--out", path("none")})
                .peak_mib;
        };
        return {"peak memory of a sweep of 1,000,000 planned runs (MiB, not ms), against one of 20",
                peak("2000", "100"), peak("2", "2"), "<= 1.05x", ""};
    }

  private:
    std::string path(const char* name) const { return (folder_ / name).string(); }

    std::string nephos_, fair_;
    fs::path folder_;
};

}  // namespace

std::vector<BenchRow> study_command_rows(const fs::path& source, const fs::path& command) {
    const Commands commands(source, command);
    std::vector<BenchRow> rows{commands.start(), commands.statistics_only(),
                               commands.sweep("0", "statistics of every step", 7.5),
                               commands.sweep("10", "2-D clouds of every tenth, too", 7)};
    for (BenchRow& row : commands.many_runs()) rows.push_back(std::move(row));
    rows.push_back(commands.planned_runs());
    return rows;
}

}  // namespace nephos::bench
