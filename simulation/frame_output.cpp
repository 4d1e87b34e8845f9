// SPDX-License-Identifier: Apache-2.0
#include "simulation/frame_output.h"

#include <utility>

#include <tbb/global_control.h>

#include "simulation/scene_files.h"

namespace nephos {
namespace {

bool several_threads() {
    return tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism) > 1;
}

}  // namespace

FrameOutput::FrameOutput(const RunSettings& settings,
                         std::function<void(const FrameResult&, std::vector<WrittenFile>)> done)
    : settings_(settings),
      done_(std::move(done)),
      writer_(settings.scene, {settings.folder, settings.scene.name}, settings.range.first_frame),
      painter_(settings.render ? std::make_unique<FramePainter>(settings.scene, settings.device) : nullptr),
      writing_(kFramesWritten, several_threads(), [this](Drawn& drawn) { write(drawn); }),
      drawing_(kFramesDrawn, several_threads() && settings.render,
               [this](FrameResult& frame) { draw_next(frame); }) {
    // Before the run takes the folder of another one.
    if (painter_)
        require_cameras_above(settings.scene, painter_->terrain(), settings.range.first_frame,
                              settings.range.last_frame);
}

std::string FrameOutput::backend_name() const { return painter_ ? painter_->backend_name() : ""; }

std::string FrameOutput::device_name() const { return painter_ ? painter_->device_name() : ""; }

void FrameOutput::add(const FrameResult& frame) {
    if (painter_) {
        drawing_.add(frame);
    } else {
        writing_.add({frame, {}});
    }
}

void FrameOutput::check() {
    drawing_.check();
    writing_.check();
}

void FrameOutput::finish() {
    drawing_.finish();
    writing_.finish();
}

void FrameOutput::finish_quietly() noexcept {
    try {
        drawing_.finish();
    } catch (...) {  // whoever gave the frames has it already, or has a failure of its own
    }
    try {
        writing_.finish();
    } catch (...) {
    }
}

void FrameOutput::finish_video() {
    if (!video_) return;
    video_->finish();
    video_.reset();
}

// The frame itself first, then the video of it.
void FrameOutput::write(const Drawn& drawn) {
    std::vector<WrittenFile> files = writer_.write_density(drawn.frame);
    Rgb8Image image;
    if (painter_) {
        image = writer_.write_picture(drawn.frame, drawn.picture, *painter_);
        const RunFolder folder{settings_.folder, settings_.scene.name};
        for (const std::filesystem::path& picture : picture_files(folder, settings_.scene, drawn.frame.number))
            files.push_back({picture, file_digest(picture), {}});
    }
    done_(drawn.frame, std::move(files));
    if (video_) video_->add(drawn.frame.number, image);
}

// Hands on the picture before once this one is begun, and this one, too, unless the next frame is there.
void FrameOutput::draw_next(FrameResult& frame) {
    std::optional<PendingFrame> next;
    try {
        next.emplace(painter_->begin(std::move(frame)));
    } catch (...) {
        finish_begun();
        throw;
    }
    finish_begun();
    begun_ = std::move(next);
    if (!begun_->is_pending() || !drawing_.is_awaited()) finish_begun();
}

void FrameOutput::finish_begun() {
    if (!begun_) return;
    PendingFrame begun = std::move(*begun_);
    begun_.reset();
    Picture picture = painter_->finish(std::move(begun));
    picture.light = {};  // no file has it
    writing_.add({std::move(begun.frame), std::move(picture)});
}

}  // namespace nephos
