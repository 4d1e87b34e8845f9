// SPDX-License-Identifier: Apache-2.0
#include "render/cpu/cpu_backend.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <span>

#include <hwy/highway.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "render/backend/host_light.h"
#include "render/backend/processor_light.h"
#include "render/cpu/processor_view.h"
#include "render/frame/view_sorting.h"

namespace nephos {
namespace {

// Returns true when any requested element is not known yet.
bool any_missing(const std::vector<std::uint8_t>& requested, const std::vector<std::uint8_t>& known) {
    for (std::size_t i = 0; i < requested.size(); ++i)
        if (requested[i] != 0 && known[i] == 0) return true;
    return false;
}

// Leaves those out of `requested` that are known, and notes the others as known.
void take_missing(std::vector<std::uint8_t>& requested, std::vector<std::uint8_t>& known) {
    for (std::size_t i = 0; i < requested.size(); ++i) {
        requested[i] = requested[i] != 0 && known[i] == 0 ? 1 : 0;
        known[i] |= requested[i];
    }
}

// Computes what is missing of the light of the balls numbered `source` and of the tiles of the shadow map
// where `seen` has them; of all light if `seen` is null, or if anything is missing in a second picture. What
// one ball gets has the same bits whatever else is computed.
void complete_light(LitCloud& cloud, const std::vector<std::uint32_t>& source, const VisibleSet* seen,
                    StageTimes& times) {
    if (cloud.all_known) return;
    std::vector<std::uint8_t> balls(cloud.sun_depths.size(), seen == nullptr ? 1 : 0);
    std::vector<std::uint8_t> tiles(cloud.known_tiles.size(), 1);
    if (seen != nullptr) {
        for (std::size_t i = 0; i < source.size(); ++i) balls[source[i]] = seen->balls[i];
        tiles = seen->map_tiles;
        if (!any_missing(balls, cloud.known_light) && !any_missing(tiles, cloud.known_tiles)) return;
        if (cloud.drawn_again) {  // a camera that moves: it will see the rest, too
            std::ranges::fill(balls, std::uint8_t{1});
            std::ranges::fill(tiles, std::uint8_t{1});
        }
    }
    if (cloud.lit_on_host()) std::ranges::fill(tiles, std::uint8_t{1});
    take_missing(balls, cloud.known_light);
    take_missing(tiles, cloud.known_tiles);
    cloud.all_known =
        std::ranges::count(cloud.known_light, 0) == 0 && std::ranges::count(cloud.known_tiles, 0) == 0;

    if (cloud.lit_on_host()) {
        complete_light_on_host(cloud, balls, tiles, times);
        cloud.note_light_pass();
        return;
    }
    LightSortedSplats order;
    {
        const StageTimer timer(&times, DrawStage::sun_order);
        order = sort_for_light(cloud.cloud, cloud.frame, cloud.shadow_size);
    }
    // Balls are read twice; keys move through memory three times, and back and forth.
    times[DrawStage::sun_order].bytes = order.splats.size() * (2 * sizeof(Metaball) + 7 * 8 + 28);
    light_some_by_processor(order, cloud.shadow_size, balls, tiles, cloud.sun_depths, cloud.shadow, &times);
    cloud.note_light_pass();
}

}  // namespace

std::string CpuBackend::device_name() const {
    // Highway takes the best of the targets that were compiled: the one with the lowest bit.
    const auto targets = std::int64_t(hwy::SupportedTargets()) & std::int64_t(HWY_TARGETS);
    const std::size_t threads =
        std::min(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                 std::size_t(tbb::this_task_arena::max_concurrency()));
    return std::string("cpu (") + hwy::TargetName(targets & -targets) + ", " + std::to_string(threads) +
           (threads == 1 ? " thread)" : " threads)");
}

int CpuBackend::longest_part() const { return std::numeric_limits<int>::max(); }
int CpuBackend::largest_shadow_map() const { return std::numeric_limits<int>::max(); }

void CpuBackend::light_all(LitCloud& cloud, StageTimes& times) { complete_light(cloud, {}, nullptr, times); }

bool CpuBackend::begin(const FrameDescription& frame, Picture& picture) {
    LitCloud& cloud = frame.cloud;
    ViewSortedSplats order = frame.view_sorted();
    std::vector<ProcessorView> views;
    for (const FramePart& part : frame.parts)
        views.emplace_back(frame.options, frame.camera, part.frame, part.area, order, BatchLimits{},
                           &frame.times);
    std::optional<VisibleSet> seen;
    if (!frame.splats.light && !cloud.all_known) {
        seen.emplace(order, cloud.shadow_size);
        for (ProcessorView& view : views) view.find_visible(cloud.shadow_size, *seen);
        if (has_shells(frame.options, cloud.casts_shadow()) || frame.splats.terrain != nullptr)
            std::ranges::fill(seen->map_tiles, std::uint8_t{1});
    }
    const VisibleSet* const known = seen ? &*seen : nullptr;
    complete_light(cloud, order.source, known, frame.times);
    set_light(order, {cloud.depths_to_draw(), frame.lightning});
    const AirShells shells = frame.shells();
    const MarchedScene march(cloud.volumes, frame.camera, pixels_per_unit(frame.options.camera, frame.camera),
                             frame.options.light, earth_bend(frame.sky));
    for (ProcessorView& view : views)
        view.draw(picture, cloud.shadow.data(), cloud.shadow_size, shells, known,
                  march.volumes.empty() ? nullptr : &march);
    return false;
}

}  // namespace nephos
