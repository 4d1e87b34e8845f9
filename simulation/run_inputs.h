// SPDX-License-Identifier: Apache-2.0
#pragma once

// The files that the scene of a run names, and that decide what the run writes. The manifest lists each with its place and
// checksum ("inputs"): a run goes on only with the pictures that it began with, and `nephos verify --replay` finds the files
// from any folder. What is in the files of the simulation is part of its hash besides, which alone decides about these: a
// state that was written anew with the same cells is the same. A manifest of an earlier version lists none; its run goes on
// with whatever pictures there are.

#include <filesystem>
#include <string>
#include <vector>

#include "core/digest.h"
#include "scenes/format/named_files.h"
#include "scenes/format/scene.h"
#include "simulation/run_folder.h"

namespace nephos {

struct RunInput {
    std::string key;             // of the scene, each file of a list with its number: "model[0].textures[1]"
    std::filesystem::path path;  // relative to the folder of the run, or absolute
    FileDigest digest;
    FileKind kind = FileKind::picture;  // not in the manifest
};

// Selects the files that count for a run.
struct InputUse {
    bool first_states = true;  // false: it began with a checkpoint
    bool pictures = true;      // false: it draws none
};

// Return the files of a scene for a run into `folder`, which need not be there yet; those of a run. Read each once. Throw
// Error(io) with the place of the key.
std::vector<RunInput> inputs_of(const Scene& scene, const std::filesystem::path& folder, const InputUse& use);
std::vector<RunInput> inputs_of(const RunSettings& settings);

// Returns a text that names the files of a scene whose content is not as it was, at most three; empty where there is none,
// or nothing is known of them. Only of `kinds`.
std::string changed_inputs(const std::vector<RunInput>& before, const std::vector<RunInput>& now,
                           const std::vector<FileKind>& kinds);

// Sets the names of a scene's files, which its run found from the folder where the command was called, to where they are
// seen from here. Leaves those that are not there.
void locate_inputs(Scene& scene, const std::filesystem::path& folder, const std::vector<RunInput>& inputs);

// Return the path by which the manifest in `folder` names a file, and the one by which it is found then.
std::filesystem::path path_from(const std::filesystem::path& folder, const std::filesystem::path& file);
std::filesystem::path path_of(const std::filesystem::path& folder, const std::filesystem::path& named);

}  // namespace nephos
