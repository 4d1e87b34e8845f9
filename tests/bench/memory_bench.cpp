// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/memory_bench.h"

#include <string>

#include <unistd.h>

#include "automaton/lattice.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/reader.h"
#include "tests/bench/program_cost.h"

namespace nephos::bench {
namespace {

namespace fs = std::filesystem;
constexpr double kMiB = 1024.0 * 1024.0;

}  // namespace

std::vector<BenchRow> memory_rows(const fs::path& source, const fs::path& command) {
    const fs::path scene_file = source / "scenes/large.toml";
    const Scene scene = read_scene(scene_file);
    const fs::path folder = fs::temp_directory_path() / ("nephos_bench_" + std::to_string(::getpid()));
    const double peak = cost_of(
        {command, "run", scene_file, "--no-render", "--frames", "1..3", "--threads", "1", "--out", folder}).peak_mib;
    const DensityGrid density = read_density(frame_path(folder / "density", scene.name, 1));
    const double exported = cost_of({command, "export", folder, "--to", "dds", "--frames", "1", "--threads",
                                     "1", "--out", folder / "dds"}).peak_mib;
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
