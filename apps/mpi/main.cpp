// SPDX-License-Identifier: Apache-2.0

// nephos-mpi: steps one lattice that is too large for one process.
//
//     mpirun -n 4 nephos-mpi SCENE --steps 100 --hash --out big

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <mpi.h>
#include <tbb/global_control.h>

#include "apps/mpi/ranks.h"
#include "apps/mpi/statistics_table.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/man_page.h"
#include "core/error.h"
#include "core/text.h"
#include "core/wind_field.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/reader.h"
#include "simulation/layer_simulation.h"
#include "simulation/scene_files.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

struct Arguments {
    std::string scene;
    std::vector<std::string> settings;
    std::optional<std::uint64_t> steps, seed;
    std::string out;
    int slab_levels = 8, threads = 1;
    bool hash = false, write_state = false, overwrite = false;
};

// Writes cld of the own levels, some at a time, as files that stand in their place in the world: a tree of OpenVDB is made of
// these levels alone, and no dense copy of anything.
void write_slabs(const SlabAutomaton& slab, int levels_each, const std::filesystem::path& folder) {
    const BitPlaneView cld = slab.cld();
    const std::size_t level_words = cld.words_per_row * std::size_t(cld.extent.y);
    for (int k = 0; k < cld.extent.z; k += levels_each) {
        const int levels = std::min(levels_each, cld.extent.z - k);
        VdbContent content;
        content.cld = BitPlaneView{{cld.extent.x, cld.extent.y, levels},
                                   cld.words_per_row,
                                   cld.words + std::size_t(k) * level_words};
        content.cells = slab.options().placement;
        content.cells.origin_m.z += (slab.first() + k) * content.cells.cell_size_m;
        VdbMetadata metadata;
        metadata.seed = slab.options().seed;
        metadata.time_step_s = slab.options().time_step_s;
        metadata.time_s = double(slab.steps()) * slab.options().time_step_s;
        write_vdb(folder / fmt::format("levels_{:05}.vdb", slab.first() + k), content, metadata);
    }
}

void simulate(const Arguments& a) {
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, std::size_t(a.threads));
    const Scene scene = with_files(read_scene(a.scene, a.settings, SceneUse::without_frames));
    if (!scene.layers.empty() || scene.initial_state_file)
        throw Error(ErrorCode::usage,
                    a.scene + ": one lattice without layers and without initial_state is expected");
    if (!is_profile(scene.automaton.wind.fields))
        throw Error(
            ErrorCode::usage,
            a.scene +
                ": has a `wind_field` that differs within a level or has a vertical part: expected a "
                "horizontal wind that is the same all over a level, or `nephos run` or `nephos hash`, which "
                "step all of a lattice in one process");
    AutomatonOptions options = scene.automaton;
    if (a.seed) options.seed = *a.seed;
    Ranks ranks(options);
    std::optional<StatisticsTable> table;
    if (!a.out.empty() && ranks.rank() == 0) table.emplace(a.out, a.overwrite, scene);
    const std::uint64_t steps = a.steps.value_or(scene.steps);
    for (std::uint64_t step = 0;; ++step) {
        std::string hash;
        if (a.hash) hash = ranks.hash().hex();
        if (!a.out.empty()) {
            const CloudStatistics statistics = ranks.statistics();
            if (table) table->add(step, double(step) * options.time_step_s, statistics, hash);
        }
        if (a.hash && ranks.rank() == 0) {
            const std::string line = fmt::format("{} {}\n", step, hash);
            if (std::fputs(line.c_str(), stdout) < 0 || std::fflush(stdout) != 0)
                throw Error(ErrorCode::io,
                            std::string("standard output: cannot write: ") + std::strerror(errno));
        }
        if (step == steps) break;
        ranks.step();
    }
    if (a.write_state) {
        MPI_Barrier(MPI_COMM_WORLD);  // rank 0 has made the folder
        write_slabs(ranks.slab(), a.slab_levels, a.out);
    }
}

// As the numbers of the command: decimal digits alone.
CLI::Validator whole_number(std::uint64_t max) {
    return {[max](const std::string& text) {
                std::uint64_t number = 0;
                const char* end = text.data() + text.size();
                const auto [last, error] = std::from_chars(text.data(), end, number);
                if (error == std::errc() && last == end && number <= max) return std::string();
                return fmt::format("'{}' is not a whole number from 0 to {}", text, max);
            },
            ""};
}

