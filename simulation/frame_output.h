// SPDX-License-Identifier: Apache-2.0
#pragma once

// The files of a run's frames, made beside the simulation:
//
//     simulation --(a frame)--> drawing --(a frame and its picture)--> density files, EXR, PNG
//
// Drawing and writing have a thread each, so that the next step is simulated and the next picture drawn while
// files are compressed and flushed to the device. Frames keep their order. At most kDrawing + kWriting frames
// are under way (kWriting without pictures); simulation/memory.h reckons with them. Where oneTBB is limited to
// one thread, everything happens in add(). While a graphics card draws a picture the next is prepared, if its
// frame is there; that is one frame more.
//
// When a frame fails, those before it are still drawn to their end and written, those after it are dropped.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "density/metaballs.h"
#include "density/vdb/vdb_file.h"
#include "render/image/picture.h"
#include "render/renderer.h"
#include "simulation/pipeline.h"
#include "simulation/run_folder.h"
#include "simulation/sky_picture.h"
#include "simulation/stage.h"

namespace nephos {

class FrameOutput {
  public:
    // `done` is called for each frame all of whose files are there, in order, by the thread that writes.
    // `settings` must outlive this object, and the pipeline the next finish() or finish_quietly(). Throws
    // Error(gpu) when pictures are wanted and the device that is asked for is not there.
    FrameOutput(const RunSettings& settings, std::function<void(const FrameResult&)> done);

    // As those of Renderer; empty without pictures.
    std::string backend_name() const;
    std::string device_name() const;

    // Hands over the next frame; waits while too many are under way. Throws what making an earlier one threw:
    // Error(io) naming a file, Error(gpu), Error(usage) when a frame does not fit into memory.
    void add(const FrameResult& frame);
    // Throws the same, without waiting.
    void check();
    // Waits until all frames are written; throws the same.
    void finish();
    // Waits until all frames are written that can be: after an exception, those before the one that failed.
    void finish_quietly() noexcept;

  private:
    struct Drawn {
        FrameResult frame;
        Picture picture;  // empty without pictures
    };

    // A frame whose picture was begun.
    struct Begun {
        FrameResult frame;
        std::vector<Metaball> balls;
        PendingSkyPicture picture;
    };

    void draw_next(FrameResult& frame);
    Begun begin(FrameResult& frame);
    void finish_begun();
    std::vector<Metaball> metaballs_of(const FrameResult& frame) const;
    void write(const Drawn& drawn) const;
    void write_density(const FrameResult& frame) const;
    void write_layers(const FrameResult& frame) const;
    void write_picture(const Drawn& drawn) const;
    DensityGrid refined(const DensityGrid& density, const Boundaries& boundaries) const;
    VdbMetadata metadata_of(const FrameResult& frame, const StateHash& hash) const;

    const RunSettings& settings_;
    RunFolder folder_;
    std::function<void(const FrameResult&)> done_;
    std::unique_ptr<Renderer> renderer_;
    SkyPainter painter_;
    std::optional<Begun> begun_;  // of the thread that draws
    Stage<Drawn> writing_;
    Stage<FrameResult> drawing_;  // after writing_: ends before it
};

// Whether a scene's pictures are written as PNG: for themselves, or to make the video of.
bool wants_png(const Scene& scene);

}  // namespace nephos
