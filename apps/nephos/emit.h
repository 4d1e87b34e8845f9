// SPDX-License-Identifier: Apache-2.0
#pragma once

// Hands a sweep to an engine that runs it on many machines: writes its plan, and a file that the engine reads.

#include <cstdint>
#include <filesystem>
#include <string>

#include "study/sweep_plan.h"

namespace nephos {

enum class Engine {
    slurm,      // FOLDER/sweep.slurm, an array script: sbatch sweep.slurm
    snakemake,  // FOLDER/Snakefile: snakemake --cores N
    parallel,   // FOLDER/sweep.parallel, a command a line: parallel --jobs N < sweep.parallel
};

// Returns the engine of a word. Throws Error(usage) that quotes it.
Engine parse_engine(const std::string& text);

// Writes the plan, the scene and the file for an engine that runs `shards` parts, none of which shares a file with another.
// Returns what the user types next, a command a line. Throws Error(io).
std::string emit_sweep(const SweepPlan& plan, Engine engine, std::uint32_t shards,
                       const std::filesystem::path& folder);

}  // namespace nephos
