// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 2 of D in compute shaders: the fast path. Metaballs, and T's billboards, are binned into tiles of 8x16
// pixels and added up front to back, with a polynomial instead of a texture for their attenuation, until a
// tile is opaque. The same picture as that of the blended billboards (view_pass.h), which remain as the
// reference. Private to the module.

#include "render/frame/frame_data.h"
#include "render/frame/tile_bins.h"
#include "render/frame/view_sorting.h"
#include "render/gpu/frame_uploads.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/options/camera.h"

namespace nephos {

class ViewTiles {
  public:
    // For orders with billboards if `variant` has billboards, else for those without. `unused` is not read,
    // but lavapipe (Mesa 22.3) wants every sampler of a set to be bound.
    ViewTiles(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& unused,
              const vk::raii::Sampler& sampler, const ShaderVariant& variant);

    // Tables of the physical sky; readable by shaders.
    void use_sky(const GpuDevice& gpu, const GpuImage& tables, const vk::raii::Sampler& sampler);
    // Sets the shadow map of the ground; in the layout GENERAL and readable by compute shaders.
    void use_shadow_map(const GpuDevice& gpu, const GpuImage& map, const vk::raii::Sampler& sampler);

    // Sets the air between the metaballs of `order`; for a pass made for shells.
    void use_shells(const GpuDevice& gpu, const AirShells& shells, const ViewSortedSplats& order);
    // scattering_table.h
    void use_scattering(const GpuDevice& gpu, const GpuBuffer& table);

    // Draws one tile of the picture and stores its pixels.
    void draw_tile(const GpuDevice& gpu, const RenderOptions& options, const CameraFrame& camera,
                   const shader::Frame& frame, const Tile& tile, const ViewSortedSplats& order,
                   Picture& picture);

  private:
    const vk::raii::Pipeline& tiles_for(const GpuDevice& gpu, const ViewSortedSplats& order);
    // Draws splats `begin` .. `end`, nearest first.
    void draw_batch(const GpuDevice& gpu, const TileGrid& grid, const ViewSortedSplats& order,
                    std::size_t begin, std::size_t end);
    // Metaballs and billboards of a batch, and the clouds of the latter, in one buffer.
    void upload_splats(const GpuDevice& gpu, const ViewSortedSplats& order,
                       std::span<const std::uint32_t> splats);
    void draw_between_shells(const vk::raii::CommandBuffer& commands, const vk::raii::Pipeline& tiles,
                             const shader::TileStep& step, std::size_t begin, std::size_t end, bool last);

    const PipelineLayout* layout_;
    ShaderVariant variant_;
    vk::raii::Pipeline project_, finish_, between_;
    // [some are not fitted][with distances]; made when they are needed.
    vk::raii::Pipeline tiles_[2][2] = {{nullptr, nullptr}, {nullptr, nullptr}};
    Bindings bindings_;
    GpuImage billboard_textures_;  // empty without billboards
    GpuBuffer frame_, balls_, splats_, ranges_, tails_, list_, radiance_, depth_;
    GpuBuffer radiance_copy_, depth_copy_;  // where the processor does not see the device's memory
    GpuBuffer no_parts_;                    // binding 15 must be bound, used or not
    ShellBuffers shells_;
    std::vector<std::uint32_t> before_shells_;  // splats_before_shells()
    std::size_t next_shell_ = 0;                // of the tile of the picture that is being drawn
};

}  // namespace nephos
