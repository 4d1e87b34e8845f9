// SPDX-License-Identifier: Apache-2.0
#pragma once

// Encodes frames as an MP4 file (H.264, yuv420p, odd sizes padded by one pixel) with the `ffmpeg` command,
// which is started without a shell and reads frames from its standard input.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>

namespace nephos {

struct VideoOptions {
    int width = 0, height = 0;      // pixels, 1..16384
    double frames_per_second = 25;  // kLeastVideoRate to 1000
    int quality = 18;               // constant rate factor of x264, 0 (lossless) .. 51
    std::string comment = {};       // in its metadata, ahead of its pictures
    int processors = 0;             // on which ffmpeg may run, >= 0; 0: all. Without effect on the file
    // Asked often while ffmpeg is waited for, by the thread that waits; true ends ffmpeg, and the call with Error(io).
    std::function<bool()> stop = {};
};

// The least pictures a second: ffmpeg fails with fewer, whose times its MP4 cannot hold.
inline constexpr double kLeastVideoRate = 0.00005;

// Throws Error(io), with the package to install, when there is no ffmpeg command on the PATH. To be called
// before a long run that ends with a video.
void require_ffmpeg();

// A video that is written frame by frame. The file appears with finish() and complete, or not at all.
class VideoWriter {
  public:
    // Starts ffmpeg. Throws Error(usage) on bad options, Error(io) when ffmpeg is missing or the file cannot be
    // written.
    VideoWriter(const std::filesystem::path& path, const VideoOptions& options);
    // Ends ffmpeg and removes what it has written, unless it was finished.
    ~VideoWriter();
    VideoWriter(const VideoWriter&) = delete;
    VideoWriter& operator=(const VideoWriter&) = delete;

    // Takes one frame: 3 * width * height bytes, RGB, row 0 at the top. Waits while ffmpeg is behind. Throws
    // Error(usage) on another size, Error(io) with ffmpeg's message when it has failed.
    void add(std::span<const std::uint8_t> rgb);
    // Waits for ffmpeg and gives the file its name. Throws Error(usage) when there was no frame, Error(io) as
    // add().
    void finish();

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace nephos
