// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pipelines, and the one descriptor layout that they share:
//
//     0  uniform  Frame                                  5  storage  ranges of the tiles' lists
//     1  storage  metaballs, billboards, or places       6  storage  lists of splats
//     2  storage  splats, or clouds                      7  storage  more of the splats, or items of work
//     3  attenuation textures, or billboard textures (array)  8  storage  radiance, or optical depth
//     4  shadow map, to be sampled                       9  storage  distance, or places along the light
//                                                       10  shadow map, to be written
//                                                       11  tables of the sky, to be sampled (array)
//                                                       12  storage  scattering table
//    13  uniform  Shells                                 14  storage  shade map of the shells
//    15  storage  parts of a picture, see shader::TileStep::listed
//
// All samplers of a set must be bound before a draw, used or not: lavapipe looks at them.
//
// Private to the module.

#include <array>
#include <cstdint>
#include <span>

#include "render/gpu/gpu_resources.h"
#include "render/shared/shared.h"

namespace nephos {

// SPIR-V words, embedded at build time from render/shaders.
using ShaderCode = std::span<const std::uint32_t>;
struct ShaderSet {
    ShaderCode light_map_comp, light_centres_comp, view_project_comp, view_tiles_comp, view_finish_comp;
    ShaderCode background_vert, background_frag, view_splat_vert, view_splat_frag;
    ShaderCode billboard_vert, billboard_frag;
    ShaderCode view_shells_comp, shell_vert, shell_frag;
};
const ShaderSet& shaders();

struct PipelineLayout {
    vk::raii::DescriptorSetLayout set{nullptr};
    vk::raii::PipelineLayout layout{nullptr};
};
PipelineLayout create_pipeline_layout(const GpuDevice& gpu);

enum class Blend {
    none,  // dst = src
    over,  // dst = src + dst * alpha of src; alpha of dst = alpha of both multiplied
};

// Specialization constants of the shaders that have them.
struct ShaderVariant {
    bool exact = false;         // 0, fragment shaders of metaballs: integrate along each ray
    bool physical_sky = false;  // 5, whatever includes air.glsl
    bool shells = false;        // 6, whatever includes shells.glsl
    bool fog = false;           // 7, likewise
    bool billboards = false;    // 8, compute shaders that draw splats: some are T's billboards
    bool operator==(const ShaderVariant&) const = default;
};

// Draws triangles; viewport and scissor are dynamic. Attachments from `written` on stay as they are.
vk::raii::Pipeline create_graphics_pipeline(const GpuDevice& gpu, const PipelineLayout& layout,
                                            ShaderCode vertex, ShaderCode fragment,
                                            std::span<const vk::Format> attachments, Blend blend,
                                            ShaderVariant variant = {}, std::size_t written = SIZE_MAX);

vk::raii::Pipeline create_compute_pipeline(const GpuDevice& gpu, const PipelineLayout& layout,
                                           ShaderCode code, ShaderVariant variant = {});

// Creates a pipeline whose work groups are tiles (render/gpu/tiles.glsl): one subgroup each, where the
// device has subgroups that fit. `switches` become specialization constants 3 and 4.
vk::raii::Pipeline create_tile_pipeline(const GpuDevice& gpu, const PipelineLayout& layout, ShaderCode code,
                                        std::array<bool, 2> switches = {}, ShaderVariant variant = {});

// A pool with room for one set of the layout above, and the set.
struct Bindings {
    vk::raii::DescriptorPool pool{nullptr};
    vk::DescriptorSet set;
};
Bindings create_bindings(const GpuDevice& gpu, const PipelineLayout& layout);

void bind_buffer(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding,
                 const GpuBuffer& buffer);
void bind_image(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding, const GpuImage& image,
                const vk::raii::Sampler& sampler);

// Makes a storage buffer at least so large, and binds it; its content is lost when it grows.
void reserve(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding, GpuBuffer& buffer,
             std::size_t bytes, HostAccess access);
// The same, and copies `bytes` into it.
void upload(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding, GpuBuffer& buffer,
            std::span<const std::byte> bytes);

// Binds a compute pipeline with its descriptors and push constants.
void begin_compute(const vk::raii::CommandBuffer& commands, const PipelineLayout& layout,
                   const Bindings& bindings, const vk::raii::Pipeline& pipeline,
                   const shader::TileStep& step);

// Work groups that run `groups` times; a shader reads their number with work_group() of tiles.glsl.
void dispatch_groups(const vk::raii::CommandBuffer& commands, std::size_t groups);

// Makes all writes of earlier compute shaders visible to later ones.
void compute_barrier(const vk::raii::CommandBuffer& commands);

// For imageStore; the image is in the layout GENERAL.
void bind_storage_image(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding,
                        const GpuImage& image);

// Filters linearly within the nearest level; beyond the edge there is the edge's texel, or white.
vk::raii::Sampler create_sampler(const GpuDevice& gpu, vk::SamplerAddressMode beyond);

// Draws into attachments: begins and ends rendering over `area` and sets viewport and scissor to it.
void draw_into(const vk::raii::CommandBuffer& commands, std::span<const GpuImage* const> attachments,
               vk::Extent2D area, vk::AttachmentLoadOp load, const std::function<void()>& draws);

}  // namespace nephos
