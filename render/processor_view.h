// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 2 of D on the processor: what view_tiles.h has in compute shaders, in vectors of 4 to 16 lanes
// (Highway, chosen at run time), tiles in parallel. The test reference of the compute shaders, and what draws
// where there is no graphics card. The result does not depend on the number of threads. Private to the
// module.

#include <cstdint>
#include <span>
#include <vector>

#include "render/air_shells.h"
#include "render/camera.h"
#include "render/eye_order.h"
#include "render/frame_data.h"
#include "render/picture.h"
#include "render/puff_texels.h"
#include "render/screen_ball.h"
#include "render/stage_times.h"
#include "render/tile_bins.h"

namespace nephos {

// What a picture shows of the light: 1 = some pixel does. Where nearly everything is seen, all is 1. Light is
// computed for nothing else: whoever reads the shadow map for more than the ground must mark its tiles, too.
struct SeenLight {
    std::vector<std::uint8_t> balls;      // one for each of EyeOrder::balls
    std::vector<std::uint8_t> map_tiles;  // one for each tile of the shadow map: the ground wears it

    SeenLight(const EyeOrder& order, int shadow_size)
        : balls(order.balls.size(), 0), map_tiles(TileGrid{shadow_size, shadow_size}.tiles(), 0) {}
};

// A part of the picture in two steps, between which the light can be computed where it is seen. `order` must
// live until the last; only the light of its metaballs may change meanwhile.
class ProcessorView {
  public:
    // `frame` is that of the part.
    ProcessorView(const RenderOptions& options, const CameraFrame& camera, const PictureFrame& frame,
                  const Tile& part, const EyeOrder& order, const BatchLimits& limits = {},
                  StageTimes* times = nullptr);

    // Adds what the part shows.
    void look(int shadow_size, SeenLight& seen);

    // Draws splats, the air between them and what lies behind; the ground wears `shadow`, shadow_size^2
    // texels. The light of balls that are not `seen` is not looked at; without it all are.
    void draw(Picture& picture, const float* shadow, int shadow_size, const AirShells& shells,
              const SeenLight* seen = nullptr);

  private:
    struct Batch {
        std::size_t begin = 0, end = 0;  // of the boxes
        std::vector<ScreenBall> screen;  // nearest first
        std::vector<ExactBall> exact;
        TileBins bins;  // cut off where a tile is opaque, once look() knows
    };
    std::uint32_t source(std::size_t splat) const;
    const PuffTexels* texels() const;
    void shape(Batch& batch, std::size_t first, std::size_t last, std::uint32_t number) const;
    Batch prepare_batch(std::size_t begin, std::size_t end) const;
    void light(Batch& batch, const SeenLight* seen) const;
    bool look_at_tiles(std::size_t first, std::size_t step, std::vector<std::uint32_t>& drawn,
                       SeenLight* seen, int shadow_size);
    void look_at_ground(int shadow_size, SeenLight& seen) const;

    const EyeOrder* order_;
    PictureFrame frame_;
    Tile part_;
    BatchLimits limits_;
    StageTimes* times_;
    std::vector<std::uint32_t> source_;  // splats_near_to_far(); empty without billboards
    std::vector<PixelBox> boxes_;        // of the splats, nearest first
    std::vector<Batch> kept_;            // one, if look() has made it
};

// Both steps with light that is all there; the ground wears picture.shadow.
void view_by_processor(const RenderOptions& options, const CameraFrame& camera, const PictureFrame& frame,
                       const Tile& part, const EyeOrder& order, const AirShells& shells, Picture& picture,
                       const BatchLimits& limits = {});

}  // namespace nephos
