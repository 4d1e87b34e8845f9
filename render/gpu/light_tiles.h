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
    // `unused` is not read, but lavapipe (Mesa 22.3) wants every sampler of a set to be bound.
    LightTiles(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& unused,
               const vk::raii::Sampler& sampler);

    // Leaves the shadow map in shadow_map() and returns the optical depth between each centre and the sun, in
    // the order of `order`.
    std::vector<float> run(const GpuDevice& gpu, const LightSortedSplats& order, int shadow_size);

    // The same from lists on the device (device_sun.h): buffers as bindings 1, 2, 5, 6, 7 and 9 want them.
    struct Lists {
        const GpuBuffer *queries, *splats, *ranges, *list, *items, *places;
    };
    void use_lists(const GpuDevice& gpu, int shadow_size, const Lists& lists);
    // Map and light at the centres; at most `items`, as many as the arguments of the dispatch at `offset`
    // say.
    void record_lists(const vk::raii::CommandBuffer& commands, const TileGrid& grid, float largest_radius,
                      std::size_t items, const GpuBuffer& arguments, std::size_t offset) const;
    // Copies the texels of the map to the host, once these commands or run() are done.
    void read_map(const GpuDevice& gpu, std::vector<float>& shadow);

    // Takes a shadow map that was made elsewhere: shadow_size^2 texels.
    void use(const GpuDevice& gpu, std::span<const float> shadow, int shadow_size);

    // Readable by fragment and compute shaders.
    const GpuImage& shadow_map() const { return map_; }

  private:
    struct Queries;
    void resize_map(const GpuDevice& gpu, int shadow_size);
    void upload_bins(const GpuDevice& gpu, const TileBins& bins);
    void draw_map(const GpuDevice& gpu, const TileGrid& grid, bool first, bool last);
    void ask(const GpuDevice& gpu, const LightSortedSplats& order, const TileGrid& grid, Queries& queries);

    const PipelineLayout* layout_;
    const vk::raii::Sampler* sampler_;
    vk::raii::Pipeline map_pipeline_, centres_pipeline_;
    Bindings bindings_;
    Bindings listed_;  // of lists on the device
    GpuBuffer queries_, splats_, places_, ranges_, list_, items_, depths_;
    GpuBuffer queries_copy_, depths_copy_;  // where the processor reads the device's memory slowly
    GpuImage map_;
};

}  // namespace nephos
