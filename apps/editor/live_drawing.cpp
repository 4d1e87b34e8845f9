// SPDX-License-Identifier: Apache-2.0
// The two threads of a live scene that draw: drafts of what changes, and the picture with its detail when nothing does.

#include <utility>

#include <sys/resource.h>

#include "apps/editor/live.h"
#include "apps/editor/live_picture.h"

namespace nephos {
namespace {

// A picture is drawn with its detail when nothing has moved for so long.
constexpr std::chrono::milliseconds kRest{180};

// Draws one picture after the other.
struct Artist {
    DeviceOptions device;
    std::unique_ptr<FramePainter> painter;
    std::uint64_t painted_simulation = 0;
    LivePictureMaker maker;
    std::string device_name, failure;  // of the last picture

    // Returns null when it failed.
    std::shared_ptr<LivePicture> draw(const Scene& scene, const std::shared_ptr<const LiveFrame>& frame,
                                      const LiveView& view, bool refine) {
        failure.clear();
        try {
            if (!painter) painter = std::make_unique<FramePainter>(scene, device);
            const bool paints =
                view.mode != kWireframe && view.mode != kVoxels;  // the others leave the painter as it is
            const bool same = painted_simulation == frame->simulation_number;
            if (paints) painted_simulation = frame->simulation_number;
            std::shared_ptr<LivePicture> made = maker.draw(*painter, scene, frame, view, refine, same);
            device_name = painter->device_name();
            return made;
        } catch (const std::exception& error) {
            failure = error.what();
            painter.reset();  // a device that failed is opened anew
            return nullptr;
        }
    }
};

}  // namespace

void yield_to_window(int steps) { ::setpriority(PRIO_PROCESS, 0, ::getpriority(PRIO_PROCESS, 0) + steps); }

// Holds what a thread draws without the mutex.
struct LiveScene::Shown {
    std::shared_ptr<const LiveFrame> frame;
    LiveView view;
    Scene scene;
    std::uint64_t clears = 0, scene_number = 0;
};

LiveScene::Shown LiveScene::shown_now() const {
    return {frame_, view_, drawn_scene_, clears_, drawn_number_};
}

// With the mutex.
void LiveScene::publish(std::shared_ptr<LivePicture> picture, const Shown& what, const std::string& device,
                        const std::string& failure) {
    draw_failure_ = failure;
    if (!picture) return;
    picture->number = ++pictures_;
    picture->scene_number = what.scene_number;
    picture_ = std::move(picture);
    status_.device = device;
}

void LiveScene::draw() {
    yield_to_window(kNicer);
    Artist artist{device_, nullptr, 0, {}, {}, {}};
    std::unique_lock lock(mutex_);
    while (true) {
        drawing_due_.wait(lock, [this] {
            const bool is_new = frame_ != drafted_frame_ || !(view_ == drafted_view_) || scene_to_draw_;
            return ended_ || (frame_ && shown_ && is_new);
        });
        if (ended_) return;
        const Shown what = shown_now();
        scene_to_draw_ = false;
        lock.unlock();
        std::shared_ptr<LivePicture> made = artist.draw(what.scene, what.frame, what.view, false);
        lock.lock();
        drafted_frame_ = what.frame;
        drafted_view_ = what.view;
        draft_waits_ = made != nullptr;
        ++drafts_;
        if (what.clears != clears_) continue;  // of a scene that is gone
        publish(std::move(made), what, artist.device_name, artist.failure);
        drawing_due_.notify_all();
    }
}

void LiveScene::refine() {
    yield_to_window(kNicest);
    Artist artist{device_, nullptr, 0, {}, {}, {}};
    std::unique_lock lock(mutex_);
    while (true) {
        const auto rests = [this] {
            const bool stands = !running_ || !status_.failure.empty();
            const bool is_drafted = frame_ == drafted_frame_ && view_ == drafted_view_ && !scene_to_draw_;
            return frame_ && shown_ && draft_waits_ && is_drafted && stands && goal_ == status_.step;
        };
        drawing_due_.wait(lock, [&] { return ended_ || rests(); });
        const std::uint64_t draft = drafts_;
        const auto moves = [&] { return ended_ || !rests() || drafts_ != draft; };
        if (!ended_ && drawing_due_.wait_for(lock, kRest, moves)) continue;
        if (ended_) return;
        draft_waits_ = false;
        const Shown what = shown_now();
        lock.unlock();
        std::shared_ptr<LivePicture> made = artist.draw(what.scene, what.frame, what.view, true);
        lock.lock();
        const bool is_old = what.clears != clears_ || what.frame != frame_ || !(what.view == view_) ||
                            what.scene_number != drawn_number_;
        if (!is_old) publish(std::move(made), what, artist.device_name, artist.failure);
    }
}

}  // namespace nephos
