// SPDX-License-Identifier: Apache-2.0
#pragma once

// The shade map of the shells of air on the device, and the noise of fog behind it (air_shells.h). The host computes
// the planes where shade begins and is complete; the plane of light is made from the shadow map, which is on the
// device already. Private to the module.

#include <cstdint>
#include <span>

#include "render/gpu/descriptor_sets.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/shared/order.h"

namespace nephos {

struct ShadeInputs {
    std::span<const std::uint32_t> words;  // ShadeCache::words
    std::uint64_t serial = 0;              // of the words
    const GpuImage* shadow_map = nullptr;  // null: the words have the plane of light, or there is no cloud
    shader::ShadeStep step{};              // sizes of both maps
};

class DeviceShade {
  public:
    // With words that are never read: descriptors must be there, used or not.
    explicit DeviceShade(const GpuDevice& gpu);

    bool has(std::uint64_t serial) const { return serial == serial_; }
    // Uploads the words and computes the plane of light; nothing that reads them may be in flight. `white_beyond`:
    // sampler of the shadow map.
    void use(const GpuDevice& gpu, const ShadeInputs& shade, const vk::raii::Sampler& white_beyond);

    // Returns the words: binding 14 of shells.glsl.
    const GpuBuffer& words() const { return words_; }

  private:
    Pipeline light_;
    DescriptorSets sets_;
    GpuBuffer words_;
    std::uint64_t serial_ = 0;
};

}  // namespace nephos
