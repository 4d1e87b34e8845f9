// SPDX-License-Identifier: Apache-2.0
#pragma once

// The hidden folder in which an export writes its files until it has noted them: an export that was killed so tells its own files
// from others' (not installed).

#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/descriptor.h"
#include "simulation/export/export.h"
#include "simulation/folder_lock.h"

namespace nephos {

// The name of that folder in the folder of the export. It is there while an export is at work, or after one that was killed.
inline constexpr const char* kExportWork = ".nephos-export";

// Returns the entry of a file in a list.
nlohmann::ordered_json export_entry(const ExportedFile& file);

// Returns the file of its notes, which is its user's alone.
std::filesystem::path notes_of(const std::filesystem::path& folder);

// Returns the files that an export which was killed has noted, in their order: a later one of a name is the newer. Whether they got
// their places is not known. Lines that are torn or damaged are left out.
std::vector<ExportedFile> noted_files(const std::filesystem::path& folder);

// For the holder of the folder's lock alone.
class ExportWork {
  public:
    // Holds the hidden folder that a killed export has left. Throws Error(usage) when something is in its place that no export has
    // made, of this user or of who has written the list; Error(io). `lock` must outlive this.
    explicit ExportWork(const FolderLock& lock);

    // Makes the hidden folder, without what a killed export left in it, which must be listed by now. Throws Error(usage) when something
    // was put in its place since; Error(io).
    void begin();
    // Throws Error(io) when the folder or the hidden one is not in its place any more: another might be.
    void require_in_place() const;
    // Calls `write` with a path in the hidden folder, which leads there also when that is moved or another is put in its place.
    // Exceptions of `write` pass through; those that name a file there name it by its path in the folder.
    void write(const std::string& name,
               const std::function<void(const std::filesystem::path& path)>& write) const;
    // Returns the checksum of a file that was written there. Throws Error(io).
    FileDigest digest_of(const std::string& name) const;
    // Notes a file that was written there, and flushes the note to the device. Thread-safe. Throws Error(io).
    void note(const ExportedFile& file);
    // Gives a noted file its place. Thread-safe. Throws Error(io); Error(usage) naming what stands there. After an exception the
    // file has no place.
    void place(const std::string& name);
    // The same where a file is listed: its content is replaced, its permissions stay, and links lead to it (copy_atomically()). Throws
    // Error(io).
    void replace(const std::string& name);
    // Flushes the names of all places to the device, once they are begun. Throws Error(io).
    void flush() const;
    // Removes the hidden folder, once it is begun: all that was noted is listed. Throws Error(io).
    void end();

  private:
    void open();
    void clear();
    void copy_to_free_place(const std::string& name) const;
    bool is_trusted_owner(unsigned user) const;
    std::filesystem::path held_path_of(const std::string& name) const;
    std::vector<std::string> held_names() const;

    const FolderLock& lock_;
    const std::filesystem::path folder_, path_;  // of the export; the hidden one in it
    Descriptor work_, notes_;                    // the hidden one, and, once begun, the file of notes in it
    std::mutex mutex_;                           // of notes_
};

// Throws Error(usage): a file that is in no list stands at a place. `may_be_own`: the last export was interrupted, and the notes say
// nothing of it, as where somebody has removed them.
[[noreturn]] void throw_place_taken(const std::filesystem::path& path, bool may_be_own = false);

}  // namespace nephos
