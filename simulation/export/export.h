// SPDX-License-Identifier: Apache-2.0
#pragma once

// Density for other programs: from a run, or any fog volumes, to files of a flat folder, each sequence with a sidecar
// that says what the bytes mean, and a list with checksums.
//
//     DIR/NAME[_LAYER]_0001.EXT ...    a file a frame and format
//     DIR/NAME[_LAYER].volume.json     the sidecar (docs/volume.schema.json), for every format
//     DIR/NAME[_LAYER].usda, .pvd      a scene of all frames for USD, a list of times for ParaView
//     DIR/README.txt                   the steps for the target
//     DIR/export.json                  the options, each file with bytes and XXH3-128
//
// Each file appears complete or not at all. An export that was interrupted goes on: what is listed and agrees with its
// checksum is not written again.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/digest.h"
#include "density/export/nanovdb_file.h"
#include "density/export/volume.h"
#include "simulation/verify.h"

namespace nephos {

// Forms of a summary of the layers, for simulators that take no voxels.
enum class WeatherFormat { layers, metar, xplane, wpr, cigi };

enum class ExportFormat { raw, vti, dds, ktx2, nvdb, usd, slices, vdb, bricks, flightgear };

struct ExportOptions {
    std::filesystem::path source;                // folder of a run, or a VDB file
    std::vector<std::filesystem::path> files{};  // of a sequence of VDB files instead, in order
    std::filesystem::path folder;
    std::string target;  // name of the preset, for the README; may be empty
    std::vector<ExportFormat> formats;
    std::vector<WeatherFormat> weather;  // of a run
    std::optional<VoxelType> type;       // none: that of the format (format_type())
    bool range_auto = false;  // divide by the largest value of the sequence, so that all codes are used
    std::optional<std::string> layer;  // a name, or "each"; none: all layers together
    // Frames by their numbers, each `frame_step`-th from `first_frame` on; 0: from the first that there is, of a run 1, of files
    // the number of the first one.
    int first_frame = 0, last_frame = 1 << 30, frame_step = 1;
    VolumeLayout layout;
    std::optional<double> voxel_m;  // edge of a voxel; a multiple of the grid's
    std::optional<int> largest_side;
    bool mips = false;
    int brick_edge = 32;            // of `bricks`, without the border
    std::string velocity_name;      // of the wind in VDB files; empty: none
    bool half_voxel_shift = false;  // VDB and USD: moved by half a voxel along -x -y -z, for Blender
    bool zip = false;               // compress VTI and NanoVDB
    bool legacy_dds = false;
    NanoQuantise quantise = NanoQuantise::none;
    std::optional<std::uint64_t> budget_bytes;  // the finest voxels whose frame takes at most this
    int limit_side = 0;                         // of the target; 0: none
    std::string grid;                           // of a foreign file
};

struct ExportedFile {
    std::filesystem::path path;  // below the folder
    FileDigest digest;
    // What it was made of, for verify and for an export that goes on: empty for lists and texts.
    std::string source, format;
    std::optional<FileDigest> source_digest{};
    bool is_lost = false;  // nothing of its source is left in it: all is below the first step of its type
};

// One sequence of an export: a layer, or all together.
struct PlannedSequence {
    std::string name;   // of its files
    std::string layer;  // empty: all together
    VolumeBox box;
    int factor = 1, levels = 1;
    std::size_t frames = 0;
    std::uint64_t bytes_a_frame = 0;    // of all formats whose size is known beforehand
    std::uint64_t estimated_bytes = 0;  // of one frame of the others
};

struct ExportReport {
    std::vector<PlannedSequence> sequences;
    std::vector<std::string> notes;  // adaptations, a sentence each
    std::vector<ExportedFile> files;
    std::size_t written = 0, kept = 0;
    std::uint64_t needed_bytes = 0;  // of all frames, with what is estimated
};

// Steps are frames of volumes that are written and frames of weather that are read. False: stop.
using ExportProgress = std::function<bool(std::size_t done, std::size_t steps)>;

// Throws Error(usage) for an option that none of the formats takes: nothing that a user asks for is left out in silence.
// `given`: what the user wrote; `options`: the same with what a preset added.
void refuse_unused(const ExportOptions& given, const ExportOptions& options);

// Returns what an export would write, and writes nothing. Throws Error(usage) when the options contradict each other,
// the source or the target's limits; Error(io) as load_density() and read_run().
ExportReport plan_export(const ExportOptions& options);

// Exports. Throws as plan_export(), and Error(io) when the disk has not the space, before the first byte, or a file
// cannot be written; what was written before is then listed and kept.
ExportReport run_export(const ExportOptions& options, const ExportProgress& progress = {});

// Returns the type of voxels in a format when the options name none.
VoxelType format_type(ExportFormat format);

// Names of formats and presets, and what they are.
struct NamedFormat {
    ExportFormat format;
    std::string_view name, extension, description;
};
const std::vector<NamedFormat>& export_formats();

struct NamedWeather {
    WeatherFormat format;
    std::string_view name, extension, description;
};
const std::vector<NamedWeather>& weather_formats();

struct ExportPreset {
    std::string name, description;
    void (*apply)(ExportOptions& options);
    std::string
        readme;  // the steps, with {NAME}, {FIRST}, {COUNT}, {VOXEL}, {EXTINCTION} and {SHIFT} to fill in
};
const std::vector<ExportPreset>& export_presets();

// Returns true when the folder has a list of an export.
bool is_export_folder(const std::filesystem::path& folder);

// Returns the folder of the export that lists the file, or whose list it is, links followed; nothing where its folder has no list
// that can be read. Throws ReadFailure where the system cannot say.
std::optional<std::filesystem::path> export_with_file(const std::filesystem::path& file);

// Checks the files of an export against its list, and the voxels of each against the source's within the error of
// their type, where the source is still there. Throws Error(io) when the list cannot be read.
Verification verify_export(const std::filesystem::path& folder, const VerifyOptions& options);

}  // namespace nephos
