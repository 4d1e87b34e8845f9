// SPDX-License-Identifier: Apache-2.0
#pragma once

// Runs that branch off another one: they start from its checkpoint, under a scene that may have changed, in a folder of
// their own. The rows of statistics up to there are those of the other run; frames begin with its next one.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "automaton/checkpoint.h"
#include "simulation/run_folder.h"

namespace nephos {

// Makes a run of the settings' scene, of run_settings() with RunStart::checkpoint, a branch off the run whose checkpoint, or
// folder with one, is `from`: sets its range and its simulation hash, which has that of the checkpoint's state in it.
// Throws Error(io) when there is no checkpoint that can be read, Error(usage) when the scene ends before it.
void branch_off(RunSettings& settings, const std::filesystem::path& from);
// The same for a branch that has a checkpoint of its own, and needs that of the other run no more.
void branch_off(RunSettings& settings, BranchPoint point);

// Returns where the run in `folder` branched off when it left a checkpoint of its own, from which it can go on whatever has
// become of the other run; none otherwise, also when its manifest is of an earlier version. `from`: the run that the caller
// takes for the other one; empty: whichever it is. Throws Error(usage) when it is not that one, Error(io) when that or the
// manifest cannot be read.
std::optional<BranchPoint> branch_in(const std::filesystem::path& folder, const std::filesystem::path& from);

// Returns whether a checkpoint is that of `point`, with which a run of the scene with this simulation hash began.
bool is_branch_point(const Checkpoint& checkpoint, const BranchPoint& point, const Scene& scene,
                     const std::string& simulation_hash);

// Returns the scene of the run that a checkpoint belongs to, as canonical text, from the manifest beside it. Throws
// Error(io).
std::string scene_text_beside(const std::filesystem::path& from);

// Restores the simulation of a branch. Throws Error(usage) when the state does not fit the scene, or the folder is that of
// the other run.
Simulation branched_simulation(const RunSettings& settings, const RunFolder& folder);

// Throws Error(usage) where one of `files`, which the branch takes the place of, is a table of the other run, by links.
void refuse_to_remove_other_run(const RunSettings& settings, const std::vector<std::filesystem::path>& files);

// A table of the other run, open: what is copied is of the file that was checked, whatever gets its name meanwhile.
struct OtherTable {
    std::filesystem::path path, copy;  // in the folder of the branch
    std::string_view header;
    std::ifstream file;
};

// Opens the other run's statistics, of all layers too. Throws Error(io) unless they are those that it has saved, and have the
// rows of all steps before `steps`.
std::vector<OtherTable> tables_of_other_run(const RunSettings& settings, const RunFolder& folder,
                                            std::uint64_t steps);
// Copies these rows. Throws Error(io).
void copy_rows(std::vector<OtherTable>& tables, std::uint64_t steps);

}  // namespace nephos
