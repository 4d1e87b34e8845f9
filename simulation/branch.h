// SPDX-License-Identifier: Apache-2.0
#pragma once

// Runs that branch off another one: they start from its checkpoint, under a scene that may have changed, in a folder of
// their own. The rows of statistics up to there are those of the other run; frames begin with its next one.

#include <filesystem>
#include <string>

#include "simulation/run_folder.h"

namespace nephos {

// Makes a run of the settings' scene a branch off the run whose checkpoint, or folder with one, is `from`: sets its range
// and its simulation hash, which has that of the checkpoint's state in it. Throws Error(io) when there is no checkpoint
// that can be read, Error(usage) when the scene ends before it.
void branch_off(RunSettings& settings, const std::filesystem::path& from);

// Returns the scene of the run that a checkpoint belongs to, as canonical text, from the manifest beside it. Throws
// Error(io).
std::string scene_text_beside(const std::filesystem::path& from);

// Starts a branch in its empty folder: copies the statistics up to the checkpoint, and restores the simulation. Throws
// Error(usage) when the state does not fit the scene.
Simulation branched_simulation(const RunSettings& settings, const RunFolder& folder);

}  // namespace nephos
