// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/gpu_pipeline.h"

#include <algorithm>
#include <array>
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
#include "shell_frag.h"
#include "shell_vert.h"
#include "view_finish_comp.h"
#include "view_project_comp.h"
#include "view_shells_comp.h"
#include "view_splat_frag.h"
#include "view_splat_vert.h"
#include "view_tiles_comp.h"
}  // namespace spirv

vk::raii::ShaderModule create_module(const GpuDevice& gpu, ShaderCode code) {
    return {gpu.device, vk::ShaderModuleCreateInfo({}, code.size_bytes(), code.data())};
}

// A variant as specialization constants; constants that a shader does not have are ignored.
struct VariantConstants {
    std::array<vk::Bool32, 5> values;
    std::array<vk::SpecializationMapEntry, 5> entries{vk::SpecializationMapEntry(0, 0, sizeof(vk::Bool32)),
                                                      vk::SpecializationMapEntry(5, 4, sizeof(vk::Bool32)),
                                                      vk::SpecializationMapEntry(6, 8, sizeof(vk::Bool32)),
                                                      vk::SpecializationMapEntry(7, 12, sizeof(vk::Bool32)),
                                                      vk::SpecializationMapEntry(8, 16, sizeof(vk::Bool32))};
    explicit VariantConstants(const ShaderVariant& variant)
        : values{vk::Bool32(variant.exact), vk::Bool32(variant.physical_sky), vk::Bool32(variant.shells),
                 vk::Bool32(variant.fog), vk::Bool32(variant.billboards)} {}
    vk::SpecializationInfo info() const {
        return {std::uint32_t(entries.size()), entries.data(), sizeof values, values.data()};
    }
};

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