void add_options(CLI::App& app, Arguments& a) {
    app.formatter(std::make_shared<HelpPage>());
    app.set_help_flag("-h,--help", "This page")->group("General");
    app.set_version_flag("-V,--version", fmt::format("nephos {}", version()), "Version of nephos")
        ->group("General");
    app.add_option("SCENE", a.scene,
                   "Scene of one lattice, without layers, `initial_state` and winds that differ within a "
                   "level or have a vertical part")
        ->required();
    app.add_option("--set", a.settings, "Change a key of the scene; may be repeated")
        ->type_name("KEY=VALUE")
        ->expected(1)
        ->allow_extra_args(false)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    app.add_option("--seed", a.seed, "Seed instead of the scene's")
        ->type_name("N")
        ->check(whole_number(std::numeric_limits<std::uint64_t>::max()));
    app.add_option("--steps", a.steps, "Steps instead of the scene's time.steps")
        ->type_name("N")
        ->check(whole_number(kMaxSteps));
    app.add_flag("--hash", a.hash, "Print the state hash after every step, as `nephos hash` does");
    app.add_option("-o,--out", a.out, "Folder for statistics.csv, with a row a step")
        ->type_name("DIR")
        ->check([](const std::string& text) {
            return text.empty() ? std::string("expected a folder") : std::string();
        });
    app.add_flag("--overwrite", a.overwrite, "Replace statistics.csv and levels of an earlier call")
        ->needs("--out");
    app.add_flag("--write-state", a.write_state,
                 "Write the last state's cld to --out, as VDB files of some levels each")
        ->needs("--out");
    app.add_option("--slab-levels", a.slab_levels, "Levels of such a file (default: 8)")
        ->type_name("N")
        ->check(CLI::Range(1, 65536).description(""));
    app.add_option("--threads", a.threads, "Threads of each process (default: 1)")
        ->type_name("N")
        ->check(CLI::Range(1, 1024).description(""));
    app.footer(
        "Each process owns some levels, at least 8 of them; bits, hashes and statistics are those of one\n"
        "process.\n"
        "Example: mpirun -n 4 nephos-mpi large.toml --steps 100 --hash --out large");
}

int parse(CLI::App& app, int argc, char** argv) {
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        int rank = 0;
        MPI_Comm_rank(MPI_COMM_WORLD, &rank);
        if (rank > 0) return error.get_exit_code() == 0 ? 0 : int(ErrorCode::usage);
        if (app.exit(error) != 0) return int(ErrorCode::usage);
        if (std::cout.flush()) return 0;
        std::fputs("error: standard output: cannot write\n", stderr);
        return int(ErrorCode::io);
    }
    return -1;
}

}  // namespace
}  // namespace nephos

int main(int argc, char** argv) {
    nephos::Arguments arguments;
    CLI::App app("Steps one lattice on several processes", "nephos-mpi");
    nephos::add_options(app, arguments);
    // For the package: an option that the page does not name, and that takes no processes.
    if (argc == 2 && std::string_view(argv[1]) == "--man") {
        const std::string status = "0 done, 2 usage or scene, 3 input or output.";
        const std::string page =
            nephos::man_page(app, {"nephos-mpi", nephos::usage_line(app), status, {"nephos", "mpirun"}});
        return std::fputs(page.c_str(), stdout) < 0 || std::fflush(stdout) != 0 ? int(nephos::ErrorCode::io)
                                                                                : 0;
    }
    int provided = 0, rank = 0;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    int status = nephos::parse(app, argc, argv);
    if (status < 0) {
        status = 0;
        try {
            nephos::simulate(arguments);
        } catch (const nephos::Error& error) {
            std::fprintf(stderr, "error: process %d: %s\n", rank,
                         nephos::escaped(error.what(), "\n").c_str());
            status = int(error.code());
        } catch (const std::exception& error) {
            std::fprintf(stderr, "error: process %d: %s\n", rank,
                         nephos::escaped(error.what(), "\n").c_str());
            status = int(nephos::ErrorCode::io);
        }
        // The others may be waiting for this one.
        if (status != 0) MPI_Abort(MPI_COMM_WORLD, status);
    }
    MPI_Finalize();
    return status;
}
