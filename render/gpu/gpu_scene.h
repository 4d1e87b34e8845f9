// SPDX-License-Identifier: Apache-2.0
#pragma once

// Shared by the Vulkan and the blended back-end: the device, and in its memory the shadow map, the scattering
// table and the tables of the sky, each uploaded again when its version changes. Private to the module.

#include <functional>
#include <optional>
#include <vector>

#include "render/backend/backend.h"
#include "render/gpu/frame_uploads.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/gpu/light_tiles.h"

namespace nephos {

class GpuScene {
  public:
    explicit GpuScene(GpuDevice device);
    GpuScene(const GpuScene&) = delete;
    GpuScene& operator=(const GpuScene&) = delete;

    GpuDevice gpu;
    vk::raii::Sampler clamped, white_beyond;  // beyond the edge: the edge's texel; white
    // Waits for frames in flight, before anything that they read is replaced. Empty: there are none.
    std::function<void()> wait_idle;

    int longest_part() const;
    int largest_shadow_map() const;
    std::vector<std::string> validation_messages() const;

    // For images that a variant of a shader declares and does not read. It stays where it is.
    const GpuImage& unused();
    LightTiles& light_tiles();
    const GpuImage& sky_image(const SkyLight& sky);
    const GpuBuffer& scattering(const Versioned<std::vector<float>>& table);
    // Returns the shadow map of a cloud whose light is complete, and on the host unless has_map().
    const GpuImage& shadow_map(const LitCloud& cloud);
    bool has_map(const LitCloud& cloud) const { return map_ == cloud.light; }
    // Notes that the shadow map in light_tiles() is that of the cloud.
    void note_map(const LitCloud& cloud) { map_ = cloud.light; }

    // D, step 1, in compute shaders, from an order that the host makes: completes the light of a cloud. The
    // shadow map stays on the device until fetch_map(). Light that the host computes is computed there.
    void light(LitCloud& cloud, StageTimes& times);
    void fetch_map(LitCloud& cloud);

  private:
    void wait() const {
        if (wait_idle) wait_idle();
    }
    std::optional<GpuImage> unused_;
    std::optional<LightTiles> light_tiles_;
    std::optional<SkyImage> sky_image_;
    GpuBuffer scattering_;
    Version scattering_version_ = 0;
    Version map_ = 0;  // LitCloud::light of the map in light_tiles_
};

}  // namespace nephos
