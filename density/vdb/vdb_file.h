// SPDX-License-Identifier: Apache-2.0
#pragma once

// Density grids as OpenVDB files. Writing follows the conventions of other programs; reading happens in a
// child process, so that a damaged or oversized file gives an error and no crash.
//
// World and index space of a file: metres, right-handed, z up; OpenVDB's index (i, j, k) is the CENTRE of
// voxel (i, j, k), so the transform is: world = (i, j, k) * voxel + origin + voxel / 2. All grids of a file
// share it, but for the wind over large boxes, whose voxels are larger.
//
// clang-format off
//
//     grid          type            content
//     density       float, half     fog volume, 0..1, with detail somewhat above; the two extreme corners are active with value 0
//     hum act cld   bool            active and true where the bit is 1; on request
//     vel           vec3s           wind in m/s (east, north, up), in the whole box, in voxels of velocity_voxel(); on request
//
// The two corner voxels of `density` make the active bounds, and with them OpenVDB's own `file_bbox_min` and
// `file_bbox_max`, the same in every file of a sequence, clouds or none. The other grids keep the bounds of
// what they hold; nephos_bbox_min/max say the constant ones. Where density is refined, one cell is refine^3
// equal voxels in the bool grids.
//
// Metadata, in the file and in each grid:
//
//     nephos_units                      string   "m"
//     nephos_up_axis                    string   "z"
//     nephos_extinction_per_m           double   extinction coefficient where density is 1
//     nephos_time_s                     double   simulated time of this frame
//     nephos_time_step_s                double   simulated time of one automaton step
//     nephos_frames_per_second          double   frames per second of film
//     nephos_time_scale                 double   simulated seconds per second of film
//     nephos_seed                       string   decimal, 0..2^64-1
//     nephos_scene_hash                 string   hash of the scene but for its number of steps
//     nephos_state_hash                 string   hash of the automaton's state at or before this frame
//     nephos_version                    string   version of nephos that wrote the file
//     nephos_random_stream_version      int32    version of the random stream
//     nephos_refine                     int32    voxels per cell and axis; in a grid: of that grid
//     nephos_bbox_min, nephos_bbox_max  vec3i    bounds of the voxels, both included; constant over a sequence; in a grid: its own
//     nephos_wind                       string   "[[height m, east m/s, north m/s], ...]"; missing in calm air
//     nephos_period_m                   vec3d    where it repeats, metres; 0 on an axis that does not
//
// and where the scene has a place on Earth (core/place.h):
//
//     nephos_latitude_deg, nephos_longitude_deg, nephos_height_m, nephos_geoid_height_m, nephos_heading_deg  double
//     nephos_height_datum               string   "msl" or "ellipsoid"
//     nephos_start_utc, nephos_utc      string   the moments of simulated time 0 and of this frame; missing without
//     nephos_ecef_from_world            mat4d    world to ECEF (WGS 84), by rows, for column vectors
//
// clang-format on

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "automaton/lattice.h"
#include "core/place.h"
#include "core/sample_grid.h"
#include "core/wind.h"
#include "density/density_grid.h"

