// SPDX-License-Identifier: Apache-2.0
#pragma once

// Frames to an MP4 file (H.264, yuv420p, odd sizes padded by one pixel) by the `ffmpeg` command, started
// without a shell and fed through its standard input.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>

namespace nephos {

struct VideoOptions {
    int width = 0, height = 0;      // pixels, 1..16384
    double frames_per_second = 25;  // > 0, at most 1000
    int quality = 18;               // constant rate factor of x264, 0 (lossless) .. 51
};

// Throws Error(io), saying what to install, when there is no ffmpeg command on the PATH: to be asked before
// hours of work whose last step is a video.
void require_ffmpeg();

// Calls `next_frame` with the room for one frame (3 * width * height bytes, RGB, row 0 at the top) until it
// returns false, and encodes what it filled in. The file appears at the end and complete, or not at all.
// Throws Error(usage) on bad options or no frame, Error(io) when ffmpeg is missing or fails (with its
// message); what `next_frame` throws passes through.
void write_mp4(const std::filesystem::path& path, const VideoOptions& options,
               const std::function<bool(std::span<std::uint8_t> rgb)>& next_frame);

// The same from PNG files of one size, in the order given.
void encode_mp4(const std::filesystem::path& path, std::span<const std::filesystem::path> png_files,
                double frames_per_second);

}  // namespace nephos
