// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_sort.h"

#include <array>

namespace nephos {
namespace {

namespace spirv {
#include "bins_boxes_comp.h"
#include "bins_count_comp.h"
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
        spirv::order_view_comp,   spirv::bins_boxes_comp,  spirv::bins_count_comp,    spirv::bins_plan_comp,
        spirv::bins_emit_comp,    spirv::bins_ranges_comp, spirv::sun_keys_comp,      spirv::sun_view_comp,
        spirv::sun_items_comp,    spirv::sun_items_comp,   spirv::sun_queries_comp,   spirv::sun_store_comp};
}

}  // namespace

std::vector<Pipeline> create_order_pipelines(const GpuDevice& gpu) {
    std::vector<Pipeline> pipelines;
    const std::array code = codes();
    for (std::size_t i = 0; i < kOrderPasses; ++i) {
        const ShaderConstant writes{0, i == std::size_t(OrderPass::sun_items)};  // of sun_items.comp
        pipelines.push_back(create_compute_pipeline(gpu, code[i], {&writes, 1}));
    }
    return pipelines;
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
            .required = shader::uint(entries),
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

void OrderRecorder::begin(OrderPass pass, const Resources& resources, const shader::OrderStep& step) const {
    const Pipeline& pipeline = pipelines_[std::size_t(pass)];
    pass_barrier(commands_);
    begin_compute(commands_, pipeline, sets_.fill(pipeline, resources), step);
}

void OrderRecorder::run(OrderPass pass, const Resources& resources, const shader::OrderStep& step,
                        std::size_t groups) const {
    begin(pass, resources, step);
    dispatch_groups(commands_, groups);
}

void OrderRecorder::run_indirect(OrderPass pass, const Resources& resources, const shader::OrderStep& step,
                                 std::size_t offset) const {
    begin(pass, resources, step);
    commands_.dispatchIndirect(*counts_.buffer, offset);
}

void OrderRecorder::scan(const Resources& resources, const shader::OrderStep& step) const {
    const auto over_blocks = [&](OrderPass pass) {
        switch (step.table) {
            case shader::kAllSplats:
                return run(pass, resources, step, blocks_of(step.count + step.billboards));
            case shader::kMapTiles:
                return run(pass, resources, step, blocks_of(step.tiles));
            case shader::kSeenSplats:
                return run_indirect(pass, resources, step, offsetof(shader::OrderCounts, visible_blocks));
            case shader::kSeenDigits:
                return run_indirect(pass, resources, step, offsetof(shader::OrderCounts, visible_digits));
            default:
                return run_indirect(pass, resources, step, offsetof(shader::OrderCounts, entries_digits));
        }
    };
    over_blocks(OrderPass::scan_reduce);
    run(OrderPass::scan_sums, resources, step, 1);
    over_blocks(OrderPass::scan_blocks);
}

void OrderRecorder::sort(const Resources& resources, const SortBuffers& buffers, std::size_t from,
                         std::uint32_t table, std::uint32_t bits) const {
    const std::size_t blocks = table == shader::kListDigits ? offsetof(shader::OrderCounts, entries_blocks)
                                                            : offsetof(shader::OrderCounts, visible_blocks);
    shader::OrderStep step{};
    step.table = table;
    for (std::uint32_t pass = 0; pass < passes(bits); ++pass) {
        Resources moved = resources;
        moved.set(buffers.from((from + pass) % 2));
        step.shift = 8 * pass;
        run_indirect(OrderPass::sort_count, moved, step, blocks);
        scan(moved, step);
        run_indirect(OrderPass::sort_scatter, moved, step, blocks);
    }
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
