// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/report.h"

#include <algorithm>
#include <ctime>
#include <utility>

#include <fmt/format.h>

#include "apps/editor/state.h"

namespace nephos {
namespace {

// Returns the processor time of all threads.
double processor_seconds() {
    timespec time{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
}

}  // namespace

double seconds_since(Report::Clock::time_point begin) {
    return std::chrono::duration<double>(Report::Clock::now() - begin).count();
}

void Report::Wait::begin(std::uint64_t what) { *this = {what, Clock::now(), true, count, longest_s}; }

void Report::Wait::end() {
    if (!std::exchange(waits, false)) return;
    ++count;
    longest_s = std::max(longest_s, seconds_since(since));
}

void Report::watch(const Editor& editor) {
    if (!editor.picture) return;
    if (first_picture_s == 0) {
        first_picture_s = seconds_since(begin);
        first_picture_processor_s = processor_seconds();
    }
    if (std::exchange(scene, editor.live.get()) != editor.live.get()) change.waits = seek.waits = false;
    const LiveStatus status = editor.live->status();
    if (status.scenes > editor.picture->scene_number && !change.waits) change.begin(status.scenes);
    if (editor.picture->scene_number >= change.wanted) change.end();
    const bool goes = !editor.running && status.goal < status.rows;  // to a step that was seen
    if (goes && status.goal != editor.picture->step && !(seek.waits && seek.wanted == status.goal))
        seek.begin(status.goal);
    if (editor.picture->step == seek.wanted) seek.end();
    if (editor.running) seek.waits = false;
}

void Report::print(const Editor& editor) const {
    const double seconds = seconds_since(begin);
    std::vector<double> sorted = intervals;
    std::ranges::sort(sorted);
    const double slowest = sorted.empty() ? 0 : sorted[std::size_t(0.99 * double(sorted.size() - 1))];
    fmt::print("first frame {:.2f} s, first picture {:.2f} s after the start, {:.2f} s of processor time\n",
               first_frame_s, first_picture_s, first_picture_processor_s);
    fmt::print("interface {:.1f} frames/s, longest frame {:.0f} ms, 99 % within {:.0f} ms\n",
               double(frames) / seconds, 1e3 * longest_frame_s, 1e3 * slowest);
    const double shown = std::max(0.1, seconds - first_picture_s);
    fmt::print("pictures {:.1f} a second, the last of {}x{} in {:.0f} ms by {}\n",
               double(editor.pictures) / shown, editor.picture ? editor.picture->width : 0,
               editor.picture ? editor.picture->height : 0, editor.picture ? editor.picture->draw_ms : 0,
               editor.live->status().device);
    if (change.count > 0)
        fmt::print("changes {}, shown within {:.0f} ms\n", change.count, 1e3 * change.longest_s);
    if (seek.count > 0)
        fmt::print("steps gone to {}, shown within {:.0f} ms\n", seek.count, 1e3 * seek.longest_s);
    const LiveStatus status = editor.live->status();
    fmt::print("step {} of {}, {:.2f} ms a step, {} checkpoints of {} MiB\n", status.step, status.rows,
               status.step_ms, status.checkpoints, status.checkpoint_bytes >> 20);
}

}  // namespace nephos
