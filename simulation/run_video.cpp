// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_video.h"

#include <utility>

#include <tbb/global_control.h>

#include "core/error.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

// Begins the comment by which a run knows its video (own_files.h).
constexpr const char* kNamesScene = "nephos_scene_hash ";

}  // namespace

RunVideo::RunVideo(const RunSettings& settings, std::function<bool()> stop)
    : folder_{settings.folder, settings.scene.name},
      frames_hash_(frames_hash(settings.scene)),
      frames_per_second_(settings.scene.frames.per_second),
      first_(settings.range.first_frame),
      next_(settings.range.first_frame),
      last_(settings.range.last_frame),
      stop_(std::move(stop)) {}

void RunVideo::write(const Rgb8Image& image) {
    if (!writer_) {
        VideoOptions options;
        options.width = image.width;
        options.height = image.height;
        options.frames_per_second = frames_per_second_;
        using Control = tbb::global_control;  // as many processors as threads of ours
        options.processors = int(Control::active_value(Control::max_allowed_parallelism));
        options.stop = stop_;
        options.comment = kNamesScene + frames_hash_;
        writer_.emplace(folder_.video(), options);
    }
    writer_->add(image.rgb);
    ++next_;
}

void RunVideo::read_back(int end) {
    while (next_ < end) write(read_png(folder_.picture(next_, ".png")));
}

void RunVideo::add(int number, const Rgb8Image& image) {
    if (failed_) return;
    try {
        read_back(number);
        write(image);
    } catch (const std::exception&) {
        writer_.reset();
        next_ = first_;
        failed_ = true;
    }
}

void RunVideo::finish() {
    read_back(last_ + 1);
    writer_->finish();
    writer_.reset();
}

}  // namespace nephos
