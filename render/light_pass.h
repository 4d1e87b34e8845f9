// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 1 of D. A square buffer, seen along the sun's rays, starts at 1. The metaballs come slab by slab from
// the sun; before a slab is drawn the light under its centres is read, then its billboards are multiplied
// into the buffer, and the light is read once more behind it (light_sample.comp says why). What is left is
// the shadow map.
//
// The buffer holds transmittance in 32-bit floats: a product keeps a relative error of about 1e-7 per
// metaball down to an optical depth of 87, so neither the order nor the number of metaballs shows. Private to
// the module.

#include <span>
#include <vector>

#include "render/cloud_preparation.h"
#include "render/gpu_pipeline.h"

namespace nephos {

class LightPass {
  public:
    LightPass(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& attenuation,
              const vk::raii::Sampler& sampler);

    // Leaves the shadow map in shadow_map() and returns the light at the centres, in the order of `order`.
    std::vector<float> run(const GpuDevice& gpu, const SunOrder& order, const ShadowFrame& frame,
                           int shadow_size);

    // Takes a shadow map that was made elsewhere, shadow_size^2 texels.
    void use(const GpuDevice& gpu, std::span<const float> shadow, int shadow_size);

    const GpuImage& shadow_map() const { return map_; }
    // The shadow map in main memory; row 0 has the smallest v.
    std::vector<float> read_shadow_map(const GpuDevice& gpu) const;

  private:
    struct Batch;
    void resize_map(const GpuDevice& gpu, int shadow_size);
    void run_batch(const GpuDevice& gpu, const Batch& batch, std::span<float> light);
    void record(const vk::raii::CommandBuffer& commands, const Batch& batch) const;

    const PipelineLayout* layout_;
    const vk::raii::Sampler* sampler_;
    vk::raii::Pipeline splat_, dense_splat_, sample_;
    Bindings bindings_;
    GpuBuffer balls_, light_;
    GpuImage map_;
};

}  // namespace nephos
