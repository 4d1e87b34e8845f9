// SPDX-License-Identifier: Apache-2.0
#pragma once

// The files of a run's frames, made beside the simulation:
//
//     simulation --(a frame)--> drawing --(a frame and its picture)--> density files, EXR, PNG, video
//
// Drawing and writing have a thread each, so that the next step is simulated and the next picture drawn while
// files are compressed and flushed to the device. Frames keep their order. Where oneTBB is limited to one
// thread, everything happens in add(). While a graphics card draws a picture the next is prepared, if its frame
// is there.
//
// When a frame fails, those before it are still drawn to their end and written, those after it are dropped.

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/image/picture.h"
#include "simulation/frame_painter.h"
#include "simulation/frame_writer.h"
#include "simulation/run_folder.h"
#include "simulation/run_video.h"
#include "simulation/simulation.h"
#include "simulation/stage.h"

namespace nephos {

// Frames under way at most, which memory_estimate() reckons with: in the stage that writes, and, with pictures,
// in the stage that draws; with a graphics card one more is prepared while it draws.
inline constexpr std::size_t kFramesWritten = 2, kFramesDrawn = 1, kFramesPrepared = 1;

class FrameOutput {
  public:
    // `done` is called for each frame all of whose files are there, with these files, in order, by the thread that
    // writes.
    // `settings` must outlive this object, and the simulation the next finish() or finish_quietly(). Throws
    // Error(gpu) when pictures are wanted and the device that is asked for is not there.
    FrameOutput(const RunSettings& settings, std::function<void(const FrameResult&, std::vector<WrittenFile>)> done);

    // Calls `guard` before each file of a frame, by the thread that writes. Before the first add().
    void set_guard(std::function<void()> guard) { writer_.set_guard(std::move(guard)); }

    // Return what Renderer's do; empty without pictures.
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

    // Makes the video of the frames from now on (run_video.h); call it before the first add().
    void start_video(std::function<bool()> stop) { video_.emplace(settings_, std::move(stop)); }
    bool makes_video() const { return video_.has_value(); }
    // Completes the video, if one was started. Precondition: finish(). Throws Error(io).
    void finish_video();

  private:
    struct Drawn {
        FrameResult frame;
        Picture picture;  // empty without pictures
    };

    void draw_next(FrameResult& frame);
    void finish_begun();
    void write(const Drawn& drawn);

    const RunSettings& settings_;
    std::function<void(const FrameResult&, std::vector<WrittenFile>)> done_;
    FrameWriter writer_;
    std::optional<RunVideo> video_;  // of the thread that writes
    std::unique_ptr<FramePainter> painter_;
    std::optional<PendingFrame> begun_;  // of the thread that draws
    Stage<Drawn> writing_;
    Stage<FrameResult> drawing_;  // after writing_: ends before it
};

}  // namespace nephos
