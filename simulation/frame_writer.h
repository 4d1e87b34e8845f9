// SPDX-License-Identifier: Apache-2.0
#pragma once

// Writes the files of a scene's frames into the folder of a run, under the names of RunFolder. Every file is
// either complete or not there.

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/digest.h"
#include "density/vdb/vdb_file.h"
#include "render/image/image_file.h"
#include "scenes/format/scene.h"
#include "simulation/frame_painter.h"
#include "simulation/run_folder.h"
#include "simulation/simulation.h"

namespace nephos {

// A file of a frame that was written.
struct WrittenFile {
    std::filesystem::path path;
    FileDigest digest;
    std::string voxels;  // voxel_digest() of a density file as it is read back; empty for others
};

// Returns whether fields of wind move the voxels of a file: a layer's, or those of all. Veils move with the profile alone.
bool moves_with_fields(const Scene& scene, std::optional<std::size_t> layer);

class FrameWriter {
  public:
    // Frame `first_frame` has no frame before it whose exposure it follows.
    FrameWriter(const Scene& scene, RunFolder folder, int first_frame = 1);

    // Writes a density file, refined as the scene asks for; of a scene with layers one for each layer, with its
    // own voxels, bits and wind, and one of their densities together. Returns the files in this order. Throws Error(io)
    // naming the file.
    std::vector<WrittenFile> write_density(const FrameResult& frame) const;

    // Writes the EXR and PNG files that the scene asks for of a picture of `painter`, whose back-end they name.
    // Returns what the PNG shows; empty without one. Throws Error(io) naming the file.
    //
    // With an automatic exposure that adapts (Camera::adaptation_s) frames are written in order; the exposure
    // of the frame before the first that is written, as after --resume, is read from its PNG file.
    Rgb8Image write_picture(const FrameResult& frame, const Picture& picture, const FramePainter& painter);

    // Calls `guard` before each file: it throws where none may be written any more.
    void set_guard(std::function<void()> guard) { guard_ = std::move(guard); }

  private:
    std::vector<WrittenFile> write_layers(const FrameResult& frame) const;
    WrittenFile write(const FrameResult& frame, VdbContent content, std::optional<std::size_t> layer) const;
    DensityGrid refined(const DensityGrid& density, const std::optional<DensityGrid>& moisture,
                        std::optional<std::size_t> layer, const Boundaries& boundaries, double time_s) const;

    Scene scene_;
    RunFolder folder_;
    RenderOptions exposed_options(const FrameResult& frame, const Picture& picture, const Camera& camera);

    std::string frames_hash_;
    std::function<void()> guard_;
    int first_frame_ = 1;
    int exposed_frame_ = 0;   // the last whose exposure is known; 0: none
    double exposed_ev_ = 0;  // of that frame, stops
};

// Returns the metadata of a file of a scene with this frames_hash(), of the moment `time_s` whose state has this hash: without
// wind and lengths of repetition, as of a state.
VdbMetadata density_metadata(const Scene& scene, std::string frames_hash, double time_s,
                             const StateHash& hash);

// Returns those of the density of a layer, or of all together, with its wind, and the lengths after which it repeats.
VdbMetadata frame_metadata(const Scene& scene, std::string frames_hash, double time_s, const StateHash& hash,
                           std::optional<std::size_t> layer, const DensityGrid& density);

}  // namespace nephos
