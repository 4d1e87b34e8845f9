// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/gpu_pipeline.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <initializer_list>
#include <vector>

#include "render/shared/shared.h"

namespace nephos {
namespace {

namespace spirv {
#include "background_frag.h"
#include "background_vert.h"
#include "billboard_frag.h"
#include "billboard_vert.h"
#include "light_centres_comp.h"
#include "light_map_comp.h"
#include "rain_bands_comp.h"
#include "rain_shafts_comp.h"
#include "rain_streaks_comp.h"
#include "rain_tiles_comp.h"
#include "shade_light_comp.h"
#include "shell_frag.h"
#include "shell_vert.h"
#include "mirror_level_comp.h"
#include "view_finish_comp.h"
#include "view_ground_comp.h"
#include "march_finish_comp.h"
#include "march_ground_comp.h"
#include "march_shells_comp.h"
#include "march_tiles_comp.h"
#include "view_project_comp.h"
#include "view_shells_comp.h"
#include "view_splat_frag.h"
#include "view_splat_vert.h"
#include "view_tiles_comp.h"
}  // namespace spirv

vk::raii::ShaderModule create_module(const GpuDevice& gpu, ShaderCode code) {
    return {gpu.device, vk::ShaderModuleCreateInfo({}, code.size_bytes(), code.data())};
}

// Constants in the form of Vulkan; made from a list that outlives it.
struct Specialization {
    std::vector<vk::SpecializationMapEntry> entries;
    vk::SpecializationInfo info;

