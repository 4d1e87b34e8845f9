// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_sort.h"

#include <algorithm>
#include <vector>

#include "render/gpu/gpu_pipeline.h"

namespace nephos {
namespace {

namespace spirv {
#include "bins_boxes_comp.h"
#include "bins_emit_comp.h"
#include "bins_plan_comp.h"
#include "bins_ranges_comp.h"
#include "order_compact_comp.h"
#include "order_cull_comp.h"
#include "order_plan_comp.h"
#include "order_view_comp.h"
#include "scan_blocks_comp.h"
#include "scan_reduce_comp.h"
#include "scan_sums_comp.h"
#include "sort_count_comp.h"
#include "sort_scatter_comp.h"
#include "sun_items_comp.h"
#include "sun_keys_comp.h"
#include "sun_queries_comp.h"
#include "sun_store_comp.h"
#include "sun_view_comp.h"
}  // namespace spirv

// In the order of OrderPass.
std::array<ShaderCode, kOrderPasses> codes() {
    return {
        spirv::scan_reduce_comp,  spirv::scan_sums_comp,   spirv::scan_blocks_comp,   spirv::sort_count_comp,
        spirv::sort_scatter_comp, spirv::order_cull_comp,  spirv::order_compact_comp, spirv::order_plan_comp,
        spirv::order_view_comp,   spirv::bins_boxes_comp,  spirv::bins_plan_comp,     spirv::bins_emit_comp,
        spirv::bins_ranges_comp,  spirv::sun_keys_comp,    spirv::sun_view_comp,      spirv::sun_items_comp,
        spirv::sun_items_comp,    spirv::sun_queries_comp, spirv::sun_store_comp};
}

vk::DescriptorType type_of(std::uint32_t binding) {
    return binding == 0 || binding == 14 ? vk::DescriptorType::eUniformBuffer
                                         : vk::DescriptorType::eStorageBuffer;
}

}  // namespace

std::string missing_for_lists(const GpuDevice& gpu) {
    const vk::PhysicalDeviceLimits& limits = gpu.properties.limits;
    constexpr std::uint32_t kStorage = kOrderBindings - 2;
    if (limits.maxComputeWorkGroupInvocations < shader::kSortGroup ||
        limits.maxComputeWorkGroupSize[0] < shader::kSortGroup)
        return "work groups of 256";
    if (limits.maxPerStageDescriptorStorageBuffers < kStorage ||
        limits.maxDescriptorSetStorageBuffers < kStorage)
        return "13 storage buffers in a shader";
    return {};
}

OrderPipelines create_order_pipelines(const GpuDevice& gpu) {
    OrderPipelines result;
    std::vector<vk::DescriptorSetLayoutBinding> bindings;
    for (std::uint32_t i = 0; i < kOrderBindings; ++i)
        bindings.emplace_back(i, type_of(i), 1, vk::ShaderStageFlagBits::eCompute);
    result.set_layout =
        vk::raii::DescriptorSetLayout(gpu.device, vk::DescriptorSetLayoutCreateInfo({}, bindings));
    const vk::PushConstantRange constants(vk::ShaderStageFlagBits::eCompute, 0, sizeof(shader::OrderStep));
    result.layout =
        vk::raii::PipelineLayout(gpu.device, vk::PipelineLayoutCreateInfo({}, *result.set_layout, constants));
    const std::array code = codes();
    for (std::size_t i = 0; i < kOrderPasses; ++i) {
        const vk::Bool32 writes = i == std::size_t(OrderPass::sun_items);  // constant 0 of that shader
        const vk::SpecializationMapEntry entry(0, 0, sizeof writes);
        const vk::SpecializationInfo constants_of(1, &entry, sizeof writes, &writes);
        const vk::raii::ShaderModule module(
            gpu.device, vk::ShaderModuleCreateInfo({}, code[i].size_bytes(), code[i].data()));
        const vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *module, "main",
                                                      &constants_of);
        result.passes.emplace_back(gpu.device, nullptr,
                                   vk::ComputePipelineCreateInfo({}, stage, *result.layout));
    }
    return result;
}

OrderSets create_order_sets(const GpuDevice& gpu, const OrderPipelines& pipelines, std::uint32_t count) {
    const std::array sizes{
        vk::DescriptorPoolSize(vk::DescriptorType::eUniformBuffer, 2 * count),
        vk::DescriptorPoolSize(vk::DescriptorType::eStorageBuffer, (kOrderBindings - 2) * count)};
    OrderSets result;
    result.pool = vk::raii::DescriptorPool(gpu.device, vk::DescriptorPoolCreateInfo({}, count, sizes));
    const std::vector<vk::DescriptorSetLayout> layouts(count, *pipelines.set_layout);
    const vk::DescriptorSetAllocateInfo info(*result.pool, layouts);
    // Allocated without RAII: the sets go with their pool.
    result.sets.resize(count);
    const vk::Device device = *gpu.device;
    const vk::Result allocated =
        device.allocateDescriptorSets(&info, result.sets.data(), *gpu.device.getDispatcher());
    if (allocated != vk::Result::eSuccess) fail_gpu("allocating descriptors", allocated);
    return result;
}

void bind_order_buffer(const GpuDevice& gpu, vk::DescriptorSet set, std::uint32_t binding,
                       const GpuBuffer& buffer) {
    const vk::DescriptorBufferInfo info(*buffer.buffer, 0, VK_WHOLE_SIZE);
    gpu.device.updateDescriptorSets(vk::WriteDescriptorSet(set, binding, 0, type_of(binding), {}, info), {});
}

