// SPDX-License-Identifier: Apache-2.0
#include "apps/nephos/emit.h"

#include "study/folder_contents.h"
#include "study/sweep.h"
#include <fmt/format.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/text.h"

namespace nephos {
namespace {

// exec: the shell becomes nephos, so that the SIGTERM of a preemption or of scancel reaches it and it ends cleanly; what is
// done is kept, and the task that Slurm starts again goes on.
constexpr std::string_view kSlurm = R"(#!/bin/bash
# Runs a sweep in {0} parts: sbatch sweep.slurm, in this folder. Options of sbatch come before those here.
# NEPHOS names the program where it is not in the path.
#SBATCH --job-name=nephos-sweep
#SBATCH --array=0-{1}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=slurm-%A_%a.out
exec "${{NEPHOS:-nephos}}" sweep sweep.toml --shard "$SLURM_ARRAY_TASK_ID/{0}" \
    --workers "${{SLURM_CPUS_PER_TASK:-1}}" --out . --quiet
)";

// The records of a part are no output of its rule: Snakemake removes outputs before it runs a rule again, and they go on. What
// is done is of a number of parts: with another one, part 0 has other runs. Nor are the tables, which it would remove where one of
// them cannot be written. Runs that fail are in failures.csv; any other failure, of a module that is loaded or of a disk, is the rule's.
constexpr std::string_view kSnakemake =
    R"(# Runs a sweep in {0} parts and makes its tables: snakemake --cores N, in this folder.
# NEPHOS names the program where it is not in the path.
import os

NEPHOS = os.environ.get("NEPHOS", "nephos")

rule tables:
    input: expand("shards/{{shard}}-of-{0}.done", shard=range({0}))
    output: touch("tables.done")
    shell: "{{NEPHOS:q}} merge . --quiet"

rule shard:
    input: "sweep.toml", "scene.toml"
    output: touch("shards/{{shard}}-of-{0}.done")
    threads: 1
    shell: "{{NEPHOS:q}} sweep sweep.toml --shard {{wildcards.shard}}/{0} --workers {{threads}} --out . --quiet --allow-failures"
)";

constexpr std::string_view kProgram = "\"${NEPHOS:-nephos}\"";

}  // namespace

Engine parse_engine(const std::string& text) {
    if (text == "slurm") return Engine::slurm;
    if (text == "snakemake") return Engine::snakemake;
    if (text == "parallel") return Engine::parallel;
    throw Error(ErrorCode::usage, fmt::format("'{}' is not one of slurm, snakemake and parallel", text));
}

std::string emit_sweep(const SweepPlan& plan, Engine engine, std::uint32_t shards,
                       const std::filesystem::path& folder) {
    for (const auto& [name, beginning] : kSweepScripts) require_own(folder / name, beginning, "a sweep");
    write_plan(plan, folder);
    const std::string go = fmt::format("cd -- {}\n", shell_word(folder.string()));
    switch (engine) {
        case Engine::slurm:
            write_atomically(folder / "sweep.slurm", fmt::format(kSlurm, shards, shards - 1));
            return go + "sbatch sweep.slurm\nnephos merge .    # when all tasks are done";
        case Engine::snakemake:
            write_atomically(folder / "Snakefile", fmt::format(kSnakemake, shards));
            return go + "snakemake --cores 2";
        case Engine::parallel: {
            std::string lines;
            for (std::uint32_t shard = 0; shard < shards; ++shard)
                lines += fmt::format("{} sweep sweep.toml --shard {}/{} --workers 1 --out . --quiet\n",
                                     kProgram, shard, shards);
            write_atomically(folder / "sweep.parallel", lines);
            return go + "parallel --jobs 2 --joblog parallel.log < sweep.parallel\nnephos merge .";
        }
    }
    return {};
}

}  // namespace nephos
