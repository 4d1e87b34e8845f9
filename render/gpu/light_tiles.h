// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 1 of D, in compute shaders: the shadow map, and the light that reaches the centre of every metaball.
//
// D draws the metaballs one after the other into a buffer seen from the sun and reads the light under each
// centre before it is drawn. Sums of optical depth need no such order, and no error of a raster either:
//
//     shadow map     exp(-sum over all balls of their optical depth along the light through the texel)
//     light          exp(-sum over all balls of the part of it between the centre and the sun)
//
// Both look only at the balls of one tile of the map (tile_bins.h); those behind a centre are skipped,
// because balls and centres come in order from the sun. Private to the module.

#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/frame/tile_bins.h"
#include "render/gpu/gpu_pipeline.h"

namespace nephos {

class LightTiles {
  public:
    explicit LightTiles(const GpuDevice& gpu);

    // Leaves the shadow map in shadow_map() and returns the optical depth between each centre and the sun, in
    // the order of `order`.
    std::vector<float> run(const GpuDevice& gpu, const LightSortedSplats& order, int shadow_size);

    // Makes shadow_map() one of shadow_size^2 texels, whose content is lost if it had another size.
    void resize_map(const GpuDevice& gpu, int shadow_size);
    // One batch of the splats: the first clears the sums of the map, the last completes them.
    struct Batch {
        bool first = true, last = true;
        float largest_radius = 0;  // of any splat, metres
    };
    // Records what a batch adds to the map and to the depths of the centres. `resources`: LightSplat, LightPlace,
    // their lists, LightQuery and LightItem, by their numbers in light_map.comp and light_centres.comp. At most
    // `items` items, as many as the arguments of the dispatch at `offset` say.
    void record(const vk::raii::CommandBuffer& commands, DescriptorSets& sets, const Resources& resources,
                const TileGrid& grid, const Batch& batch, std::size_t items, const GpuBuffer& arguments,
                std::size_t offset) const;
    // Copies the texels of the map to the host, once these commands or run() are done.
    void read_map(const GpuDevice& gpu, std::vector<float>& shadow);

    // Takes a shadow map that was made elsewhere: shadow_size^2 texels.
    void use(const GpuDevice& gpu, std::span<const float> shadow, int shadow_size);

    // Readable by fragment and compute shaders.
    const GpuImage& shadow_map() const { return map_; }

  private:
    struct Queries;
    void record_map(const vk::raii::CommandBuffer& commands, DescriptorSets& sets, const Resources& resources,
                    const TileGrid& grid, const Batch& batch) const;
    void ask(const GpuDevice& gpu, const LightSortedSplats& order, const TileGrid& grid, Queries& queries);

    Pipeline map_pipeline_, centres_pipeline_;
    DescriptorSets sets_;  // of run()
    GpuBuffer queries_, splats_, places_, ranges_, list_, items_, depths_;
    GpuBuffer queries_copy_, depths_copy_;  // where the processor reads the device's memory slowly
    GpuImage map_;
};

}  // namespace nephos