void bind_sort_buffers(const GpuDevice& gpu, vk::DescriptorSet set, const SortBuffers& buffers,
                       std::size_t from) {
    bind_order_buffer(gpu, set, 5, buffers.keys[from]);
    bind_order_buffer(gpu, set, 6, buffers.values[from]);
    bind_order_buffer(gpu, set, 7, buffers.keys[1 - from]);
    bind_order_buffer(gpu, set, 8, buffers.values[1 - from]);
}

std::size_t blocks_of(std::size_t numbers) { return (numbers + shader::kSortBlock - 1) / shader::kSortBlock; }

std::size_t digits_in_table(std::size_t elements) { return shader::kSortGroup * blocks_of(elements); }

shader::Groups groups_for(std::size_t elements, std::size_t per_group) {
    return shader::dispatch_of(shader::uint((elements + per_group - 1) / per_group));
}

shader::OrderCounts counts_for(std::size_t visible, std::size_t entries) {
    constexpr std::size_t kEach = shader::kSortGroup, kBlock = shader::kSortBlock;
    return {.visible = shader::uint(visible),
            .entries = shader::uint(entries),
            .wanted = shader::uint(entries),
            .not_fitted = 0,
            .total = 0,
            .visible_each = groups_for(visible, kEach),
            .visible_blocks = groups_for(visible, kBlock),
            .visible_digits = groups_for(digits_in_table(visible), kBlock),
            .entries_each = groups_for(entries, kEach),
            .entries_blocks = groups_for(entries, kBlock),
            .entries_digits = groups_for(digits_in_table(entries), kBlock),
            .splats = groups_for(visible, shader::kComputeGroup),
            .items = {}};
}

void OrderRecorder::bind(OrderPass pass, vk::DescriptorSet set, const shader::OrderStep& step) const {
    constexpr auto kPoint = vk::PipelineBindPoint::eCompute;
    pass_barrier(commands_);
    commands_.bindPipeline(kPoint, *pipelines_.passes[std::size_t(pass)]);
    commands_.bindDescriptorSets(kPoint, *pipelines_.layout, 0, set, {});
    commands_.pushConstants<shader::OrderStep>(*pipelines_.layout, vk::ShaderStageFlagBits::eCompute, 0,
                                               step);
}

void OrderRecorder::run(OrderPass pass, vk::DescriptorSet set, const shader::OrderStep& step,
                        std::size_t groups) const {
    bind(pass, set, step);
    dispatch_groups(commands_, groups);
}

void OrderRecorder::run_indirect(OrderPass pass, vk::DescriptorSet set, const shader::OrderStep& step,
                                 std::size_t offset) const {
    bind(pass, set, step);
    commands_.dispatchIndirect(*counts_.buffer, offset);
}

void OrderRecorder::scan(vk::DescriptorSet set, const shader::OrderStep& step) const {
    const auto over_blocks = [&](OrderPass pass) {
        switch (step.table) {
            case shader::kAllBalls:
                return run(pass, set, step, blocks_of(step.count));
            case shader::kMapTiles:
                return run(pass, set, step, blocks_of(step.tiles));
            case shader::kSeenBalls:
                return run_indirect(pass, set, step, offsetof(shader::OrderCounts, visible_blocks));
            case shader::kSeenDigits:
                return run_indirect(pass, set, step, offsetof(shader::OrderCounts, visible_digits));
            default:
                return run_indirect(pass, set, step, offsetof(shader::OrderCounts, entries_digits));
        }
    };
    over_blocks(OrderPass::scan_reduce);
    run(OrderPass::scan_sums, set, step, 1);
    over_blocks(OrderPass::scan_blocks);
}

void OrderRecorder::sort(const std::array<vk::DescriptorSet, 2>& sets, std::uint32_t table,
                         std::uint32_t bits) const {
    const std::size_t blocks = table == shader::kListDigits ? offsetof(shader::OrderCounts, entries_blocks)
                                                            : offsetof(shader::OrderCounts, visible_blocks);
    shader::OrderStep step{};
    step.table = table;
    for (std::uint32_t pass = 0; pass < passes(bits); ++pass) {
        const vk::DescriptorSet set = sets[pass % 2];
        step.shift = 8 * pass;
        run_indirect(OrderPass::sort_count, set, step, blocks);
        scan(set, step);
        run_indirect(OrderPass::sort_scatter, set, step, blocks);
    }
}

void full_barrier(const vk::raii::CommandBuffer& commands) {
    const vk::MemoryBarrier2 change(vk::PipelineStageFlagBits2::eAllCommands,
                                    vk::AccessFlagBits2::eMemoryWrite,
                                    vk::PipelineStageFlagBits2::eAllCommands,
                                    vk::AccessFlagBits2::eMemoryRead | vk::AccessFlagBits2::eMemoryWrite);
    commands.pipelineBarrier2(vk::DependencyInfo().setMemoryBarriers(change));
}

void pass_barrier(const vk::raii::CommandBuffer& commands) {
    constexpr auto kStages =
        vk::PipelineStageFlagBits2::eComputeShader | vk::PipelineStageFlagBits2::eDrawIndirect;
    const vk::MemoryBarrier2 change(kStages, vk::AccessFlagBits2::eShaderStorageWrite, kStages,
                                    vk::AccessFlagBits2::eShaderStorageRead |
                                        vk::AccessFlagBits2::eShaderStorageWrite |
                                        vk::AccessFlagBits2::eIndirectCommandRead);
    commands.pipelineBarrier2(vk::DependencyInfo().setMemoryBarriers(change));
}

}  // namespace nephos
