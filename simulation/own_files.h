// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tells the files that the run in a folder has written from those that others have put there.

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "core/digest.h"
#include "core/paths.h"
#include "scenes/format/scene.h"
#include "simulation/manifest.h"
#include "simulation/run_folder.h"

namespace nephos {

// Returns whether a file has the name of a frame of a run of this name: NAME_0001.vdb, .png or .exr.
bool is_frame_of(const std::string& file, const std::string& name);

// Returns whether a run of the scene writes a frame of `range` to this path, or a picture of it where it has
// `pictures`.
bool is_frame_place(const RunFolder& folder, const Scene& scene, const SimulationRange& range, bool pictures,
                    const std::filesystem::path& file);

// Returns whether a frame's file names such a hash in its metadata, which stands at its beginning in VDB, PNG
// and EXR files alike, and ahead of the pictures in a video: that of its scene (frames_hash()), or of the state of a density
// file. Throws ReadFailure.
bool names_hash(const std::filesystem::path& file, const std::string& hash);

// The files of a run, by whatever path through links they are reached:
// - of a complete run those that its manifest lists, with the content that it wrote;
// - of one that is not complete, and of the kinds that a manifest of an earlier version does not list, those
//   at the places to which it writes; its frames and its video name its scene, its tables begin as the manifest says, where
//   it says so.
class OwnFiles {
  public:
    // `run` tells the name of its files; `scene`: that of the run, must outlive this. Throws Error(io) where
    // the manifest cannot be read.
    OwnFiles(const std::filesystem::path& folder, EarlierRun run, const Scene& scene);

    // Returns what is wrong with a file that the run has not written, as a sentence without its end; nothing
    // where it has. Reads the file. Throws ReadFailure.
    std::optional<std::string> why_foreign(const std::filesystem::path& file) const;

  private:
    // Returns whether the run writes to a path.
    bool is_place(const std::filesystem::path& file) const;
    // Returns whether it has written to a path.
    bool is_own_path(const std::filesystem::path& file) const;
    // Returns the path that the run itself has for a file, which may be reached by another one; nothing where
    // it has none.
    std::optional<std::filesystem::path> own_path(const std::filesystem::path& file) const;

    RunFolder folder_;
    EarlierRun run_;
    const Scene& scene_;
    std::map<std::string, FileDigest> listed_;  // by path below the folder
    bool lists_frames_ = false, lists_tables_and_video_ = false;
    std::multimap<FileIdentity, std::filesystem::path> folders_;  // that the run writes to
};

}  // namespace nephos
