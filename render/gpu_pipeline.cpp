// SPDX-License-Identifier: Apache-2.0
#include "render/gpu_pipeline.h"

#include <array>
#include <vector>

#include "render/shaders/shared.h"

namespace nephos {
namespace {

namespace spirv {
#include "background_frag.h"
#include "background_vert.h"
#include "light_sample_comp.h"
#include "light_splat_frag.h"
#include "light_splat_vert.h"
#include "puff_frag.h"
#include "puff_vert.h"
#include "view_splat_frag.h"
#include "view_splat_vert.h"
}  // namespace spirv

vk::raii::ShaderModule create_module(const GpuDevice& gpu, ShaderCode code) {
    return {gpu.device, vk::ShaderModuleCreateInfo({}, code.size_bytes(), code.data())};
}

vk::PipelineColorBlendAttachmentState blend_state(Blend blend) {
    using Factor = vk::BlendFactor;
    vk::PipelineColorBlendAttachmentState state;
    state.colorWriteMask = vk::ColorComponentFlagBits::eR | vk::ColorComponentFlagBits::eG |
                           vk::ColorComponentFlagBits::eB | vk::ColorComponentFlagBits::eA;
    state.blendEnable = blend != Blend::none;
    if (blend == Blend::multiply) {
        state.setSrcColorBlendFactor(Factor::eZero).setDstColorBlendFactor(Factor::eSrcColor);
        state.setSrcAlphaBlendFactor(Factor::eZero).setDstAlphaBlendFactor(Factor::eSrcAlpha);
    } else if (blend == Blend::over) {
        state.setSrcColorBlendFactor(Factor::eOne).setDstColorBlendFactor(Factor::eSrcAlpha);
        state.setSrcAlphaBlendFactor(Factor::eZero).setDstAlphaBlendFactor(Factor::eSrcAlpha);
    }
    return state;
}

}  // namespace

const ShaderSet& shaders() {
    static constexpr ShaderSet kShaders{
        spirv::light_splat_vert, spirv::light_splat_frag, spirv::light_sample_comp,
        spirv::background_vert,  spirv::background_frag,  spirv::view_splat_vert,
        spirv::view_splat_frag,  spirv::puff_vert,        spirv::puff_frag};
    return kShaders;
}

PipelineLayout create_pipeline_layout(const GpuDevice& gpu) {
    using Type = vk::DescriptorType;
    using Stage = vk::ShaderStageFlagBits;
    const vk::ShaderStageFlags all = Stage::eVertex | Stage::eFragment | Stage::eCompute;
    const std::array bindings{
        vk::DescriptorSetLayoutBinding(0, Type::eUniformBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(1, Type::eStorageBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(2, Type::eStorageBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(3, Type::eCombinedImageSampler, 1, all),
        vk::DescriptorSetLayoutBinding(4, Type::eCombinedImageSampler, 1, all),
    };
    PipelineLayout result;
    result.set = vk::raii::DescriptorSetLayout(gpu.device, vk::DescriptorSetLayoutCreateInfo({}, bindings));
    const vk::PushConstantRange constants(all, 0, sizeof(shader::LightStep));
    result.layout =
        vk::raii::PipelineLayout(gpu.device, vk::PipelineLayoutCreateInfo({}, *result.set, constants));
    return result;
}

vk::raii::Pipeline create_graphics_pipeline(const GpuDevice& gpu, const PipelineLayout& layout,
                                            ShaderCode vertex, ShaderCode fragment,
                                            std::span<const vk::Format> attachments, Blend blend, bool exact,
                                            std::size_t written) {
    const vk::raii::ShaderModule vertex_module = create_module(gpu, vertex);
    const vk::raii::ShaderModule fragment_module = create_module(gpu, fragment);
    const vk::Bool32 exact_value = exact ? VK_TRUE : VK_FALSE;
    const vk::SpecializationMapEntry entry(0, 0, sizeof exact_value);
    const vk::SpecializationInfo constants(1, &entry, sizeof exact_value, &exact_value);
    const std::array stages{
        vk::PipelineShaderStageCreateInfo({}, vk::ShaderStageFlagBits::eVertex, *vertex_module, "main"),
        vk::PipelineShaderStageCreateInfo({}, vk::ShaderStageFlagBits::eFragment, *fragment_module, "main",
                                          &constants)};
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
    info.setPColorBlendState(&blending).setPDynamicState(&dynamic).setLayout(*layout.layout);
    info.pNext = &rendering;
    return {gpu.device, nullptr, info};
}

vk::raii::Pipeline create_compute_pipeline(const GpuDevice& gpu, const PipelineLayout& layout,
                                           ShaderCode code) {
    const vk::raii::ShaderModule module = create_module(gpu, code);
    const vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *module, "main");
    return {gpu.device, nullptr, vk::ComputePipelineCreateInfo({}, stage, *layout.layout)};
}

Bindings create_bindings(const GpuDevice& gpu, const PipelineLayout& layout) {
    const std::array sizes{vk::DescriptorPoolSize(vk::DescriptorType::eUniformBuffer, 1),
                           vk::DescriptorPoolSize(vk::DescriptorType::eStorageBuffer, 2),
                           vk::DescriptorPoolSize(vk::DescriptorType::eCombinedImageSampler, 2)};
    Bindings bindings;
    bindings.pool = vk::raii::DescriptorPool(gpu.device, vk::DescriptorPoolCreateInfo({}, 1, sizes));
    // Allocated without RAII: the set goes with its pool.
    const vk::Device device = *gpu.device;
    const vk::DescriptorSetAllocateInfo info(*bindings.pool, *layout.set);
    const vk::Result result =
        device.allocateDescriptorSets(&info, &bindings.set, *gpu.device.getDispatcher());
    if (result != vk::Result::eSuccess) fail_gpu("allocating descriptors", result);
    return bindings;
}

void bind_buffer(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding,
                 const GpuBuffer& buffer) {
    const vk::DescriptorType type =
        binding == 0 ? vk::DescriptorType::eUniformBuffer : vk::DescriptorType::eStorageBuffer;
    const vk::DescriptorBufferInfo info(*buffer.buffer, 0, VK_WHOLE_SIZE);
    gpu.device.updateDescriptorSets(vk::WriteDescriptorSet(bindings.set, binding, 0, type, {}, info), {});
}

void bind_image(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding, const GpuImage& image,
                const vk::raii::Sampler& sampler) {
    const vk::DescriptorImageInfo info(*sampler, *image.view, vk::ImageLayout::eGeneral);
    gpu.device.updateDescriptorSets(
        vk::WriteDescriptorSet(bindings.set, binding, 0, vk::DescriptorType::eCombinedImageSampler, info),
        {});
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
