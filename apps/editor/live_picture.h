// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pictures of a live scene: small drafts while something moves, the whole with detail when nothing does.

#include <memory>

#include "apps/editor/live.h"

namespace nephos {

class LivePictureMaker {
  public:
    // What the last picture showed.
    const std::shared_ptr<const LiveFrame>& frame() const { return frame_; }
    const LiveView& view() const { return view_; }
    bool is_draft() const { return is_draft_; }

    // Draws a frame: a draft whose size keeps to kDraftMs, or with `refine` all of it. `same_layers` as
    // FramePainter::set_scene(). Throws as FramePainter::draw().
    std::shared_ptr<LivePicture> draw(FramePainter& painter, const Scene& scene,
                                      const std::shared_ptr<const LiveFrame>& frame, const LiveView& view,
                                      bool refine, bool same_layers);
    // Notes a frame that could not be drawn, so that it is not tried again.
    void skip(const std::shared_ptr<const LiveFrame>& frame, const LiveView& view);

  private:
    std::shared_ptr<const LiveFrame> frame_;
    LiveView view_;
    bool is_draft_ = false;
    double draft_scale_ = 0.5;  // of a draft's sides
};

// Wall time that a draft may take, which its size is adapted to.
inline constexpr double kDraftMs = 45;

}  // namespace nephos
