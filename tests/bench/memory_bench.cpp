// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/memory_bench.h"

#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "automaton/lattice.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/reader.h"

namespace nephos::bench {
namespace {

namespace fs = std::filesystem;
constexpr double kMiB = 1024.0 * 1024.0;

// Runs a program quietly and returns the most memory that it held, in MiB.
double peak_of(const std::vector<std::string>& arguments) {
    std::vector<char*> argv;
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
        const int nowhere = ::open("/dev/null", O_WRONLY);
        ::dup2(nowhere, 1);
        ::dup2(nowhere, 2);
        ::execv(argv[0], argv.data());
        ::_exit(127);
    }
    int status = 0;
    rusage usage{};
    if (child < 0 || ::wait4(child, &status, 0, &usage) != child || status != 0) {
        throw std::runtime_error("failed: " + arguments[0]);
    }
    return double(usage.ru_maxrss) * 1024 / kMiB;
}

}  // namespace

std::vector<BenchRow> memory_rows(const fs::path& source, const fs::path& command) {
    const fs::path scene_file = source / "scenes/large.toml";
    const Scene scene = read_scene(scene_file);
    const fs::path folder = fs::temp_directory_path() / ("nephos_bench_" + std::to_string(::getpid()));
    const double peak = peak_of(
        {command, "run", scene_file, "--no-render", "--frames", "1..3", "--threads", "1", "--out", folder});
    const DensityGrid density = read_density(frame_path(folder / "density", scene.name, 1));
    const double exported = peak_of({command, "export", folder, "--to", "dds", "--frames", "1", "--threads",
                                     "1", "--out", folder / "dds"});
    fs::remove_all(folder);
    const double bits = 3.0 * double(BitPlane::bytes(scene.automaton.extent)) / kMiB;
    const double leaves = double(density.memory_bytes()) / kMiB;
    return {{"large.toml: peak memory (MiB, not ms), against 3x bit planes + leaf data", peak,
             3 * bits + leaves, "<= 1x",
             "bit planes " + std::to_string(int(bits)) + " MiB, leaves " + std::to_string(int(leaves)) +
                 " MiB; the peak includes the program and its libraries"},
            {"large.toml: peak memory of an export to DDS (MiB, not ms)", exported, 0, "<= 700 MiB",
             "one frame, BC4; of the largest of its processes"}};
}

}  // namespace nephos::bench