// The layout of gpu_pipeline.h, each binding at its number.
auto layout_bindings() {
    using Type = vk::DescriptorType;
    using Stage = vk::ShaderStageFlagBits;
    const vk::ShaderStageFlags all = Stage::eVertex | Stage::eFragment | Stage::eCompute;
    return std::array{
        vk::DescriptorSetLayoutBinding(0, Type::eUniformBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(1, Type::eStorageBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(2, Type::eStorageBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(3, Type::eCombinedImageSampler, 1, all),
        vk::DescriptorSetLayoutBinding(4, Type::eCombinedImageSampler, 1, all),
        vk::DescriptorSetLayoutBinding(5, Type::eStorageBuffer, 1, Stage::eCompute),
        vk::DescriptorSetLayoutBinding(6, Type::eStorageBuffer, 1, Stage::eCompute),
        vk::DescriptorSetLayoutBinding(7, Type::eStorageBuffer, 1, Stage::eCompute),
        vk::DescriptorSetLayoutBinding(8, Type::eStorageBuffer, 1, Stage::eCompute),
        vk::DescriptorSetLayoutBinding(9, Type::eStorageBuffer, 1, Stage::eCompute),
        vk::DescriptorSetLayoutBinding(10, Type::eStorageImage, 1, Stage::eCompute),
        vk::DescriptorSetLayoutBinding(11, Type::eCombinedImageSampler, 1, all),
        vk::DescriptorSetLayoutBinding(12, Type::eStorageBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(13, Type::eUniformBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(14, Type::eStorageBuffer, 1, all),
        vk::DescriptorSetLayoutBinding(15, Type::eStorageBuffer, 1, Stage::eCompute),
    };
}

}  // namespace

const ShaderSet& shaders() {
    static constexpr ShaderSet kShaders{
        spirv::light_map_comp,   spirv::light_centres_comp, spirv::view_project_comp, spirv::view_tiles_comp,
        spirv::view_finish_comp, spirv::background_vert,    spirv::background_frag,   spirv::view_splat_vert,
        spirv::view_splat_frag,  spirv::billboard_vert,     spirv::billboard_frag,    spirv::view_shells_comp,
        spirv::shell_vert,       spirv::shell_frag};
    return kShaders;
}

PipelineLayout create_pipeline_layout(const GpuDevice& gpu) {
    const std::array bindings = layout_bindings();
    PipelineLayout result;
    result.set = vk::raii::DescriptorSetLayout(gpu.device, vk::DescriptorSetLayoutCreateInfo({}, bindings));
    const vk::PushConstantRange constants(vk::ShaderStageFlagBits::eCompute, 0, sizeof(shader::TileStep));
    result.layout =
        vk::raii::PipelineLayout(gpu.device, vk::PipelineLayoutCreateInfo({}, *result.set, constants));
    return result;
}

vk::raii::Pipeline create_graphics_pipeline(const GpuDevice& gpu, const PipelineLayout& layout,
                                            ShaderCode vertex, ShaderCode fragment,
                                            std::span<const vk::Format> attachments, Blend blend,
                                            ShaderVariant variant, std::size_t written) {
    const vk::raii::ShaderModule vertex_module = create_module(gpu, vertex);
    const vk::raii::ShaderModule fragment_module = create_module(gpu, fragment);
    const VariantConstants values(variant);
    const vk::SpecializationInfo constants = values.info();
    const std::array stages{vk::PipelineShaderStageCreateInfo({}, vk::ShaderStageFlagBits::eVertex,
                                                              *vertex_module, "main", &constants),
                            vk::PipelineShaderStageCreateInfo({}, vk::ShaderStageFlagBits::eFragment,
                                                              *fragment_module, "main", &constants)};
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
                                           ShaderCode code, ShaderVariant variant) {
    const vk::raii::ShaderModule module = create_module(gpu, code);
    const VariantConstants values(variant);
    const vk::SpecializationInfo constants = values.info();
    const vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *module, "main",
                                                  &constants);
    return {gpu.device, nullptr, vk::ComputePipelineCreateInfo({}, stage, *layout.layout)};
}

vk::raii::Pipeline create_tile_pipeline(const GpuDevice& gpu, const PipelineLayout& layout, ShaderCode code,
                                        std::array<bool, 2> switches, ShaderVariant variant) {
    const vk::raii::ShaderModule module = create_module(gpu, code);
    // Lanes, rows of a lane, whether lanes hand splats round, the switches, sky, shells and billboards.
    const std::uint32_t lanes = gpu.tile_lanes;
    const std::array<std::uint32_t, 9> values{lanes,
                                              shader::kTileWidth * shader::kTileHeight / lanes,
                                              std::uint32_t(gpu.tiles_are_subgroups),
                                              std::uint32_t(switches[0]),
                                              std::uint32_t(switches[1]),
                                              std::uint32_t(variant.physical_sky),
                                              std::uint32_t(variant.shells),
                                              std::uint32_t(variant.fog),
                                              std::uint32_t(variant.billboards)};
    std::array<vk::SpecializationMapEntry, values.size()> entries;
    for (std::uint32_t i = 0; i < entries.size(); ++i) entries[i] = vk::SpecializationMapEntry(i, 4 * i, 4);
    const vk::SpecializationInfo constants(entries.size(), entries.data(), sizeof values, values.data());
    vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo subgroup(lanes);
    vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *module, "main",
                                            &constants);
    if (gpu.tiles_are_subgroups && gpu.subgroup_size_varies) stage.pNext = &subgroup;
    return {gpu.device, nullptr, vk::ComputePipelineCreateInfo({}, stage, *layout.layout)};
}

void begin_compute(const vk::raii::CommandBuffer& commands, const PipelineLayout& layout,
                   const Bindings& bindings, const vk::raii::Pipeline& pipeline,
                   const shader::TileStep& step) {
    constexpr auto kPoint = vk::PipelineBindPoint::eCompute;
    commands.bindPipeline(kPoint, *pipeline);
    commands.bindDescriptorSets(kPoint, *layout.layout, 0, bindings.set, {});
    commands.pushConstants<shader::TileStep>(*layout.layout, vk::ShaderStageFlagBits::eCompute, 0, step);
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

Bindings create_bindings(const GpuDevice& gpu, const PipelineLayout& layout) {
    std::vector<vk::DescriptorPoolSize> sizes;
    for (const vk::DescriptorSetLayoutBinding& binding : layout_bindings())
        sizes.emplace_back(binding.descriptorType, binding.descriptorCount);
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
    const vk::DescriptorType type = layout_bindings()[binding].descriptorType;
    // Buffers are made larger than what is asked for, perhaps larger than a shader may see.
    const vk::DeviceSize seen =
        type == vk::DescriptorType::eStorageBuffer
            ? std::min<vk::DeviceSize>(buffer.bytes, gpu.properties.limits.maxStorageBufferRange)
            : VK_WHOLE_SIZE;
    const vk::DescriptorBufferInfo info(*buffer.buffer, 0, seen);
    gpu.device.updateDescriptorSets(vk::WriteDescriptorSet(bindings.set, binding, 0, type, {}, info), {});
}

void bind_image(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding, const GpuImage& image,
                const vk::raii::Sampler& sampler) {
    const vk::DescriptorImageInfo info(*sampler, *image.view, vk::ImageLayout::eGeneral);
    gpu.device.updateDescriptorSets(
        vk::WriteDescriptorSet(bindings.set, binding, 0, vk::DescriptorType::eCombinedImageSampler, info),
        {});
}

void reserve(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding, GpuBuffer& buffer,
             std::size_t bytes, HostAccess access) {
    if (buffer.bytes >= std::max<std::size_t>(bytes, 1)) return;
    buffer = {};  // the old one goes before the new one comes
    buffer = create_buffer(gpu, bytes + bytes / 4 + 256,
                           vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eTransferSrc,
                           access);
    bind_buffer(gpu, bindings, binding, buffer);
}

void upload(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding, GpuBuffer& buffer,
            std::span<const std::byte> bytes) {
    reserve(gpu, bindings, binding, buffer, bytes.size(), HostAccess::write);
    write(gpu, buffer, bytes);
}

void bind_storage_image(const GpuDevice& gpu, const Bindings& bindings, std::uint32_t binding,
                        const GpuImage& image) {
    const vk::DescriptorImageInfo info({}, *image.view, vk::ImageLayout::eGeneral);
    gpu.device.updateDescriptorSets(
        vk::WriteDescriptorSet(bindings.set, binding, 0, vk::DescriptorType::eStorageImage, info), {});
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