    explicit Specialization(std::span<const ShaderConstant> constants) {
        static_assert(sizeof(ShaderConstant) == 8);
        for (const ShaderConstant& each : constants) {
            const auto at = std::uint32_t(entries.size() * sizeof(ShaderConstant));
            entries.emplace_back(each.id, at + std::uint32_t(offsetof(ShaderConstant, value)), 4);
        }
        info = {std::uint32_t(entries.size()), entries.data(), constants.size_bytes(), constants.data()};
    }
};

// The bindings and layouts of a pipeline for these shaders; its stages are still to be made.
Pipeline create_layouts(const GpuDevice& gpu, std::initializer_list<ShaderCode> codes,
                        vk::ShaderStageFlags stages) {
    Pipeline result;
    for (const ShaderCode code : codes)
        for (const ShaderBinding& binding : bindings_of(code))
            if (std::ranges::find(result.bindings, binding) == result.bindings.end())
                result.bindings.push_back(binding);
    std::vector<vk::DescriptorSetLayoutBinding> bindings;
    for (const auto& [number, type] : result.bindings) bindings.emplace_back(number, type, 1, stages);
    result.set_layout =
        vk::raii::DescriptorSetLayout(gpu.device, vk::DescriptorSetLayoutCreateInfo({}, bindings));
    vk::PipelineLayoutCreateInfo info({}, *result.set_layout);
    const vk::PushConstantRange constants(vk::ShaderStageFlagBits::eCompute, 0, kPushBytes);
    if (stages & vk::ShaderStageFlagBits::eCompute) info.setPushConstantRanges(constants);
    result.layout = vk::raii::PipelineLayout(gpu.device, info);
    return result;
}

vk::PipelineColorBlendAttachmentState blend_state(Blend blend) {
    using Factor = vk::BlendFactor;
    vk::PipelineColorBlendAttachmentState state;
    state.colorWriteMask = vk::ColorComponentFlagBits::eR | vk::ColorComponentFlagBits::eG |
                           vk::ColorComponentFlagBits::eB | vk::ColorComponentFlagBits::eA;
    state.blendEnable = blend != Blend::none;
    if (blend == Blend::over) {
        state.setSrcColorBlendFactor(Factor::eOne).setDstColorBlendFactor(Factor::eSrcAlpha);
        state.setSrcAlphaBlendFactor(Factor::eZero).setDstAlphaBlendFactor(Factor::eSrcAlpha);
    }
    return state;
}

}  // namespace

const ShaderSet& shaders() {
    static constexpr ShaderSet kShaders{
        spirv::light_map_comp,   spirv::light_centres_comp, spirv::view_project_comp, spirv::view_tiles_comp,
        spirv::view_finish_comp, spirv::background_vert,    spirv::background_frag,   spirv::view_splat_vert,
        spirv::view_splat_frag,  spirv::billboard_vert,     spirv::billboard_frag,    spirv::view_shells_comp,
        spirv::shell_vert,       spirv::shell_frag,          spirv::march_tiles_comp,  spirv::march_shells_comp,
        spirv::march_finish_comp, spirv::shade_light_comp,   spirv::rain_shafts_comp,  spirv::rain_streaks_comp,
        spirv::rain_bands_comp,   spirv::rain_tiles_comp,     spirv::view_ground_comp,  spirv::march_ground_comp,
        spirv::mirror_level_comp};
    return kShaders;
}

std::vector<ShaderConstant> constants_of(const ShaderVariant& variant) {
    return {{0, variant.exact},
            {5, variant.physical_sky},
            {6, variant.shells},
            {7, variant.fog},
            {8, variant.billboards},
            {9, variant.terrain},
            {10, variant.bows}};
}

Pipeline create_graphics_pipeline(const GpuDevice& gpu, ShaderCode vertex, ShaderCode fragment,
                                  std::span<const vk::Format> attachments, Blend blend,
                                  const ShaderVariant& variant, std::size_t written) {
    using Stage = vk::ShaderStageFlagBits;
    Pipeline result = create_layouts(gpu, {vertex, fragment}, Stage::eVertex | Stage::eFragment);
    const vk::raii::ShaderModule vertex_module = create_module(gpu, vertex);
    const vk::raii::ShaderModule fragment_module = create_module(gpu, fragment);
    const std::vector<ShaderConstant> values = constants_of(variant);
    const Specialization constants(values);
    const std::array stages{
        vk::PipelineShaderStageCreateInfo({}, Stage::eVertex, *vertex_module, "main", &constants.info),
        vk::PipelineShaderStageCreateInfo({}, Stage::eFragment, *fragment_module, "main", &constants.info)};
    const vk::PipelineVertexInputStateCreateInfo no_vertices;
    const vk::PipelineInputAssemblyStateCreateInfo triangles({}, vk::PrimitiveTopology::eTriangleList);
    const vk::PipelineViewportStateCreateInfo viewport({}, 1, nullptr, 1, nullptr);
    vk::PipelineRasterizationStateCreateInfo raster;
    raster.lineWidth = 1.0f;
    const vk::PipelineMultisampleStateCreateInfo single_sample({}, vk::SampleCountFlagBits::e1);
    std::vector<vk::PipelineColorBlendAttachmentState> states(attachments.size(), blend_state(blend));
    for (std::size_t i = written; i < states.size(); ++i) states[i].colorWriteMask = {};
    vk::PipelineColorBlendStateCreateInfo blending;
    blending.setAttachments(states);
    const std::array dynamic_states{vk::DynamicState::eViewport, vk::DynamicState::eScissor};
    const vk::PipelineDynamicStateCreateInfo dynamic({}, dynamic_states);
    vk::PipelineRenderingCreateInfo rendering;
    rendering.setColorAttachmentCount(std::uint32_t(attachments.size()))
        .setPColorAttachmentFormats(attachments.data());

    vk::GraphicsPipelineCreateInfo info;
    info.setStages(stages).setPVertexInputState(&no_vertices).setPInputAssemblyState(&triangles);
    info.setPViewportState(&viewport).setPRasterizationState(&raster).setPMultisampleState(&single_sample);
    info.setPColorBlendState(&blending).setPDynamicState(&dynamic).setLayout(*result.layout);
    info.pNext = &rendering;
    result.pipeline = vk::raii::Pipeline(gpu.device, nullptr, info);
    return result;
}

namespace {

// `subgroup_size`: 0: as the device chooses.
Pipeline create_compute(const GpuDevice& gpu, ShaderCode code, std::span<const ShaderConstant> values,
                        std::uint32_t subgroup_size) {
    Pipeline result = create_layouts(gpu, {code}, vk::ShaderStageFlagBits::eCompute);
    const vk::raii::ShaderModule module = create_module(gpu, code);
    const Specialization constants(values);
    const vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo subgroup(subgroup_size);
    vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *module, "main",
                                            &constants.info);
    if (subgroup_size != 0) stage.pNext = &subgroup;
    result.pipeline =
        vk::raii::Pipeline(gpu.device, nullptr, vk::ComputePipelineCreateInfo({}, stage, *result.layout));
    return result;
}

}  // namespace

Pipeline create_compute_pipeline(const GpuDevice& gpu, ShaderCode code,
                                 std::span<const ShaderConstant> constants) {
    return create_compute(gpu, code, constants, 0);
}

