// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pictures of a live scene: small drafts while something moves, the whole with detail when nothing does.

#include <memory>

#include "apps/editor/live.h"

namespace nephos {

class LivePictureMaker {
  public:
    // Draws a frame: a draft whose size keeps to kDraftMs, or with `refine` all of it. `same_layers` as
    // FramePainter::set_scene(). Throws as FramePainter::draw().
    std::shared_ptr<LivePicture> draw(FramePainter& painter, const Scene& scene,
                                      const std::shared_ptr<const LiveFrame>& frame, const LiveView& view,
                                      bool refine, bool same_layers);

  private:
    double draft_scale_ = 0.5;  // of a draft's sides
};

// On a machine whose cores are all busy the window's thread, and the driver's that draw the window, go before the thread
// that calls this and those that it starts: Linux has a niceness for each thread, and new ones inherit it. `steps`: how
// much nicer, 0..19.
void yield_to_window(int steps);
inline constexpr int kNicer = 10, kNicest = 15;  // what waits for a picture; the detail of one that is seen already

// Wall time that a draft may take, which its size is adapted to.
inline constexpr double kDraftMs = 45;

}  // namespace nephos
