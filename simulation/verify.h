// SPDX-License-Identifier: Apache-2.0
#pragma once

// Checks that the folder of a run is whole and says the truth: every file that its manifest lists, byte by byte and
// voxel by voxel, and, if wanted, the simulation itself.

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace nephos {

// One line of the result.
struct Check {
    std::string name;    // "files", "hashes", ...
    bool passed = true;  // a check that only measures has always passed
    std::string detail;  // what was found: what is wrong first, then figures
    // The figures of a check that measures, by name.
    std::vector<std::pair<std::string, double>> figures{};
    // False: what it takes is not there any more, so that nothing was judged. It has not passed then, and `detail` says why.
    bool done = true;
};

struct VerifyOptions {
    bool hashes_only = false;  // of files: nothing is decoded
    // Another run that must have the same voxels and states, frame by frame, with whatever compression: by its tables and its
    // manifest; whether its files are as that says is told by a check of that run.
    std::optional<std::filesystem::path> against;
    // Frames to simulate anew and to compare, from the first on, by states and by voxels of files that are not refined; 0: none. It takes the files that the scene starts from, and
    // of a branch the checkpoint of the other run that it began with, both as they were.
    int replay = 0;
    // The largest change of a voxel from frame to frame that passes; none: it is reported and always passes. Of the files of all
    // layers together, or of those of each layer where the scene writes no others; likewise seams.
    std::optional<double> max_change;
    // Makes a seam that shows (Seam::shows) in the mean of all frames a failure, also of an axis that is not periodic. Otherwise that
    // of the last frame is reported: of few planes with little cloud the roughest lies at the seam by chance.
    bool seam = false;
};

struct Verification {
    std::string kind;  // "run" or "export"
    std::vector<Check> checks;
    bool passed() const;  // all of them
    bool failed() const;  // one that was done has not passed
};

// Checks a run. Reads one frame after the other; keeps two. Throws Error(io) when its manifest cannot be read, and
// Error(usage) when `against` has no manifest of a run. Everything else that is wrong becomes a check that has not passed.
Verification verify_run(const std::filesystem::path& folder, const VerifyOptions& options);

// What a list of files says against what is there.
struct ListedFile {
    std::filesystem::path path;  // below the folder
    std::uint64_t bytes = 0;
    std::string xxh3;
};

// Checks that all files are there and have their size and checksum: two lines, which name the first problems, and one more,
// which was not done, where the system cannot read some. `extra`: files that are there and should not be; `is_listed`: whether the
// folder could be looked through for them.
std::vector<Check> check_files(const std::filesystem::path& folder, const std::vector<ListedFile>& files,
                               const std::vector<std::filesystem::path>& extra, bool is_listed);

// Checks that the list itself, manifest.json or export.json, is as it was written, by the checksum at its end. Throws
// Error(io) as open_regular_file().
Check check_list(const std::filesystem::path& list);

// The roughness of a volume where it would meet its own repetition along an axis, against its inside: that of planes of voxels,
// or the mean of several moments.
//
// In a volume that repeats, the planes at the seam are planes like all others, so that one time in n / 2 the roughest of all n lies
// there by chance; but then clouds go through it, and the planes beside it are rough, too, while a cut is rough by itself. A seam
// shows when it is rougher than the roughest plane inside, and twice as rough as the planes beside it. (Of 10,752 places in
// tiles 15 do by chance, 14 of them where clouds are specks that have just formed, a voxel or two thick; of 270 axes on which clouds
// are cut in a third of the frames 249 do. Of two planes any seam shows.)
struct Seam {
    double at_seam = 0;  // the rougher of the two planes that meet
    double inside = 0;   // the roughest of the others; 0: there are none
    double limit = 0;  // from which on the seam shows: the larger of `inside` and twice the planes beside it
    bool shows() const { return at_seam > limit; }
};
Seam seam_of(std::span<const double> planes);  // by the roughness of each

// Returns the mean absolute second difference across each plane of voxels along an axis, 0 = x, as if the volume repeated.
// Density: x fastest, nx * ny * nz of it.
std::vector<double> plane_roughness(const std::vector<float>& density, int nx, int ny, int nz, int axis);

}  // namespace nephos