Pipeline create_tile_pipeline(const GpuDevice& gpu, ShaderCode code, std::array<bool, 2> switches,
                              const ShaderVariant& variant) {
    const std::uint32_t lanes = gpu.tile_lanes;
    std::vector<ShaderConstant> constants{{0, lanes},
                                          {1, shader::kTileWidth * shader::kTileHeight / lanes},
                                          {2, gpu.tiles_are_subgroups},
                                          {3, switches[0]},
                                          {4, switches[1]}};
    for (const ShaderConstant& each : constants_of(variant))
        if (each.id > 4) constants.push_back(each);
    return create_compute(gpu, code, constants,
                          gpu.tiles_are_subgroups && gpu.subgroup_size_varies ? lanes : 0);
}

Pipeline create_pixel_pipeline(const GpuDevice& gpu, ShaderCode code, bool distances,
                               const ShaderVariant& variant) {
    std::vector<ShaderConstant> constants{
        {0, shader::kTileWidth * shader::kTileHeight}, {1, 1}, {2, false}, {4, distances}};
    for (const ShaderConstant& each : constants_of(variant))
        if (each.id > 4) constants.push_back(each);
    return create_compute(gpu, code, constants, 0);
}

void reserve(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes, HostAccess access) {
    if (buffer.bytes >= std::max<std::size_t>(bytes, 1)) return;
    buffer = {};  // the old one goes before the new one comes
    buffer = create_buffer(gpu, bytes + bytes / 4 + 256,
                           vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eTransferSrc,
                           access);
}

void upload(const GpuDevice& gpu, GpuBuffer& buffer, std::span<const std::byte> bytes) {
    reserve(gpu, buffer, bytes.size(), HostAccess::write);
    write(gpu, buffer, bytes);
}

void bind(const vk::raii::CommandBuffer& commands, vk::PipelineBindPoint point, const Pipeline& pipeline,
          vk::DescriptorSet set) {
    commands.bindPipeline(point, *pipeline.pipeline);
    commands.bindDescriptorSets(point, *pipeline.layout, 0, set, {});
}

void dispatch_groups(const vk::raii::CommandBuffer& commands, std::size_t groups) {
    constexpr std::size_t kRow = shader::kGroupRow;
    if (groups == 0) return;
    commands.dispatch(std::uint32_t(std::min(groups, kRow)), std::uint32_t((groups + kRow - 1) / kRow), 1);
}

void compute_barrier(const vk::raii::CommandBuffer& commands) {
    const vk::MemoryBarrier2 change(access::compute.stages, access::compute.kinds, access::compute.stages,
                                    access::compute.kinds);
    commands.pipelineBarrier2(vk::DependencyInfo().setMemoryBarriers(change));
}

vk::raii::Sampler create_sampler(const GpuDevice& gpu, vk::SamplerAddressMode beyond) {
    vk::SamplerCreateInfo info;
    info.setMagFilter(vk::Filter::eLinear).setMinFilter(vk::Filter::eLinear);
    info.setAddressModeU(beyond).setAddressModeV(beyond).setAddressModeW(beyond);
    info.setBorderColor(vk::BorderColor::eFloatOpaqueWhite);
    info.setMipmapMode(vk::SamplerMipmapMode::eNearest).setMaxLod(VK_LOD_CLAMP_NONE);
    return {gpu.device, info};
}

void draw_into(const vk::raii::CommandBuffer& commands, std::span<const GpuImage* const> attachments,
               vk::Extent2D area, vk::AttachmentLoadOp load, const std::function<void()>& draws) {
    std::vector<vk::RenderingAttachmentInfo> infos;
    for (const GpuImage* image : attachments) {
        vk::RenderingAttachmentInfo info(*image->view, vk::ImageLayout::eGeneral);
        info.setLoadOp(load).setStoreOp(vk::AttachmentStoreOp::eStore);
        info.setClearValue(vk::ClearColorValue(std::array{1.0f, 1.0f, 1.0f, 1.0f}));
        infos.push_back(info);
    }
    vk::RenderingInfo rendering;
    rendering.setRenderArea({{0, 0}, area}).setLayerCount(1).setColorAttachments(infos);
    commands.beginRendering(rendering);
    commands.setViewport(0, vk::Viewport(0, 0, float(area.width), float(area.height), 0, 1));
    commands.setScissor(0, vk::Rect2D({0, 0}, area));
    draws();
    commands.endRendering();
}

}  // namespace nephos
