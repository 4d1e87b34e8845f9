// SPDX-License-Identifier: Apache-2.0
#pragma once

// The light pass from an order and lists that the device makes, for a cloud that lies there (device_lists.h):
// the twin of sort_for_light() and bin_centres().
//
//     keys      distances along the light; sort
//     view      metaballs on the shadow map, the tiles that each touches, and the tile of its centre
//     centres   sorted by tile, in each tile nearest to the sun first; cut into items of work
//     lists     as of a picture (device_lists.h), batch by batch:
//     map, light at the centres (light_tiles.h)
//     store     the light goes to the cloud
//
// Private to the module.

#include <span>

#include "render/cloud/cloud_preparation.h"
#include "render/gpu/light_tiles.h"
#include "render/vulkan/device_lists.h"

namespace nephos {

shader::SunFrame sun_frame(const ShadowFrame& frame, int shadow_size);

// The input of the light pass: metaballs and sun.
struct SunRequest {
    std::size_t metaballs = 0;  // the first of lists.cloud()
    ShadowFrame frame;
    int shadow_size = 0;       // texels on a side of the map
    float largest_radius = 0;  // metres, of any metaball
};

class DeviceSun {
  public:
    explicit DeviceSun(const GpuDevice& gpu);

    // Lights metaballs on the device, and makes the shadow map in `tiles`; in smaller batches when their lists are
    // longer than the limits. Nothing else may be in flight. Throws Error(gpu) if not even one metaball fits.
    void run(const GpuDevice& gpu, const SunRequest& request, DeviceLists& lists, const ListLimits& limits,
             LightTiles& tiles);
    // Copies the optical depths between centres and sun that the last run() computed.
    void read_depths(std::span<float> depths) const;

  private:
    void record(const vk::raii::CommandBuffer& commands, const SunRequest& request, const DeviceLists& lists,
                std::size_t batch, const LightTiles& tiles);

    std::uint32_t per_item_;  // centres in an item of work
    DescriptorSets sets_;
    GpuBuffer frame_, no_shells_;
    GpuBuffer places_, queries_, items_, depths_, counts_;
};

}  // namespace nephos
