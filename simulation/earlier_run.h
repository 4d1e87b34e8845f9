// SPDX-License-Identifier: Apache-2.0
#pragma once

// Examines what a folder holds of earlier runs: what must not be lost, what is in the way, and what a run
// goes on from; and keeps other runs out of it.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "simulation/manifest.h"
#include "simulation/run_folder.h"
#include "simulation/run_inputs.h"
#include "simulation/run_parts.h"
#include "simulation/simulation.h"

namespace nephos {

// Lists the files of a run of this name, and of the one in the folder, that are there already, which must not
// stay between those of a new one; the manifest last: as long as it is there, the rest is known to be of a
// run. Throws ReadFailure.
std::vector<std::filesystem::path> earlier_files(const RunFolder& folder);

// Removes the temporary files of a run that was killed, in the folders that can be held: where another run is
// at work they are no leftovers. Throws Error(io).
void remove_leftovers(const RunFolder& folder, HeldFolders& held);

// What `--resume` finds in a folder.
enum class Resumption {
    nothing_there,  // no run: it starts
    start_anew,  // the same scene, perhaps with fewer steps, but no checkpoint: it starts, and nothing else is lost
    go_on,     // a checkpoint
    complete,  // the same run, complete and without a checkpoint: there is nothing to do
};

// Throws Error(usage) when a new run would overwrite something that it cannot make again: an interrupted run,
// which may hold hours of work, a run of another scene, or a file that no run wrote. `files`:
// earlier_files(). `inputs`: the files that the scene names, as they are now. `found`: what --resume found,
// or nothing_there: then a run of the same scene with fewer steps is another one.
void refuse_to_lose(const RunFolder& folder, const std::vector<std::filesystem::path>& files,
                    const RunSettings& settings, const std::vector<RunInput>& inputs, Resumption found);

// Throws Error(usage) when one of the earlier `files` is one that the run begins with, as a frame of the run
// that is in the folder.
void refuse_to_remove_inputs(const RunFolder& folder, const std::vector<std::filesystem::path>& files,
                             const std::vector<RunInput>& inputs);

// Throws Error(usage) when a complete run that is lengthened would replace a file that is called like one of
// its next frames, or as its video, which is made anew. After an interruption the files at the places of its
// frames may be its own, which are made again: it throws for those of another scene, or of no run.
void refuse_to_replace_next_frames(const RunFolder& folder, const RunSettings& settings);

// Throws Error(usage) when the folder holds a run of another scene, Error(io) when its manifest cannot be
// read.
Resumption find_resumption(const RunSettings& settings, const RunFolder& folder);

// Throws Error(io) unless the tables of statistics begin with what the manifest says that the run had
// written, as require_table_of_run(). One that is not there is its reader's to miss.
void require_tables_of_run(const RunFolder& folder, const EarlierRun& run, std::string_view cure = {});

// Throws Error(io) naming a table of a complete run that has more than the manifest lists: rows of that run are none of it.
void require_nothing_appended(const RunFolder& folder, const EarlierRun& run);

// Returns the simulation of the folder's checkpoint. The scene may be that of the first call with a larger
// `time.steps`; frames that were written before then name the hash of that scene. `inputs`: the files that
// the scene names, as they are now. Throws Error(usage) when it is another scene, a picture that decides
// pixels is another one than then, or other frames were asked for, and as Simulation, naming the file.
Simulation resumed_simulation(const RunSettings& settings, const RunFolder& folder,
                              const std::vector<RunInput>& inputs);

}  // namespace nephos
