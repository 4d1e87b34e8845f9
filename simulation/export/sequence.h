// SPDX-License-Identifier: Apache-2.0
#pragma once

// What an export reads: sequences of density files with all that is known of them (not installed).

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/digest.h"
#include "core/file_stamp.h"
#include "core/wind_field.h"
#include "density/vdb/vdb_file.h"
#include "simulation/export/export.h"

namespace nephos {

struct ListedFrame;
struct RunListing;

struct SourceFrame {
    std::filesystem::path file;
    int number = 1;
    double time_s = 0;
    std::string utc;    // empty without a start
    FileStamp stamp{};  // when it was listed, before its voxels were read
    std::optional<FileDigest> listed{};  // of a run's file: what its manifest says of its bytes
    bool is_plain = false;               // the file holds nothing but its density as 32-bit floats
};

// A moment and the wind by height at it.
struct WindTable {
    double time_s = 0;
    std::vector<WindLevel> levels;
};

// Bounds what --range auto divides values by.
inline constexpr double kLeastScale = 1e-30, kLargestScale = 1e30;

struct ExportSequence {
    std::string name;   // of its files
    std::string layer;  // empty: all together
    std::vector<SourceFrame> frames;
    Extent extent;
    std::size_t grid_bytes = 0;  // memory of the first frame's grid
    Placement placement;
    VdbMetadata metadata;  // of the first frame; defaults in a file of another program
    bool of_nephos = false;
    std::string genus;  // WMO abbreviation of a layer; empty where the scene names none
    int refine = 1;
    double frames_per_second = 24;
    std::vector<WindTable> wind;
    std::vector<WindField>
        wind_fields;  // that a run's voxels move with beside it; grids without their samples
    // How its boxes are made of its grids.
    VolumeLayout layout;
    int levels = 1;
    float scale = 1;
};

// Reads the run that is exported; nullopt where the source is files. Throws as plan_export().
std::optional<RunListing> run_of(const ExportOptions& options);

// Lists the sequences of a run, as it was read, or of files, with their layout. Reads the first frame of each. Throws as
// plan_export().
std::vector<ExportSequence> list_sequences(const ExportOptions& options, const std::optional<RunListing>& run,
                                           std::vector<std::string>& notes);

// Take what the first frame of a sequence says of all, and what a frame says of its moment. A file of another program says
// nothing of moments.
void take_first(const LoadedDensity& first, ExportSequence& sequence);
void take_moment(const LoadedDensity& loaded, SourceFrame& frame);

// Formats whose files hold the dense box.
bool is_dense(ExportFormat format);
// Those of them whose files are compressed: made in memory, and at most about as large as the box.
bool is_packed(const ExportOptions& options, ExportFormat format);
// Returns whether its VDB files have a grid of the wind.
bool has_velocity(const ExportOptions& options, const ExportSequence& sequence);
VoxelType type_of(const ExportOptions& options, ExportFormat format);
// Sizes of the levels of a sequence in files of a format: of most all, of some the first alone.
std::vector<std::array<int, 3>> level_sizes(const ExportSequence& sequence, ExportFormat format);
// Returns the bytes of a frame in a dense format; of bricks the most.
std::uint64_t dense_bytes(const ExportOptions& options, const ExportSequence& sequence, ExportFormat format);
// USD refers to VDB files, which are written with it. Sorted, each once.
std::vector<ExportFormat> all_formats(const ExportOptions& options);
// Returns the summaries of weather, each once.
std::vector<WeatherFormat> all_weather(const ExportOptions& options);

// Returns a frame of a run, of a layer or of all together, with what its manifest says of the file. Throws as density_file();
// Error(io) where there is no such file.
SourceFrame frame_of_run(const RunListing& run, const ListedFrame& frame,
                         const std::optional<std::string>& layer);

// Returns a sentence where what was read of a run's file is not what its manifest lists, else "".
std::string damage_note(const SourceFrame& frame, const FileDigest& read);

// Returns whether a frame is to be exported; the source begins with the number `least`.
bool is_wanted(const ExportOptions& options, int number, int least);

// Throws Error(io) when a file is not what it was when it was listed: its voxels may then be of another content than its digest.
void require_unchanged(const SourceFrame& frame);

// Returns the name of a file: NAME_0001.EXT.
std::string frame_name(const ExportSequence& sequence, int number, ExportFormat format);

// Returns the printf pattern of these names, by the frame's number: NAME_%04d.EXT, a % of the name doubled.
std::string frame_pattern(const std::string& name, const NamedFormat& format);

// What is known of a frame once it was read.
struct FrameFigures {
    double sum = 0, max = 0;
};

enum class SidecarUse {
    file,      // NAME.volume.json
    in_frame,  // in the file of each frame: nothing that depends on how many there are, or when they are
};

// Return the text of the sidecar, of the USD scene of all sequences, and of the README of the options' preset.
std::string sidecar_text(const ExportOptions& options, const ExportSequence& sequence,
                         const std::vector<FrameFigures>& figures, SidecarUse use = SidecarUse::file);
std::string usd_text(const ExportOptions& options, const std::vector<ExportSequence>& sequences);
std::string readme_text(const ExportOptions& options, const std::vector<ExportSequence>& sequences);

}  // namespace nephos
