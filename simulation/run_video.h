// SPDX-License-Identifier: Apache-2.0
#pragma once

// The video of a run, made of its frames while they are drawn. Frames that an earlier process drew, before the
// run was interrupted, are read back from their PNG files when the first new frame, or the end, comes.

#include <functional>
#include <optional>
#include <string>

#include "render/image/image_file.h"
#include "render/image/video.h"
#include "simulation/run_folder.h"

namespace nephos {

class RunVideo {
  public:
    // Begins with the frames of the range. ffmpeg is started with the first of them. `stop` as VideoOptions::stop.
    RunVideo(const RunSettings& settings, std::function<bool()> stop);

    // Takes the picture of a frame that has been drawn; frames come in order. A failure ends the video and not the
    // run: finish() then makes it of the PNG files, and throws what fails again.
    void add(int number, const Rgb8Image& image);
    // Reads back the frames up to the last that were not added, and completes the file. Throws as VideoWriter
    // and read_png().
    void finish();

  private:
    void read_back(int end);
    void write(const Rgb8Image& image);

    RunFolder folder_;
    std::string frames_hash_;
    double frames_per_second_ = 25;
    int first_ = 1, next_ = 1, last_ = 0;
    bool failed_ = false;  // in add()
    std::function<bool()> stop_;
    std::optional<VideoWriter> writer_;
};

}  // namespace nephos
