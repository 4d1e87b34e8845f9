// SPDX-License-Identifier: Apache-2.0
#pragma once

// The input and the accumulators of the kernels of processor_view.h. Private to the module.

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "render/frame/billboard_textures.h"
#include "render/frame/marched_scene.h"
#include "render/cpu/screen_ball.h"
#include "render/frame/frame_data.h"
#include "render/shared/shared.h"

namespace nephos {

// Sums over the splats in front, for the pixels of a tile row by row.
struct TileSums {
    static constexpr std::size_t kPixels = shader::kTileWidth * shader::kTileHeight;
    alignas(64) float red[kPixels] = {}, green[kPixels] = {}, blue[kPixels] = {}, distance[kPixels] = {};
    alignas(64) float transmittance[kPixels];
    alignas(64) float opaque[kPixels];  // transmittance below which nothing behind is seen
    std::size_t next_shell = 0;         // of air: those before it are in the sums
    TileSums() {
        std::fill_n(transmittance, kPixels, 1.0f);
        std::fill_n(opaque, kPixels, shader::kOpaque);
    }
    // Empty sums of the tile whose upper left pixel this is; `opaque` is lower where the sun's disc is behind.
    TileSums(const PictureFrame& frame, int x, int y);
};

// The data shared by all tiles of a part of the picture.
struct ViewScene {
    const PictureFrame* frame = nullptr;
    std::span<const ScreenBall> balls;  // splats, nearest first; some are ScreenBillboards
    std::span<const ExactBall> exact;
    const float* shadow = nullptr;
    int shadow_size = 0;
    std::span<const std::uint32_t> before_shells;  // splats_before_shells() of frame->shells
    std::size_t first_ball = 0;                    // number of balls[0], nearest first
    const BillboardTexels* texels = nullptr;       // for ScreenBillboards
    bool distances = true;                         // depth is requested
    const MarchedScene* march = nullptr;           // clouds with detail; null: none
};

// Sets a flag; several threads may set the same one.
inline void mark(std::uint8_t& byte) {
    const std::atomic_ref<std::uint8_t> shared(byte);
    if (shared.load(std::memory_order_relaxed) == 0) shared.store(1, std::memory_order_relaxed);
}

struct ViewTile {
    int x = 0, y = 0;                     // first pixel
    std::span<const std::uint32_t> list;  // of splats, nearest first
};

// The work done for a tile, for measurements.
struct TileWork {
    std::size_t splats = 0;  // of its list, until it was opaque
    std::size_t pairs = 0;   // of a splat and a pixel
};

}  // namespace nephos
