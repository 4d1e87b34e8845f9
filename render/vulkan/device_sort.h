// SPDX-License-Identifier: Apache-2.0
#pragma once

// Prefix sums and a stable radix sort in compute shaders, and the recording of the passes that make orders and lists
// on the device (device_lists.h), whose bindings are in render/vulkan/order.glsl.
//
// The sort takes 8 bits a pass, least significant first: digits are counted for each block of 2048 elements,
// a prefix sum over digits and blocks gives each block its places, and elements go there in their order. Sums
// are made by reducing, then scanning: no work group waits for another, and nothing depends on the size of
// subgroups. How many elements there are only the device knows (shader::OrderCounts), so passes are
// dispatched indirectly. Private to the module.

#include <cstdint>
#include <vector>

#include "render/gpu/gpu_pipeline.h"
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
    bins_count,
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
inline constexpr std::size_t kOrderPasses = 20;

// Storage buffers that sort passes read and write.
struct SortBuffers {
    GpuBuffer keys[2], values[2];

    // Returns them as resources of a pass that moves elements from keys[from], values[from] to those of 1 - from.
    Resources from(std::size_t from) const {
        return {{5, keys[from]}, {6, values[from]}, {7, keys[1 - from]}, {8, values[1 - from]}};
    }
};

// Returns the pipelines of all passes, as OrderPass numbers them.
std::vector<Pipeline> create_order_pipelines(const GpuDevice& gpu);

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
    // `counts` has shader::OrderCounts. All of them outlive this.
    OrderRecorder(const vk::raii::CommandBuffer& commands, const std::vector<Pipeline>& pipelines,
                  DescriptorSets& sets, const GpuBuffer& counts)
        : commands_(commands), pipelines_(pipelines), sets_(sets), counts_(counts) {}

    void run(OrderPass pass, const Resources& resources, const shader::OrderStep& step,
             std::size_t groups) const;
    // Dispatches the number of groups in a member of OrderCounts.
    void run_indirect(OrderPass pass, const Resources& resources, const shader::OrderStep& step,
                      std::size_t offset) const;
    // Computes prefix sums of the table step.table; the sum of all goes to OrderCounts::total.
    void scan(const Resources& resources, const shader::OrderStep& step) const;
    // Sorts by the lower `bits` of the keys what is in buffers `from`; it ends in buffers end_of_sort(from, bits).
    // `table`: kSeenDigits or kListDigits.
    void sort(const Resources& resources, const SortBuffers& buffers, std::size_t from, std::uint32_t table,
              std::uint32_t bits) const;
    static std::size_t end_of_sort(std::size_t from, std::uint32_t bits) { return (from + passes(bits)) % 2; }

  private:
    static std::uint32_t passes(std::uint32_t bits) { return (bits + 7) / 8; }
    void begin(OrderPass pass, const Resources& resources, const shader::OrderStep& step) const;

    const vk::raii::CommandBuffer& commands_;
    const std::vector<Pipeline>& pipelines_;
    DescriptorSets& sets_;
    const GpuBuffer& counts_;
};

// Compute shaders and the arguments of their dispatches after those before.
void pass_barrier(const vk::raii::CommandBuffer& commands);

}  // namespace nephos
