// SPDX-License-Identifier: Apache-2.0
#pragma once

// Prefix sums and a stable radix sort in compute shaders, and what else makes orders and lists on the device
// (device_lists.h): pipelines and the one descriptor layout that they share, render/vulkan/order.glsl.
//
// The sort takes 8 bits a pass, least significant first: digits are counted for each block of 2048 elements,
// a prefix sum over digits and blocks gives each block its places, and elements go there in their order. Sums
// are made by reducing, then scanning: no work group waits for another, and nothing depends on the size of
// subgroups. How many elements there are only the device knows (shader::OrderCounts), so passes are
// dispatched indirectly. Private to the module.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "render/gpu/gpu_resources.h"
#include "render/shared/order.h"

namespace nephos {

enum class OrderPass {
    scan_reduce,
    scan_sums,
    scan_blocks,
    sort_count,
    sort_scatter,
    cull,
    compact,
    plan,
    view,
    boxes,
    bins_plan,
    emit,
    ranges,
    sun_keys,
    sun_view,
    sun_count_items,
    sun_items,
    sun_queries,
    sun_store,
};
inline constexpr std::size_t kOrderPasses = 19;
inline constexpr std::uint32_t kOrderBindings = 15;  // 0 and 14 are uniform buffers, the others storage

// Storage buffers that sort passes read and write.
struct SortBuffers {
    GpuBuffer keys[2], values[2];
};

struct OrderPipelines {
    vk::raii::DescriptorSetLayout set_layout{nullptr};
    vk::raii::PipelineLayout layout{nullptr};
    std::vector<vk::raii::Pipeline> passes;  // as OrderPass numbers them
};

// Returns the reason why this device cannot sort and make lists; empty if it can.
std::string missing_for_lists(const GpuDevice& gpu);

OrderPipelines create_order_pipelines(const GpuDevice& gpu);

// `count` sets of the layout, and their pool.
struct OrderSets {
    vk::raii::DescriptorPool pool{nullptr};
    std::vector<vk::DescriptorSet> sets;
};
OrderSets create_order_sets(const GpuDevice& gpu, const OrderPipelines& pipelines, std::uint32_t count);

void bind_order_buffer(const GpuDevice& gpu, vk::DescriptorSet set, std::uint32_t binding,
                       const GpuBuffer& buffer);
// Elements go from keys[from], values[from] to those of 1 - from.
void bind_sort_buffers(const GpuDevice& gpu, vk::DescriptorSet set, const SortBuffers& buffers,
                       std::size_t from);

// Numbers in the table of a sort of so many elements.
std::size_t digits_in_table(std::size_t elements);
// Blocks of a table, and so numbers in the buffer of their sums.
std::size_t blocks_of(std::size_t numbers);

// Returns the work groups for the members of shader::OrderCounts.
shader::Groups groups_for(std::size_t elements, std::size_t per_group);
// Returns the counts that order_plan.comp and bins_plan.comp write for `visible` and `entries` elements.
shader::OrderCounts counts_for(std::size_t visible, std::size_t entries);

// Writes commands of passes. All commands before a pass are done and visible when it begins.
class OrderRecorder {
  public:
    // `counts` has shader::OrderCounts.
    OrderRecorder(const vk::raii::CommandBuffer& commands, const OrderPipelines& pipelines,
                  const GpuBuffer& counts)
        : commands_(commands), pipelines_(pipelines), counts_(counts) {}

    void run(OrderPass pass, vk::DescriptorSet set, const shader::OrderStep& step, std::size_t groups) const;
    // Dispatches the number of groups in a member of OrderCounts.
    void run_indirect(OrderPass pass, vk::DescriptorSet set, const shader::OrderStep& step,
                      std::size_t offset) const;
    // Computes prefix sums of the table step.table; the sum of all goes to OrderCounts::total.
    void scan(vk::DescriptorSet set, const shader::OrderStep& step) const;
    // Sorts by the lower `bits` of the keys what is in buffers 0; it ends in buffers passes(bits) % 2.
    // `sets`: from buffers 0 to 1, and from 1 to 0. `table`: kSeenDigits or kListDigits.
    void sort(const std::array<vk::DescriptorSet, 2>& sets, std::uint32_t table, std::uint32_t bits) const;

    static std::uint32_t passes(std::uint32_t bits) { return (bits + 7) / 8; }

  private:
    void bind(OrderPass pass, vk::DescriptorSet set, const shader::OrderStep& step) const;

    const vk::raii::CommandBuffer& commands_;
    const OrderPipelines& pipelines_;
    const GpuBuffer& counts_;
};

// Everything before, whatever it was, is done and visible to everything after. For the beginning of commands
// that use buffers of others that may still run.
void full_barrier(const vk::raii::CommandBuffer& commands);
// Compute shaders and the arguments of their dispatches after those before.
void pass_barrier(const vk::raii::CommandBuffer& commands);

}  // namespace nephos
