// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pipelines, and the one descriptor layout that they share:
//
//     0  uniform  Frame                      3  attenuation textures, or puff textures (array)
//     1  storage  metaballs, or billboards   4  shadow map, or the light buffer that becomes it
//     2  storage  light, or clouds
//
// Both images of a set must be bound before a draw, used or not: lavapipe looks at them.
//
// Private to the module.

#include <cstdint>
#include <span>

#include "render/gpu_resources.h"

namespace nephos {

// SPIR-V words, embedded at build time from render/shaders.
using ShaderCode = std::span<const std::uint32_t>;
struct ShaderSet {
    ShaderCode light_splat_vert, light_splat_frag, light_sample_comp;
    ShaderCode background_vert, background_frag, view_splat_vert, view_splat_frag;
    ShaderCode puff_vert, puff_frag;
};
const ShaderSet& shaders();

struct PipelineLayout {
    vk::raii::DescriptorSetLayout set{nullptr};
    vk::raii::PipelineLayout layout{nullptr};
};
PipelineLayout create_pipeline_layout(const GpuDevice& gpu);

enum class Blend {
    none,      // dst = src
    multiply,  // dst = dst * src
    over,      // dst = src + dst * alpha of src; alpha of dst = alpha of both multiplied
};

// Draws triangles; viewport and scissor are dynamic. `exact` becomes specialization constant 0 of the
// fragment shader. Attachments from `written` on stay as they are.
vk::raii::Pipeline create_graphics_pipeline(const GpuDevice& gpu, const PipelineLayout& layout,
                                            ShaderCode vertex, ShaderCode fragment,
                                            std::span<const vk::Format> attachments, Blend blend,
                                            bool exact = false, std::size_t written = SIZE_MAX);

vk::raii::Pipeline create_compute_pipeline(const GpuDevice& gpu, const PipelineLayout& layout,
                                           ShaderCode code);

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

// Filters linearly within the nearest level; beyond the edge there is the edge's texel, or white.
vk::raii::Sampler create_sampler(const GpuDevice& gpu, vk::SamplerAddressMode beyond);

// Draws into attachments: begins and ends rendering over `area` and sets viewport and scissor to it.
void draw_into(const vk::raii::CommandBuffer& commands, std::span<const GpuImage* const> attachments,
               vk::Extent2D area, vk::AttachmentLoadOp load, const std::function<void()>& draws);

}  // namespace nephos
