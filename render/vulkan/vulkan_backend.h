// SPDX-License-Identifier: Apache-2.0
#pragma once

// The back-end of graphics cards: compute shaders, tile by tile, front to back. The cloud stays on the
// device, with its light, and the device itself sorts it and makes the lists of the tiles (listed_view.h), so
// that of a picture nothing but the camera is sent. Pictures with billboards, and what is too much for these
// lists, are drawn from lists that the host makes (view_tiles.h). Private to the module.

#include <optional>

#include "render/gpu/gpu_scene.h"
#include "render/vulkan/listed_view.h"
#include "render/vulkan/view_tiles.h"

namespace nephos {

class VulkanBackend : public Backend {
  public:
    // Throws Error(usage) if `lists` asks for lists of a device that cannot make them.
    VulkanBackend(GpuDevice device, TileLists lists);

    std::string name() const override { return "vulkan"; }
    std::string device_name() const override { return scene_.gpu.properties.deviceName.data(); }
    int longest_part() const override { return scene_.longest_part(); }
    int largest_shadow_map() const override { return scene_.largest_shadow_map(); }

    void light_all(LitCloud& cloud, StageTimes& times) override;
    void fetch_light(LitCloud& cloud) override;
    bool begin(const FrameDescription& frame, Picture& picture) override;
    bool finish(Picture& picture) override;
    void abandon(const Picture& picture) noexcept override;
    std::vector<std::string> validation_messages() const override { return scene_.validation_messages(); }

    GpuScene& scene() { return scene_; }
    // Returns the view by lists of the device, created by the first call.
    ListedView& listed_view();
    const ListedView* listed_view_if_made() const { return listed_view_ ? &*listed_view_ : nullptr; }

  private:
    bool can_list(const LitCloud& cloud);
    bool uses_lists(const FrameDescription& frame);
    void light(LitCloud& cloud);
    bool light_listed(LitCloud& cloud);
    void begin_listed(const FrameDescription& frame, Picture& picture);
    void draw_ordered(const FrameDescription& frame, Picture& picture);

    GpuScene scene_;
    bool lists_on_device_;
    PassVariants<ViewTiles> passes_[2];  // without and with billboards
    struct Nearness {
        Version metaballs = 0;
        bool is_near = false;
    };
    Nearness nearness_;             // of the cloud that was asked for last
    Version held_metaballs_ = 0;    // LitCloud::metaballs of what is in listed_view_
    Version held_light_ = 0;        // LitCloud::light of the light of these
    Version depths_on_device_ = 0;  // LitCloud::light of the depths that listed_view_ computed
    // Last, and so the first to go: it waits for frames in flight, which read the others.
    std::optional<ListedView> listed_view_;
};

}  // namespace nephos
