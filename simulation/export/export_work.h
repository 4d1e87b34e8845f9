// SPDX-License-Identifier: Apache-2.0
#pragma once

// The hidden folder in which an export writes its files until it has noted them: an export that was killed so tells its own files
// from others' (not installed).

#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/descriptor.h"
#include "simulation/export/export.h"

namespace nephos {

// The name of that folder in the folder of the export. It is there while an export is at work, or after one that was killed.
inline constexpr const char* kExportWork = ".nephos-export";

// Returns the entry of a file in a list.
nlohmann::ordered_json export_entry(const ExportedFile& file);

// Returns the files that an export which was killed has noted, in their order: a later one of a name is the newer. Whether they got
// their places is not known. Lines that are torn or damaged are left out.
std::vector<ExportedFile> noted_files(const std::filesystem::path& folder);

// For the holder of the folder's lock alone.
class ExportWork {
  public:
    // Throws Error(usage) when something is in the place of the hidden folder that no export of this user has made; Error(io).
    explicit ExportWork(std::filesystem::path folder);

    // Makes the hidden folder, without what a killed export left in it: what that had noted must be listed by now. Throws Error(io).
    void begin();
    // Returns where a file is to be written.
    std::filesystem::path path_of(const std::string& name) const { return folder_ / kExportWork / name; }
    // Notes a file that was written there, flushes the note to the device, and gives the file its place. Thread-safe. Throws Error(io);
    // Error(usage) naming what stands in that place.
    void publish(const ExportedFile& file);
    // Flushes the names of all places to the device, once they are begun. Throws Error(io).
    void flush() const;
    // Removes the hidden folder, once it is begun: all that was noted is listed. Throws Error(io).
    void end();

  private:
    void open();

    std::filesystem::path folder_;
    Descriptor place_, work_, notes_;  // the folder, the hidden one, and the file of notes in it
    std::mutex mutex_;                 // of notes_
};

// Throws Error(usage): a file of somebody else stands at a place.
[[noreturn]] void throw_place_taken(const std::filesystem::path& path);

}  // namespace nephos