namespace nephos {

// See the table above.
struct VdbMetadata {
    double extinction_per_m = 0.02;
    double time_s = 0;
    double time_step_s = 0;
    double frames_per_second = 0;
    double time_scale = 1;
    std::uint64_t seed = 0;
    std::string scene_hash;
    std::string state_hash;
    std::string nephos_version;
    int random_stream_version = 0;
    Georeference georeference;
    Vec3 period_m{};              // 0 on an axis that does not repeat
    std::vector<WindLevel> wind;  // at the moment of the file; linear between levels, constant beyond
    bool operator==(const VdbMetadata&) const = default;
};

// The content of one file: at least one of `density`, `hum`, `act`, `cld`. Pointers and views are not owned.
struct VdbContent {
    const DensityGrid* density = nullptr;
    bool half = false;  // density as 16-bit floats
    std::optional<BitPlaneView> hum, act, cld;
    Placement cells;  // of the bit planes; must agree with density's placement and extent / refine
    // Places each grid by half of its own voxel towards -x, -y and -z: index (i, j, k) is then the corner of its voxel.
    bool half_voxel_shift = false;
    // Writes the wind by height, one velocity a level of voxels, as a grid of this name, whose voxels are velocity_voxel() of
    // those of the density; needs density.
    std::vector<Velocity> wind;
    std::string wind_name = "vel";
    // Returns what the wind has in addition at a place of world space, m/s; may be empty. Called in one thread.
    std::function<Vec3(const Vec3& place_m)> wind_field;
    // Called right before the file is begun and right before it gets its name (PublishCheck); may be empty.
    std::function<void()> publish_check;
};

// Returns how many voxels `factor` times as large a cell has along each axis, which had `refine`: at least one, too, where such a voxel is
// larger than a cell or a cell is no whole number of them.
inline int coarser_refine(int refine, int factor) { return refine % factor == 0 ? refine / factor : 1; }

// Returns the edge of the voxels of the wind over a box of voxels: 1, or the least power of two with which they are no more than
// 2^24, in blocks of 8 x 8 x 8.
int velocity_voxel(const Extent& voxels);

// Returns the most memory, in bytes, that such a grid takes over so many voxels, those of whole blocks of 8 x 8 x 8 counted.
double velocity_bytes(double voxels);

// Writes atomically (atomic_file.h): the file is complete or absent. Throws Error(usage) when the content
// contradicts itself, Error(io) naming the path when the file cannot be written (full disk included).
void write_vdb(const std::filesystem::path& path, const VdbContent& content, const VdbMetadata& metadata);

// Returns the path of one frame of a sequence, folder/NAME_0001.vdb: frames count from 1, at least four
// digits.
std::filesystem::path frame_path(const std::filesystem::path& folder, const std::string& name, int frame);

// The vertical axis of a file that another program wrote.
enum class UpAxis {
    automatic,  // that of nephos_up_axis, else z
    z,
    y,  // x stays, file z is south: world (x, -z, y); voxels are permuted, never resampled
};

// Limits on the child process that reads a file; Error(io) beyond them.
struct VdbReadLimits {
    // For the reading process; 0 = half of the memory that is free, and at most 256 MiB and 2,000 times the file's size.
    std::size_t memory_bytes = 0;
    double seconds = 120;  // wall clock, > 0
};

struct VdbReadOptions {
    std::string grid;  // name of the grid; empty: `density`, else the first float grid
    UpAxis up_axis = UpAxis::automatic;
    double metres_per_unit = 1.0;  // world units of the file; > 0
    bool list_grids = false;       // fills LoadedDensity::info
    VdbReadLimits limits;
};

// One value of the metadata of a file.
struct VdbMetadataEntry {
    std::string name;
    std::string value;     // as text; numbers with all their digits
    bool is_json = false;  // a number, a truth value, or a list of numbers, in the form of JSON
    bool operator==(const VdbMetadataEntry&) const = default;
};

// One grid as `nephos info` lists it.
struct VdbGridInfo {
    std::string name;
    std::string type;        // "float", "half", "bool", "vec3s" ...
    std::string grid_class;  // "fog volume", "level set", "unknown" ...
    Vec3 voxel_size{};       // world units
    VoxelBox active_box;
    std::uint64_t active_voxels = 0;
    Matrix4 world_from_index{};              // by rows; an index is the centre of a voxel
    std::vector<VdbMetadataEntry> metadata;  // by name
};

struct VdbInfo {
    std::string file_version;        // "10.0/224": library and format
    std::vector<VdbGridInfo> grids;  // in the file's order
    std::vector<VdbMetadataEntry> metadata;
};

// A density grid with the metadata of its file.
struct LoadedDensity {
    DensityGrid density;
    std::string grid_name;
    std::optional<VdbMetadata> metadata;  // when nephos wrote the file
    VdbInfo info;                         // of all grids of the file, with VdbReadOptions::list_grids
    int refine = 1;  // voxels per cell of the lattice and axis; 1 unless the file says more
    std::uint64_t negative = 0;  // voxels below 0, which were set to 0
    double level_height_m = 0;   // of a voxel: its edge, but for masks (mask_file.h)
    // One sentence for each adaptation (negative values set to 0, resampling ...).
    std::vector<std::string> notes;
};

// Reads any float, half or double fog volume. Bounds are nephos_bbox where present, else the active bounds,
// moved so that voxel (0, 0, 0) is the lowest corner. Axes along the world's, in any order and direction, are
// permuted; rotated, sheared or non-cubic voxels are resampled, with a note. A child process with limits on
// memory and time parses the file and sends the voxels (density/vdb/sandbox.h). Throws Error(io) naming the path and the
// defect, Error(usage) on bad options. Thread-safe.
LoadedDensity load_density(const std::filesystem::path& path, const VdbReadOptions& options = {});
DensityGrid read_density(const std::filesystem::path& path, const VdbReadOptions& options = {});

// Reads files one after the other, as load_density(), and calls `each` with the index and the content of each; false stops.
// One process reads up to 64 files ahead while `each` works, which takes a tenth of the time of a process for each small
// file. Throws as load_density() and `each`; the files before the one that cannot be read were handed over.
void load_densities(std::span<const std::filesystem::path> paths, const VdbReadOptions& options,
                    const std::function<bool(std::size_t index, LoadedDensity&& loaded)>& each);

// Reads the bool (or mask) grids hum, act and cld as a state of this extent and placement. Throws Error(io)
// as above, and when a grid is missing, has another extent by its nephos_bbox_max or (without one) a voxel
// outside the extent, or has another placement: by its transform a corner of the box is more than a hundredth
// of a cell from that of the lattice. In files of other programs the identity transform, OpenVDB's default,
// counts as unspecified and fits every placement.
Lattice read_state(const std::filesystem::path& path, Extent extent, const Placement& placement,
                   const VdbReadLimits& limits = {});

// Reads the points of a float or double grid (`parts` 1) or of one of vectors (3) as they stand in the file: the box of
// its active voxels, those between that are not active with their value as well. `grid` empty: the only one of that
// type. Throws Error(io) as above, and when the grid's axes are not those of the world or a value is not finite.
SampleGrid read_samples(const std::filesystem::path& path, const std::string& grid, int parts,
                        const VdbReadLimits& limits = {});

// Lists the grids and metadata of a file. Throws Error(io) as load_density().
VdbInfo read_vdb_info(const std::filesystem::path& path, const VdbReadLimits& limits = {});

}  // namespace nephos
