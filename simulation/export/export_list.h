// SPDX-License-Identifier: Apache-2.0
#pragma once

// export.json: the options of an export, and each of its files with bytes, checksum and source (not installed).

#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"
#include "simulation/export/export.h"
#include "simulation/export/export_work.h"
#include "simulation/export/sequence.h"

namespace nephos {

class CheckedJson;

// What a file of an export is made of: a density file, or nothing for texts.
struct ExportSource {
    std::filesystem::path path;
    std::optional<FileDigest> digest;
};

class ExportList {
  public:
    // Takes over the list of an earlier export with the same options into the folder that is locked, and removes the
    // temporary files of one that was killed. `lock` must outlive this. Throws Error(usage) when the folder
    // holds an export with other options, or a file without a list, or as ExportWork(); Error(io) when the list is damaged.
    ExportList(const FolderLock& lock, const ExportOptions& options,
               const std::vector<ExportSequence>& sequences);

    // Throws Error(usage) naming the first of these files that is there and that no export has written.
    void require_free(const std::vector<std::string>& names) const;
    // Writes the list, which says that it is not complete, and makes ready for files: from here on the folder is known as that of
    // an export. Throws Error(io).
    void begin();
    // Returns the entry of a file that is there as it was listed, and was made of this source: it need not be written
    // again. Thread-safe.
    std::optional<ExportedFile> kept_file(const std::string& name, const ExportSource& source) const;
    // Returns what is to be told of a file that is not as it was listed, and is about to be made again; empty: nothing. Thread-safe.
    std::string note_on_change(const std::string& name) const;
    // Calls `write` with the path that it is to write, which returns whether nothing of the source is left in the file, and returns
    // the entry of the file, with its checksum. It is noted
    // before it gets its place (ExportWork), in which nothing may stand but a file that is listed. Thread-safe for different
    // files. Throws Error(usage) naming what stands there, Error(io); exceptions of `write` pass through.
    ExportedFile write_file(const std::string& name, const ExportSource& source, std::string_view format,
                            const std::function<bool(const std::filesystem::path& path)>& write);
    // List a file; those of frames in their order.
    void add_kept(ExportedFile file);
    void add_written(ExportedFile file);
    // Removes what an earlier export wrote and this one does not list, so that the folder holds what was asked for last; but not
    // what somebody changed since. Returns what is to be told of that. Throws Error(io).
    std::vector<std::string> remove_left_over();
    // Writes the list, of one that is not complete with what was written beyond it and what an earlier one had listed, and ends the
    // work. Nothing is written after it. Throws Error(io).
    void end(bool complete);
    void end_quietly() noexcept;

    const std::vector<ExportedFile>& files() const { return files_; }
    std::size_t written() const { return written_; }
    std::size_t kept() const { return kept_; }

  private:
    void write(bool complete) const;
    void remove(const std::string& name, const Descriptor& file) const;
    void require_files() const;
    std::string below_folder(const std::filesystem::path& source) const;

    const FolderLock& lock_;
    std::filesystem::path folder_;
    std::string head_;  // JSON of all but the files
    ExportWork work_;
    bool has_list_ = false;  // there is one, of this export or an earlier one
    bool was_interrupted_ = false;
    bool has_notes_ = false;                       // an export that was killed has left some
    std::map<std::string, ExportedFile> earlier_;  // what was there, by its name
    std::map<std::string, ExportedFile>
        made_;          // what this one has written, also of frames whose turn has not come
    std::mutex mutex_;  // of made_
    std::vector<ExportedFile> files_;
    std::size_t written_ = 0, kept_ = 0;
};

// What verify needs of a list.
struct ListedExport {
    bool complete = false;
    std::vector<ExportedFile> files;
    struct Sequence {
        std::string name, layer;  // layer: empty for all together
        VolumeLayout layout;
        int levels = 1;
        float scale = 1;
    };
    std::vector<Sequence> sequences;
    std::map<std::string, VoxelType> types;  // by the name of a format
    bool half_voxel_shift = false;
    NanoQuantise quantise = NanoQuantise::none;
    int brick_edge = 32;
    std::string grid;
};

// Reads the entry of a file in a list. Throws Error(io) naming the value that is not what it must be.
ExportedFile exported_file(const CheckedJson& json);

// Returns the sequence of a listed file by its name; null where it is of none.
const ListedExport::Sequence* sequence_of(const ListedExport& list, const std::string& name);

// Throws Error(io) naming the file, and the value that is not what it must be.
ListedExport read_export(const std::filesystem::path& folder);

// Returns whether an error is of this file, or one in this folder, and not of the program, as that a part of it cannot be loaded.
bool is_of_file(const std::filesystem::path& path, const Error& error);

// Compares the sidecars with the list, and with the box of their sources, where those are there and unchanged; none where there is
// no sidecar. That of a complete export of volumes must be there. Beside what is wrong with them a check of its own tells the sources
// that cannot be read.
std::vector<Check> check_sidecars(const std::filesystem::path& folder, const ListedExport& list);

}  // namespace nephos
