// SPDX-License-Identifier: Apache-2.0
#pragma once

// Encodes frames as an MP4 file (H.264, yuv420p, odd sizes padded by one pixel) with the `ffmpeg` command,
// which is started without a shell and reads frames from its standard input.

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

// Throws Error(io), with the package to install, when there is no ffmpeg command on the PATH. To be called
// before a long run that ends with a video.
void require_ffmpeg();

// Calls `next_frame` with a buffer for one frame (3 * width * height bytes, RGB, row 0 at the top) until it
// returns false, and encodes the frames. Writing is atomic. Throws Error(usage) on bad options or no frame,
// Error(io) when ffmpeg is missing or fails (with its message); exceptions of `next_frame` pass through.
void write_mp4(const std::filesystem::path& path, const VideoOptions& options,
               const std::function<bool(std::span<std::uint8_t> rgb)>& next_frame);

// Encodes PNG files of equal size, in the given order. Errors as above.
void encode_mp4(const std::filesystem::path& path, std::span<const std::filesystem::path> png_files,
                double frames_per_second);

}  // namespace nephos
