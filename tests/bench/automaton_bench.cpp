// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/automaton_bench.h"

#include <cstdio>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include "automaton/automaton.h"
#include "scenes/format/reader.h"
#include "tests/bench/bench_scenes.h"

namespace nephos::bench {
namespace {

namespace fs = std::filesystem;
constexpr int kEdge = 512;

// Two buffers as large as the three planes of a simulation.
class PlaneCopy {
  public:
    explicit PlaneCopy(Extent extent) : from_(3 * BitPlane::bytes(extent), 1), to_(from_.size(), 2) {}
    void operator()() { std::memcpy(to_.data(), from_.data(), from_.size()); }

  private:
    std::vector<char> from_, to_;
};

BenchRow step_against_memcpy(std::string work, Automaton automaton, std::string target, std::string note) {
    PlaneCopy copy(automaton.options().extent);
    const auto [ours, other] = interleave(
        9, [&] { automaton.step(); }, copy);
    return {std::move(work), ours, other, std::move(target), std::move(note)};
}

Automaton grown(const AutomatonOptions& options, int steps) {
    Automaton automaton(options);
    for (int i = 0; i < steps; ++i) automaton.step();
    return automaton;
}

BenchRow cumulus_against_numpy(const fs::path& source) {
    const Scene scene = read_scene(source / "scenes/cumulus.toml", {});
    Automaton automaton = grown(scene.automaton, 60);
    std::vector<double> ours, other;
    const std::string command = "/usr/bin/python3 '" + (source / "tests/reference/numpy_twin.py").string() +
                                "' --scene '" + (source / "scenes/cumulus.toml").string() + "' --steps 20";
    for (int round = 0; round < 3; ++round) {
        ours.push_back(time_ms([&] {
                           for (int i = 0; i < 200; ++i) automaton.step();
                       }) /
                       200);
        std::FILE* pipe = ::popen(command.c_str(), "r");
        if (pipe == nullptr) throw std::runtime_error("cannot run " + command);
        std::string output;
        for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) output += char(c);
        if (::pclose(pipe) != 0) throw std::runtime_error("failed: " + command);
        other.push_back(nlohmann::json::parse(output).at("ms_per_step").get<double>());
    }
    return {"cumulus.toml: step, against the NumPy twin", median(ours), median(other), ">= 100x faster", ""};
}

// A lattice as large as that of a step, and the memory of its planes.
BenchRow first_state() {
    AutomatonOptions options = cube(kEdge, {0.37, 0.41, 0.3});
    options.initial = InitialState::field;
    PlaneCopy copy(options.extent);
    const auto [ours, other] = interleave(
        5, [&] { Automaton{options}; }, copy);
    const double rate = double(options.extent.cells()) / ours * 1e-6;
    return {"first state, p = 0.37, 0.41 in every cell, 512^3, against the same", ours, other, ">= 2 Gcell/s",
            fmt::format("{:.2f} Gcell/s, {:.2f}x of the target; 256 MiB of Philox bytes", rate, rate / 2)};
}

// The lattice and field of docs/research.md; a step against one at memcpy's speed would be unfair, as it fits a cache.
BenchRow research_step() {
    AutomatonOptions options;
    options.extent = {256, 128, 20};
    options.boundaries = {Boundary::periodic, Boundary::periodic, Boundary::open};
    options.field.background = {0.003, 1e-4, 0.12};
    Automaton automaton = grown(options, 100);
    constexpr int kSteps = 200;
    std::vector<double> times;
    for (int round = 0; round < 9; ++round)
        times.push_back(time_ms([&] {
                            for (int i = 0; i < kSteps; ++i) automaton.step();
                        }) /
                        kSteps);
    return {"step of docs/research/fair.toml, 256x128x20", median(times), 0, "",
            fmt::format("{:.1f} Gcell/s", double(options.extent.cells()) / median(times) * 1e-6)};
}

BenchRow two_threads_against_one() {
    Automaton one(ellipsoid_cube(kEdge, 0.01), random_lattice({kEdge, kEdge, kEdge}));
    Automaton two(ellipsoid_cube(kEdge, 0.01), random_lattice({kEdge, kEdge, kEdge}));
    const auto step = [](Automaton& automaton, std::size_t threads) {
        const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
        automaton.step();
    };
    const auto [with_two, with_one] = interleave(
        9, [&] { step(two, 2); }, [&] { step(one, 1); });
    return {"step with ellipsoids, 512^3: 2 threads, against 1", with_two, with_one, ">= 1.8x faster", ""};
}

// A child process that takes a step for each line that it is sent.
class UncountedSteps {
  public:
    explicit UncountedSteps(const fs::path& program) {
        int in[2], out[2];
        if (::pipe(in) != 0 || ::pipe(out) != 0) throw std::runtime_error("cannot make a pipe");
        child_ = ::fork();
        if (child_ == 0) {
            ::dup2(in[0], 0);
            ::dup2(out[1], 1);
            for (int fd : {in[0], in[1], out[0], out[1]}) ::close(fd);
            ::execl(program.c_str(), program.c_str(), nullptr);
            ::_exit(127);
        }
        ::close(in[0]);
        ::close(out[1]);
        to_ = ::fdopen(in[1], "w");
        from_ = ::fdopen(out[0], "r");
    }
    UncountedSteps(const UncountedSteps&) = delete;
    UncountedSteps& operator=(const UncountedSteps&) = delete;
    ~UncountedSteps() {
        std::fclose(to_);
        std::fclose(from_);
        ::waitpid(child_, nullptr, 0);
    }
    double step_ms() {
        std::fputc('\n', to_);
        std::fflush(to_);
        double ms = 0;
        if (std::fscanf(from_, "%lf", &ms) != 1)
            throw std::runtime_error("the step without determinism failed");
        return ms;
    }

