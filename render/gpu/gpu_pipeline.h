// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pipelines, each with a layout of the bindings that its own shaders use (descriptor_sets.h), and the recording of
// compute passes. Private to the module.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "render/gpu/descriptor_sets.h"
#include "render/shared/shared.h"

namespace nephos {

struct ShaderSet {
    ShaderCode light_map_comp, light_centres_comp, view_project_comp, view_tiles_comp, view_finish_comp;
    ShaderCode background_vert, background_frag, view_splat_vert, view_splat_frag;
    ShaderCode billboard_vert, billboard_frag;
    ShaderCode view_shells_comp, shell_vert, shell_frag;
    ShaderCode march_tiles_comp, march_shells_comp, march_finish_comp, shade_light_comp;
    ShaderCode rain_shafts_comp, rain_streaks_comp, rain_bands_comp, rain_tiles_comp;
    ShaderCode view_ground_comp, march_ground_comp, mirror_level_comp;
};
const ShaderSet& shaders();

struct Pipeline {
    std::vector<ShaderBinding> bindings;
    vk::raii::DescriptorSetLayout set_layout{nullptr};
    vk::raii::PipelineLayout layout{nullptr};
    vk::raii::Pipeline pipeline{nullptr};

    bool exists() const { return *pipeline != vk::Pipeline(); }
};

// Bytes of push constants of compute pipelines: of the largest step, TileStep or OrderStep.
inline constexpr std::uint32_t kPushBytes = 64;

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
    bool terrain = false;       // 9, whatever includes ray.glsl: ground that is not level
    bool bows = false;          // 10, whatever includes scattering.glsl: fogbow and glory
    bool march = false;         // no constant: other shaders, which march through clouds with detail
    bool operator==(const ShaderVariant&) const = default;
};

// A specialization constant: booleans are 0 or 1. Those that a shader does not have are ignored.
struct ShaderConstant {
    std::uint32_t id = 0, value = 0;
};
std::vector<ShaderConstant> constants_of(const ShaderVariant& variant);

// Draws triangles; viewport and scissor are dynamic. Attachments from `written` on stay as they are.
Pipeline create_graphics_pipeline(const GpuDevice& gpu, ShaderCode vertex, ShaderCode fragment,
                                  std::span<const vk::Format> attachments, Blend blend,
                                  const ShaderVariant& variant = {}, std::size_t written = SIZE_MAX);

Pipeline create_compute_pipeline(const GpuDevice& gpu, ShaderCode code,
                                 std::span<const ShaderConstant> constants = {});

// Creates a pipeline whose work groups are tiles (render/gpu/tiles.glsl): one subgroup each, where the
// device has subgroups that fit. `switches` become specialization constants 3 and 4.
Pipeline create_tile_pipeline(const GpuDevice& gpu, ShaderCode code, std::array<bool, 2> switches = {},
                              const ShaderVariant& variant = {});

// The same, with an invocation for each pixel of a tile, whatever the device's subgroups.
Pipeline create_pixel_pipeline(const GpuDevice& gpu, ShaderCode code, bool distances, const ShaderVariant& variant);

// Makes a storage buffer at least so large; its content is lost when it grows.
void reserve(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes, HostAccess access);
// The same, and copies `bytes` into it.
void upload(const GpuDevice& gpu, GpuBuffer& buffer, std::span<const std::byte> bytes);

// Binds a pipeline with a set of its layout.
void bind(const vk::raii::CommandBuffer& commands, vk::PipelineBindPoint point, const Pipeline& pipeline,
          vk::DescriptorSet set);

// Binds a compute pipeline with its descriptors and push constants.
template <class Step>
void begin_compute(const vk::raii::CommandBuffer& commands, const Pipeline& pipeline, vk::DescriptorSet set,
                   const Step& step) {
    static_assert(sizeof(Step) <= kPushBytes);
    bind(commands, vk::PipelineBindPoint::eCompute, pipeline, set);
    commands.pushConstants<Step>(*pipeline.layout, vk::ShaderStageFlagBits::eCompute, 0, step);
}

// Work groups that run `groups` times; a shader reads their number with work_group() of tiles.glsl.
void dispatch_groups(const vk::raii::CommandBuffer& commands, std::size_t groups);

// Makes all writes of earlier compute shaders visible to later ones.
void compute_barrier(const vk::raii::CommandBuffer& commands);

// Filters linearly within the nearest level; beyond the edge there is the edge's texel, or white.
vk::raii::Sampler create_sampler(const GpuDevice& gpu, vk::SamplerAddressMode beyond);

// Draws into attachments: begins and ends rendering over `area` and sets viewport and scissor to it.
void draw_into(const vk::raii::CommandBuffer& commands, std::span<const GpuImage* const> attachments,
               vk::Extent2D area, vk::AttachmentLoadOp load, const std::function<void()>& draws);

}  // namespace nephos
