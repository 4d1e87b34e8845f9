// SPDX-License-Identifier: Apache-2.0
#pragma once

// Clouds with detail (LitCloud::volumes) in device memory, for shaders that march through them
// (render/shading/march.glsl). Private to the module.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "render/backend/lit_cloud.h"
#include "render/gpu/descriptor_sets.h"
#include "render/options/camera.h"
#include "render/shared/march.h"

namespace nephos {

// What shaders know of these volumes and words. Throws Error(usage) when there are more than shader::kMostVolumes.
shader::March march_constants(const LitCloud& cloud, const CameraFrame& camera,
                              double pixels_per_unit, const CloudLight& light, float bend);

class MarchVolumes {
  public:
    // Uploads the noise.
    explicit MarchVolumes(const GpuDevice& gpu);

    // Whether use() has nothing to do.
    bool has(const LitCloud& cloud) const {
        return cells_version_ == cloud.volumes_version && light_version_ == cloud.volumes_light;
    }
    // Uploads what has changed of the volumes; nothing that reads them may be in flight. Throws Error(usage) when a
    // device has no buffers so large.
    void use(const GpuDevice& gpu, const LitCloud& cloud);

    // Make room for the rays of so many pixels; then nothing that reads them may be in flight.
    bool has_room(std::size_t pixels) const { return states_.bytes >= 4 * sizeof(float) * pixels; }
    void reserve(const GpuDevice& gpu, std::size_t pixels);

    // Returns what shaders that march read and write; `constants`: a shader::March.
    Resources resources(const GpuBuffer& constants) const {
        return {{18, constants}, cells_.as(19), light_.as(20), noise_.as(21), {22, states_}};
    }

  private:
    // Words in a buffer that may have room for more.
    struct Words {
        GpuBuffer buffer;
        std::size_t bytes = 0;
        Resource as(std::uint32_t number) const {
            Resource resource(number, buffer);
            resource.bytes = bytes;
            return resource;
        }
    };
    // Replaces them by `count` words, which `write_words` writes in any order and does not read.
    void upload(const GpuDevice& gpu, Words& to, std::size_t count,
                const std::function<void(std::span<std::uint32_t> words)>& write_words);

    Words cells_, light_, noise_;
    GpuBuffer staging_;  // from which they are copied
    GpuBuffer states_;  // of the rays, between two dispatches
    Version cells_version_ = 0, light_version_ = 0;
};

}  // namespace nephos
