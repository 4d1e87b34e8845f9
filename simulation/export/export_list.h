// SPDX-License-Identifier: Apache-2.0
#pragma once

// export.json: the options of an export, and each of its files with bytes, checksum and source (not installed).

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "simulation/export/export.h"
#include "simulation/export/sequence.h"

namespace nephos {

class ExportList {
  public:
    // Makes the folder, and takes over the list of an earlier export with the same options and sources. Throws
    // Error(usage) when the folder holds an export with other options, or a file without a list.
    ExportList(const ExportOptions& options, const std::vector<ExportSequence>& sequences);

    // Returns true when the file is there as it was listed: it need not be written again, and is listed.
    bool keep(const std::string& name);
    // Lists a file that was written; `source` is empty for texts.
    void add(const std::string& name, const std::filesystem::path& source, std::string_view format);
    // Writes the list. Throws Error(io).
    void write(bool complete) const;
    void write_quietly() const noexcept;

    const std::vector<ExportedFile>& files() const { return files_; }
    std::size_t written() const { return written_; }
    std::size_t kept() const { return kept_; }

  private:
    std::filesystem::path folder_;
    std::string head_;  // JSON of all but the files
    std::map<std::string, ExportedFile> earlier_;
    std::vector<ExportedFile> files_;
    std::size_t written_ = 0, kept_ = 0;
};

// What verify needs of a list.
struct ListedExport {
    bool complete = false;
    std::vector<ExportedFile> files;
    struct Sequence {
        std::string name;
        VolumeLayout layout;
        int levels = 1;
        float scale = 1;
    };
    std::vector<Sequence> sequences;
    std::map<std::string, VoxelType> types;  // by the name of a format
    bool half_voxel_shift = false;
    NanoQuantise quantise = NanoQuantise::none;
    std::string grid;
};

// Throws Error(io) naming the file when it cannot be read or is no list.
ListedExport read_export(const std::filesystem::path& folder);

// Returns the grid half a voxel towards -x, -y and -z, sharing its voxels.
DensityGrid shifted_by_half_a_voxel(const DensityGrid& density);

}  // namespace nephos
