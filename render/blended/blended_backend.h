// SPDX-License-Identifier: Apache-2.0
#pragma once

// The back-end that draws as D does: billboards with 64 textures of attenuation, blended back to front by the
// graphics pipeline (view_pass.h), with the light pass in compute shaders (light_tiles.h). The reference of the
// others. Private to the module.

#include <memory>
#include <optional>

#include "render/blended/view_pass.h"
#include "render/gpu/gpu_scene.h"

namespace nephos {

class BlendedBackend : public Backend {
  public:
    explicit BlendedBackend(GpuDevice device) : scene_(std::move(device)) {}

    std::string name() const override { return "blended"; }
    std::string device_name() const override { return scene_.gpu.properties.deviceName.data(); }
    int longest_part() const override { return scene_.longest_part(); }
    int largest_shadow_map() const override { return scene_.largest_shadow_map(); }

    void light_all(LitCloud& cloud, StageTimes& times) override;
    void fetch_light(LitCloud& cloud) override { scene_.fetch_map(cloud); }
    // Draws at once.
    bool begin(const FrameDescription& frame, Picture& picture) override;
    std::vector<std::string> validation_messages() const override { return scene_.validation_messages(); }

    GpuScene& scene() { return scene_; }

  private:
    // Returns the pass for a picture, with all that it reads.
    ViewPass& pass_for(const FrameDescription& frame, const AirShells& shells, const ViewSortedSplats& order);

    GpuScene scene_;
    std::optional<GpuImage> attenuation_;  // created when it is needed
    // Created when they are needed: without and with fogbow and glory, a ground that is not level, the physical
    // sky; without shells of air, with them, and with fog in them.
    std::optional<ViewPass> passes_[2][2][2][3];
};

}  // namespace nephos
