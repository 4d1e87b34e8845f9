// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the benchmarks of pictures draw.

#include <filesystem>
#include <string>
#include <vector>

#include "density/metaballs.h"
#include "render/cloud/splats.h"
#include "render/options/options.h"
#include "scenes/format/scene.h"
#include "simulation/simulation.h"

namespace nephos::bench {

// Metaballs and how to look at them.
struct Subject {
    std::string name;
    std::vector<Metaball> balls;
    double extinction_per_m = 0;
    RenderOptions options;
    double radius_cells = 2;
    std::vector<DetailedVoxels> detailed{};
    MetaballCloud cloud() const {
        return {balls, extinction_per_m, metaball_normalisation(radius_cells), detailed};
    }
    // For a PNG or a film: nobody asks for depth and light.
    Splats pixels_only() const {
        Splats splats;
        splats.metaballs = cloud();
        splats.depth = splats.light = false;
        return splats;
    }
    // As if the cloud were another: the renderer must not know its light from the picture before.
    void change() { balls.front().density *= 0.999f; }
};

// The frames of a scene from `first` to `last`, counted from 1.
std::vector<FrameResult> frames_of(const Scene& scene, int first, int last);

// The voxels of a frame of one lattice, with the detail that its run gives them.
DetailedVoxels voxels_of(const Scene& scene, const FrameResult& frame);

// A frame of a scene of one lattice, as its run draws it; with its detail or without.
Subject subject_of(const Scene& scene, const FrameResult& frame, bool with_detail);

// The last frame of a scene without detail, 640x480.
Subject last_frame_of(const std::filesystem::path& file);

}  // namespace nephos::bench