  private:
    pid_t child_ = -1;
    std::FILE *to_ = nullptr, *from_ = nullptr;
};

BenchRow determinism_against_none(const fs::path& programs) {
    UncountedSteps uncounted(programs / "nephos_bench_uncounted");
    Automaton automaton(ellipsoid_cube(kEdge, 0.01), random_lattice({kEdge, kEdge, kEdge}));
    std::vector<double> ours, other;
    for (int round = -1; round < 9; ++round) {
        const double a = time_ms([&] { automaton.step(); }), b = uncounted.step_ms();
        if (round < 0) continue;
        ours.push_back(a);
        other.push_back(b);
    }
    return {"step with ellipsoids, 512^3, against the same with xorshift128+ and FMA", median(ours),
            median(other), "<= 1.05x", "the price of counters, order and IEEE arithmetic"};
}

}  // namespace

std::vector<BenchRow> automaton_rows(const fs::path& source, const fs::path& programs) {
    const Extent extent{kEdge, kEdge, kEdge};
    std::vector<BenchRow> rows;
    {
        const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
        rows.push_back(step_against_memcpy("step, p = 0, 512^3, against memcpy of the three planes",
                                           Automaton(cube(kEdge, {0, 0, 0}), random_lattice(extent)),
                                           "<= 1.1x", "random bits everywhere"));
        rows.push_back(step_against_memcpy("step, 200 ellipsoids, p <= 0.01, 512^3, against the same",
                                           grown(ellipsoid_cube(kEdge, 0.01), 40), "<= 3x",
                                           "state grown from the field over 40 steps"));
        rows.push_back(step_against_memcpy(
            "... the same from random bits", Automaton(ellipsoid_cube(kEdge, 0.01), random_lattice(extent)),
            "<= 3x", "cloud in every block, so that each draws its extinction"));
        rows.push_back(step_against_memcpy("step, p = 0.37, 0.41, 0.3 in every cell, 512^3, against the same",
                                           Automaton(cube(kEdge, {0.37, 0.41, 0.3}), random_lattice(extent)),
                                           "<= 12x", "dense draw: 384 MiB of Philox bytes a step"));
        rows.push_back(first_state());
        rows.push_back(research_step());
        rows.push_back(cumulus_against_numpy(source));
        rows.push_back(determinism_against_none(programs));
    }
    rows.push_back(two_threads_against_one());
    return rows;
}

}  // namespace nephos::bench
