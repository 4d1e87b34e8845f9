// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/vulkan_backend.h"

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "render/shared/half_floats.h"

namespace nephos {
namespace {

bool lists_of(const GpuDevice& gpu, TileLists lists) {
    const std::string missing = missing_for_lists(gpu);
    if (lists == TileLists::device && !missing.empty())
        throw Error(ErrorCode::usage,
                    "the Vulkan device cannot make the lists of tiles: it lacks " + missing);
    if (lists != TileLists::automatic) return lists == TileLists::device;
    return gpu.properties.deviceType != vk::PhysicalDeviceType::eCpu && missing.empty();
}

float largest_radius(const PreparedCloud& cloud) {
    float largest = 0;
    for (const std::uint32_t i : cloud.visible) largest = std::max(largest, cloud.metaballs[i].radius);
    return largest;
}

}  // namespace

VulkanBackend::VulkanBackend(GpuDevice device, TileLists lists)
    : scene_(std::move(device)), lists_on_device_(lists_of(scene_.gpu, lists)) {
    scene_.wait_idle = [this] {
        if (listed_view_) listed_view_->flush();
    };
}

ListedView& VulkanBackend::listed_view() {
    if (!listed_view_)
        listed_view_.emplace(scene_.gpu, scene_.layout, scene_.unused(), scene_.clamped, scene_.white_beyond);
    return *listed_view_;
}

// Returns true when the device can sort and bin the metaballs of a cloud.
bool VulkanBackend::can_list(const LitCloud& cloud) {
    if (!lists_on_device_ || cloud.cloud.visible.empty() ||
        cloud.cloud.visible.size() > listed_view().limits.balls)
        return false;
    if (nearness_.metaballs != cloud.metaballs) nearness_ = {cloud.metaballs, is_near_enough(cloud.cloud)};
    return nearness_.is_near;
}

bool VulkanBackend::uses_lists(const FrameDescription& frame) {
    return !frame.overflowed && frame.splats.billboards.empty() && can_list(frame.cloud) &&
           is_near_enough(frame.camera.position_m);
}

// Computes light with lists made on the device. Returns false on overflow.
bool VulkanBackend::light_listed(LitCloud& cloud) {
    if (!can_list(cloud)) return false;
    if (held_metaballs_ != cloud.metaballs) {
        held_metaballs_ = 0;  // until all of it is there
        listed_view().use_cloud(cloud_balls(cloud.cloud, cloud.sun_depths));
        held_metaballs_ = cloud.metaballs;
    }
    held_light_ = 0;
    if (!listed_view().light(cloud.frame, cloud.shadow_size, largest_radius(cloud.cloud),
                             scene_.light_tiles()))
        return false;
    cloud.all_known = true;
    cloud.note_light_pass();
    cloud.host_light = 0;  // neither depths nor map are there
    held_light_ = depths_on_device_ = cloud.light;
    scene_.note_map(cloud);
    return true;
}

void VulkanBackend::light(LitCloud& cloud) {
    if (!cloud.all_known && !light_listed(cloud)) scene_.light(cloud);
}

void VulkanBackend::light_all(LitCloud& cloud, StageTimes&) {
    scene_.light(cloud);
    fetch_light(cloud);
}

void VulkanBackend::fetch_light(LitCloud& cloud) {
    if (cloud.host_light == cloud.light) return;
    if (depths_on_device_ == cloud.light) listed_view().read_depths(cloud.sun_depths);
    scene_.fetch_map(cloud);
}

bool VulkanBackend::begin(const FrameDescription& frame, Picture& picture) {
    if (!uses_lists(frame)) {
        draw_ordered(frame, picture);
        return false;
    }
    begin_listed(frame, picture);
    return true;
}

void VulkanBackend::begin_listed(const FrameDescription& frame, Picture& picture) {
    LitCloud& cloud = frame.cloud;
    ListedView& view = listed_view();
    light(cloud);
    if (held_metaballs_ != cloud.metaballs || held_light_ != cloud.light) {
        fetch_light(cloud);
        held_metaballs_ = held_light_ = 0;
        view.use_cloud(cloud_balls(cloud.cloud, cloud.sun_depths));
        held_metaballs_ = cloud.metaballs;
        held_light_ = cloud.light;
    }
    if (!frame.lightning.empty()) {
        std::vector<shader::uint> fractions(frame.lightning.size());
        std::ranges::transform(frame.lightning, fractions.begin(), unorm16);
        view.use_flash(fractions);
    }
    if (has_shells(frame.options, cloud.cloud)) fetch_light(cloud);
    const AirShells shells = frame.shells();
    if (shells.any()) view.use_shade(shells.shade, shells.serial);
    const StageTimer timer(&frame.times, DrawStage::view);
    const ListedPicture what{
        .variant = {.physical_sky = frame.sky != nullptr, .shells = shells.any(), .fog = shells.has_fog()},
        .order =
            order_frame(frame.camera, frame.options.camera, frame.options.ground, !frame.lightning.empty()),
        .shadow_map = &scene_.shadow_map(cloud),
        .sky = frame.sky != nullptr ? &scene_.sky_image(*frame.sky) : nullptr,
        .scattering = &scene_.scattering(frame.table),
        .shells = shells.any() ? &shells.data : nullptr,
        .shell_count = shells.count(),
        .depth = frame.splats.depth};
    try {
        for (const FramePart& part : frame.parts)
            view.begin_tile(what, part.frame, part.tile, picture, &part == &frame.parts.front());
    } catch (...) {
        view.abandon(picture);  // the device may write into it
        throw;
    }
}

void VulkanBackend::draw_ordered(const FrameDescription& frame, Picture& picture) {
    LitCloud& cloud = frame.cloud;
    ViewSortedSplats order = frame.view_sorted();
    light(cloud);
    fetch_light(cloud);
    set_light(order, {cloud.sun_depths, frame.lightning});
    const AirShells shells = frame.shells();
    const bool billboards = !order.billboards.empty();
    const StageTimer timer(&frame.times, DrawStage::view);
    ViewTiles& pass =
        prepared_pass(passes_[billboards ? 1 : 0], scene_, scene_.unused(), frame, order, shells, billboards);
    for (const FramePart& part : frame.parts)
        pass.draw_tile(scene_.gpu, frame.options, frame.camera, part.frame, part.tile, order, picture);
}

bool VulkanBackend::finish(Picture& picture) { return listed_view().finish(picture); }

void VulkanBackend::abandon(const Picture& picture) noexcept {
    if (listed_view_) listed_view_->abandon(picture);
}

}  // namespace nephos
