// SPDX-License-Identifier: Apache-2.0
#pragma once

// Clouds with detail (LitCloud::volumes) in device memory, for shaders that march through them
// (render/shading/march.glsl). Private to the module.

#include <cstdint>
#include <span>
#include <vector>

#include "render/backend/lit_cloud.h"
#include "render/gpu/descriptor_sets.h"
#include "render/options/camera.h"
#include "render/shared/march.h"

namespace nephos {

// Words of all volumes that hold cloud, one volume after the other: table, cells and nodes of their fields. A node's
// word has its t and growth, and those of the next along x: what a look-up interpolates.
std::vector<std::uint32_t> march_cells(std::span<const CloudVolume> volumes);
// Words of the corners of cells, with what the next along x has: sun depths, then surroundings, of each volume; then those
// of the light on the ground.
std::vector<std::uint32_t> march_light(const LitCloud& cloud);
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
        return {{18, constants}, {19, cells_}, {20, light_}, {21, noise_}, {22, states_}};
    }

  private:
    GpuBuffer cells_, light_, noise_;
    GpuBuffer states_;  // of the rays, between two dispatches
    Version cells_version_ = 0, light_version_ = 0;
};

}  // namespace nephos
