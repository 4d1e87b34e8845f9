// SPDX-License-Identifier: Apache-2.0
#pragma once

// Checks that the folder of a run is whole and says the truth: every file that its manifest lists, byte by byte and
// voxel by voxel, and, if wanted, the simulation itself.

#include <filesystem>
#include <optional>
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
    // of the last frame is reported.
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

// Measures how density changes from each plane of voxels along an axis to the next: entry n from plane n to plane n + 1, the last
// one from the last plane to the first, where the volume would meet its own repetition. Means over the voxels of a plane.
struct PlaneSteps {
    std::vector<double> steps;  // the absolute difference
    // The part of each that is no continuation of its row: what it has above 1.5 times the larger of the steps before and behind
    // it. Of two planes there is none, as these are the same step, and of three at most a quarter of the step.
    std::vector<double> breaks;
};

// Returns the steps of a density of nx * ny * nz voxels, x fastest, along an axis, 0 = x.
PlaneSteps plane_steps(const std::vector<float>& density, int nx, int ny, int nz, int axis);

// The break of a volume where it would meet its own repetition along an axis, against those inside; of one moment, or the mean of
// several.
//
// Clouds are smooth, whether they lie over the seam or not, while a cut puts voxels side by side that know nothing of each other.
// So a seam shows when its breaks are a quarter of its steps, and 1.5 times those of the worst plane inside, which a cloud of few
// voxels may make. Where edges are as sharp as a voxel, of files that are refined or hardly smoothed and of hard veils, there are
// breaks everywhere: they must be twice as large a part of the steps as inside, or the steps 1.25 times the largest inside, too.
// (Of 230,000 places in tiles 30 do by chance, hardly any of default smoothing; of 94 axes across which smoothed clouds are cut in
// a third of the frames 89 do, of 119 of veils with hard edges 100.)
struct Seam {
    double at_seam = 0;  // the break there
    double inside = 0;   // the largest of the others
    double limit = 0;    // from which on the seam shows
    bool shows() const { return at_seam > limit; }
};
Seam seam_of(const PlaneSteps& planes);

}  // namespace nephos
