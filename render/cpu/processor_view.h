// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 2 of D on the processor: what binned_view.h has in compute shaders, in vectors of 4 to 16 lanes
// (Highway, chosen at run time), tiles in parallel. The test reference of the compute shaders, and what draws
// where there is no graphics card. The result does not depend on the number of threads. Private to the
// module.

#include <cstdint>
#include <span>
#include <vector>

#include "render/cloud/stage_times.h"
#include "render/frame/billboard_textures.h"
#include "render/frame/marched_scene.h"
#include "render/cpu/screen_ball.h"
#include "render/frame/air_shells.h"
#include "render/frame/frame_data.h"
#include "render/frame/tile_bins.h"
#include "render/frame/view_sorting.h"
#include "render/image/picture.h"
#include "render/options/camera.h"

namespace nephos {

// The visible set: flags of the metaballs and of the shadow map's tiles that some pixel needs, 1 = visible.
// If nearly everything is visible, all are 1. Light is computed for nothing else: stages that read the shadow
// map beside the ground must mark its tiles, too.
struct VisibleSet {
    std::vector<std::uint8_t> balls;      // one for each of ViewSortedSplats::balls
    std::vector<std::uint8_t> map_tiles;  // one for each tile of the shadow map: the ground wears it

    VisibleSet(const ViewSortedSplats& order, int shadow_size)
        : balls(order.balls.size(), 0), map_tiles(TileGrid{shadow_size, shadow_size}.tiles(), 0) {}
};

// A part of the picture in two steps, between which the light can be computed where it is seen. `order` must
// live until the last; only the light of its metaballs may change meanwhile.
class ProcessorView {
  public:
    // `frame` is that of the part.
    ProcessorView(const RenderOptions& options, const CameraFrame& camera, const PictureFrame& frame,
                  const PicturePart& part, const ViewSortedSplats& order, const BatchLimits& limits = {},
                  StageTimes* times = nullptr);

    // Adds what the part shows.
    void find_visible(int shadow_size, VisibleSet& seen);

    // Draws splats, the air between them and what lies behind; the ground wears `shadow`, shadow_size^2
    // texels. The light of balls that are not `seen` is not looked at; without it all are. Clouds with detail
    // are marched through `march`.
    void draw(Picture& picture, const float* shadow, int shadow_size, const AirShells& shells,
              const VisibleSet* seen = nullptr, const MarchedScene* march = nullptr);

  private:
    struct Batch {
        std::size_t begin = 0, end = 0;  // of the boxes
        std::vector<ScreenBall> screen;  // nearest first
        std::vector<ExactBall> exact;
        TileBins bins;  // cut off where a tile is opaque, once find_visible() knows
    };
    std::uint32_t source(std::size_t splat) const;
    const BillboardTexels* texels() const;
    void shape(Batch& batch, std::size_t first, std::size_t last, std::uint32_t number) const;
    Batch prepare_batch(std::size_t begin, std::size_t end) const;
    void light(Batch& batch, const VisibleSet* seen) const;
    bool find_visible_in_tiles(std::size_t first, std::size_t step, std::vector<std::uint32_t>& drawn,
                               VisibleSet* seen, int shadow_size);
    void find_visible_ground(int shadow_size, VisibleSet& seen) const;

    const ViewSortedSplats* order_;
    PictureFrame frame_;
    PicturePart part_;
    BatchLimits limits_;
    StageTimes* times_;
    std::vector<std::uint32_t> source_;  // splats_near_to_far(); empty without billboards
    std::vector<PixelBox> boxes_;        // of the splats, nearest first
    std::vector<Batch> kept_;            // one, if find_visible() has made it
};

}  // namespace nephos
