// SPDX-License-Identifier: Apache-2.0
#pragma once

// The back-end of graphics cards: compute shaders, tile by tile, front to back. The cloud stays on the
// device, with its light, and the device itself sorts and bins it (binned_view.h), so that of a picture nothing but
// the camera, and T's billboards, are uploaded. Private to the module.

#include <optional>

#include "render/gpu/gpu_scene.h"
#include "render/vulkan/binned_view.h"
#include "render/vulkan/device_rain.h"

namespace nephos {

class VulkanBackend : public Backend {
  public:
    explicit VulkanBackend(GpuDevice device);

    std::string name() const override { return "vulkan"; }
    std::string device_name() const override { return scene_.gpu.properties.deviceName.data(); }
    int longest_part() const override { return scene_.longest_part(); }
    int largest_shadow_map() const override { return scene_.largest_shadow_map(); }

    void light_all(LitCloud& cloud, StageTimes& times) override;
    void fetch_light(LitCloud& cloud) override;
    // Throws Error(usage), too, when there are more splats than the device takes, or some too far away.
    bool begin(const FrameDescription& frame, Picture& picture) override;
    void finish(Picture& picture) override;
    void abandon(const Picture& picture) noexcept override;
    bool draws_rain() const override { return true; }
    bool prepare_rain(const RainFrame& frame, const Weather& weather, const Picture& picture) override;
    bool begin_rain(const RainFrame& rain, const Weather& weather, const LitCloud* cloud, Picture& picture) override;
    bool draws_ground(const GroundCoverView& cover, const Camera& mirrored) const override;
    bool marches() const override { return true; }
    std::vector<std::string> validation_messages() const override { return scene_.validation_messages(); }

    GpuScene& scene() { return scene_; }
    // Return the view and the rain, created by the first call.
    BinnedView& view();
    DeviceRain& rain();
    const DeviceRain* rain_if_created() const { return rain_ ? &*rain_ : nullptr; }
    const BinnedView* view_if_created() const { return view_ ? &*view_ : nullptr; }

  private:
    void check_splats(std::size_t splats);
    void check_limits(const FrameDescription& frame);
    void use_cloud(const LitCloud& cloud);
    void use_volumes(const LitCloud& cloud);
    void use_mirror(const FrameDescription& frame, const Picture& picture);
    void light(LitCloud& cloud, StageTimes& times);

    GpuScene scene_;
    const Picture* kept_ = nullptr;  // in flight, on its way to the view's mirror
    std::optional<MarchVolumes> volumes_;  // with the first cloud with detail
    Version held_metaballs_ = 0;    // LitCloud::metaballs of what is in view_
    Version held_light_ = 0;        // LitCloud::light of the light of these
    Version depths_on_device_ = 0;  // LitCloud::light of the depths that view_ computed
    // Last, and so the first to go: they wait for frames in flight, which read the others.
    std::optional<BinnedView> view_;
    std::optional<DeviceRain> rain_;  // with the first rain
};

}  // namespace nephos
