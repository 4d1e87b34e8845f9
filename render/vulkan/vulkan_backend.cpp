// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/vulkan_backend.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "render/backend/host_light.h"
#include "render/ground/mirror_view.h"
#include "render/shared/half_floats.h"

namespace nephos {
namespace {

float largest_radius(const PreparedCloud& cloud) {
    float largest = 0;
    for (const std::uint32_t i : cloud.visible) largest = std::max(largest, cloud.metaballs[i].radius);
    return largest;
}

// Returns the billboards of an order, nearest first; their distances rise, whatever rounding does.
std::vector<shader::SeenBillboard> seen_billboards(const ViewSortedSplats& order) {
    std::vector<shader::SeenBillboard> seen(order.billboards.size());
    float last = 0;
    std::transform(order.billboards.rbegin(), order.billboards.rend(), seen.begin(),
                   [&last](const shader::ViewBillboard& each) {
                       last = std::max(last, std::hypot(each.x, each.y, each.z));
                       return shader::SeenBillboard{each, last};
                   });
    return seen;
}

shader::ShadeStep shade_step(const ShadeCache& shade, int shadow_size) {
    return {.columns = shader::uint(shade.columns),
            .shadow_size = shader::uint(shadow_size),
            .texels = shader::uint(std::lround(shadow_size / std::max(shade.texels_per_map, 1.0)))};
}

}  // namespace

VulkanBackend::VulkanBackend(GpuDevice device) : scene_(std::move(device)) {
    scene_.wait_idle = [this] {
        if (view_) view_->flush();
        if (rain_) rain_->flush();  // reads the shadow map
    };
}

BinnedView& VulkanBackend::view() {
    if (!view_) view_.emplace(scene_.gpu, scene_.unused(), scene_.clamped, scene_.white_beyond);
    return *view_;
}

DeviceRain& VulkanBackend::rain() {
    if (!rain_) {
        rain_.emplace(scene_.gpu, scene_.white_beyond);
        rain_->wait_others = [this] {
            if (view_) view_->flush();
        };
    }
    return *rain_;
}

void VulkanBackend::check_splats(std::size_t splats) {
    if (splats > view().limits.splats)
        throw Error(ErrorCode::usage, "this Vulkan device draws at most " +
                                          std::to_string(view().limits.splats) +
                                          " metaballs and billboards, but there are " +
                                          std::to_string(splats) + ": choose the back-end cpu");
}

void VulkanBackend::check_limits(const FrameDescription& frame) {
    check_splats(frame.cloud.cloud.visible.size() + frame.splats.billboards.size());
    check_distances(frame.cloud.cloud, frame.camera.position_m);
}

// Uploads a cloud with the light that is on the host, unless it is there.
void VulkanBackend::use_cloud(const LitCloud& cloud) {
    if (held_metaballs_ == cloud.metaballs) return;
    held_metaballs_ = held_light_ = 0;  // until all of it is there
    view().use_cloud(cloud_balls(cloud.cloud, cloud.depths_to_draw()));
    held_metaballs_ = cloud.metaballs;
}

void VulkanBackend::use_volumes(const LitCloud& cloud) {
    if (!volumes_) volumes_.emplace(scene_.gpu);
    if (volumes_->has(cloud)) return;
    view().flush();
    volumes_->use(scene_.gpu, cloud);
}

void VulkanBackend::light(LitCloud& cloud, StageTimes& times) {
    if (cloud.all_known) return;
    if (cloud.lit_on_host()) return complete_light_on_host(cloud, times);
    use_cloud(cloud);
    held_light_ = 0;
    if (rain_) rain_->flush();
    view().light(cloud.frame, cloud.shadow_size, largest_radius(cloud.cloud), scene_.light_tiles());
    cloud.all_known = true;
    cloud.note_light_pass();
    cloud.host_light = 0;  // neither depths nor map are there
    held_light_ = depths_on_device_ = cloud.light;
    scene_.note_map(cloud);
}

void VulkanBackend::light_all(LitCloud& cloud, StageTimes& times) {
    check_splats(cloud.cloud.visible.size());
    light(cloud, times);
    fetch_light(cloud);
}

void VulkanBackend::fetch_light(LitCloud& cloud) {
    if (cloud.host_light == cloud.light) return;
    if (depths_on_device_ == cloud.light) view().read_depths(cloud.sun_depths);
    scene_.fetch_map(cloud);
}

bool VulkanBackend::draws_ground(const GroundCoverView& cover, const Camera& mirrored) const {
    const std::size_t most = scene_.gpu.properties.limits.maxStorageBufferRange;
    return 3 * cover.water_mm.size_bytes() <= most &&
           4 * sizeof(float) * mirror_texels(mirror_layout(mirrored)) <= most;
}

void VulkanBackend::use_mirror(const FrameDescription& frame, const Picture& picture) {
    kept_ = frame.keeps ? &picture : nullptr;
    if (frame.keeps) view().begin_mirror(frame.options.camera);
    if (frame.ground != nullptr && frame.ground->mirror != nullptr) view().use_mirror(*frame.ground->mirror);
}

bool VulkanBackend::begin(const FrameDescription& frame, Picture& picture) {
    kept_ = nullptr;  // of one that could not be begun
    check_limits(frame);
    LitCloud& cloud = frame.cloud;
    ViewSortedSplats billboards;
    if (!frame.splats.billboards.empty()) billboards = frame.view_sorted_billboards();
    const std::vector<shader::SeenBillboard> seen = seen_billboards(billboards);
    light(cloud, frame.times);
    if (held_light_ != cloud.light) {  // it was computed on the host
        fetch_light(cloud);
        held_metaballs_ = 0;
    }
    use_cloud(cloud);
    held_light_ = cloud.light;
    if (!frame.lightning.empty()) {
        std::vector<shader::uint> fractions(frame.lightning.size());
        std::ranges::transform(frame.lightning, fractions.begin(), unorm16);
        view().use_flash(fractions);
    }
    const GpuImage& shadow_map = scene_.shadow_map(cloud);
    const bool veiled = cloud.screen && cloud.screen->veils.any();
    const AirShells shells = veiled ? frame.shells() : frame.shells_without_light();
    if (shells.any())
        view().use_shade({shells.shade, shells.serial,
                          cloud.casts_shadow() && !veiled ? &shadow_map : nullptr,
                          shade_step(frame.air.shade, cloud.shadow_size)});
    shader::March march{};
    if (!cloud.volumes.empty()) {
        march = march_constants(cloud, frame.camera, pixels_per_unit(frame.options.camera, frame.camera),
                                frame.options.light, earth_bend(frame.sky));
        use_volumes(cloud);
    }
    use_mirror(frame, picture);
    const StageTimer timer(&frame.times, DrawStage::view);
    const ViewInputs what{.variant = {.physical_sky = frame.sky != nullptr,
                                      .shells = shells.any(),
                                      .fog = shells.has_fog(),
                                      .billboards = !seen.empty(),
                                      .terrain = !frame.terrain.empty(),
                                      .bows = frame.options.light.bows > 0,
                                      .march = march.count > 0},
                          .order = order_frame(frame.camera, frame.options.camera, frame.options.ground,
                                               !frame.lightning.empty(), footprint_scale(cloud.volumes)),
                          .shadow_map = &shadow_map,
                          .sky = frame.sky != nullptr ? &scene_.sky_image(*frame.sky) : nullptr,
                          .scattering = &scene_.scattering(frame.table),
                          .shells = shells.any() ? &shells.data : nullptr,
                          .shell_count = shells.count(),
                          .billboards = seen,
                          .clouds = billboards.clouds,
                          .pictures = frame.splats.pictures.get(),
                          .march = march.count > 0 ? &march : nullptr,
                          .volumes = march.count > 0 ? &*volumes_ : nullptr,
                          .depth = frame.splats.depth,
                          .terrain = frame.terrain,
                          .ground = frame.ground,
                          .shows_mirror = frame.shows_kept || (frame.ground != nullptr && frame.ground->mirror != nullptr),
                          .keeps = frame.keeps,
                          .rain = frame.rains ? rain().prepared(shadow_map) : DeviceRain::Recording{}};
    try {
        for (const FramePart& part : frame.parts)
            view().begin_part(what, part.frame, part.area, picture, &part == &frame.parts.front());
    } catch (...) {
        view().abandon(picture);  // the device may write into it
        throw;
    }
    return true;
}

bool VulkanBackend::prepare_rain(const RainFrame& frame, const Weather& weather, const Picture& picture) {
    return rain().prepare(frame, weather, picture);
}

bool VulkanBackend::begin_rain(const RainFrame& frame, const Weather& weather, const LitCloud* cloud, Picture& picture) {
    // The device's map knows nothing of veils.
    const GpuImage* const map = cloud != nullptr && !picture.sunlight_of_veils &&
                                        !cloud->cloud.visible.empty() && scene_.has_map(*cloud)
                                    ? &scene_.shadow_map(*cloud)
                                    : nullptr;
    try {
        return rain().begin(frame, weather, map, picture);
    } catch (...) {
        rain().abandon(picture);  // strips of it may be on the device
        throw;
    }
}

void VulkanBackend::finish(Picture& picture) {
    const bool keeps = kept_ == &picture;
    if (keeps) kept_ = nullptr;
    if (view_) view_->finish(picture);
    if (keeps) view().keep_mirror();
    if (rain_) rain_->finish(picture);
}

void VulkanBackend::abandon(const Picture& picture) noexcept {
    if (kept_ == &picture) kept_ = nullptr;
    if (view_) view_->abandon(picture);
    if (rain_) rain_->abandon(picture);
}

}  // namespace nephos
