// SPDX-License-Identifier: Apache-2.0
#pragma once

// Judges the sequences of a run for `nephos verify`: how much their frames differ from one to the next, and whether a seam
// shows where their box meets its repetition. Private to the module.

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/math.h"
#include "density/density_grid.h"
#include "simulation/run_listing.h"
#include "simulation/verify.h"

namespace nephos {

// A sequence of density files, one a frame, of all layers together or of one, and what was measured of it.
struct DensitySequence {
    std::string layer;  // its name; empty: the files are of all layers together, or the scene has none
    Vec3 period_m;      // lengths after which the density repeats; 0 on an axis where it does not
    // Seams are measured in every frame, along x and y; otherwise in the last one, along axes that repeat.
    bool every_seam = false;

    // The sums of plane_steps() along x and y over all frames in which they were measured: clouds drift over a seam, while
    // one that shows is there in all frames.
    std::array<PlaneSteps, 2> planes;
    int seam_frames = 0, seam_frame = 0;            // how many, and the last of them
    double change = 0;                              // the largest of a voxel from a frame to the next
    // The largest of the sum of gradients along x, as a part of it, by which pulsing between steps shows.
    double sharpness_change = 0;
    int frames = 0, files = 0;  // frames that were given, and those of them whose file could be read
    int pairs = 0;              // frames that were compared with the one before
    std::string too_large;      // why some were not measured; empty: all were

    struct Last {
        int frame = 0;
        DensityGrid grid;
        double gradients = 0;  // their sum along x
    };
    std::optional<Last> last;  // of those that could be read
};

// Returns the sequences by which a run is judged, with nothing measured: the files of all layers together where its scene
// writes them, otherwise those of each layer that has density.
std::vector<DensitySequence> sequences_of(const RunListing& run, bool every_seam);

// Measures a frame; frames come in order. `grid`: null where its file could not be read. It is compared with the one before
// it, and where that is missing with none.
void add_frame(DensitySequence& sequence, int frame, const DensityGrid* grid);

// Measures the last frame's seams unless every one was measured.
void finish(DensitySequence& sequence);

// Returns the check `seam`: of each axis the seam that shows most. Demanded, none may show, and one sequence that could not be
// measured is a check that was not done.
Check check_seams(std::span<const DensitySequence> sequences, bool is_demanded);

// Returns the check `motion`: the largest changes of all sequences. That of a voxel must not be above `most` where that is
// given, and one sequence of which no frames were compared is a check that was not done then.
Check check_motion(std::span<const DensitySequence> sequences, const std::optional<double>& most);

// Returns why the voxels of a grid are not compared one by one: there are too many. Empty: they are.
std::string why_too_large(const DensityGrid& grid);

}  // namespace nephos
