// SPDX-License-Identifier: Apache-2.0
#include "tests/render/renderer_test_access.h"

#include <algorithm>
#include <cstring>
#include <numeric>

#include "core/error.h"
#include "render/blended/blended_backend.h"
#include "render/renderer_impl.h"
#include "render/vulkan/vulkan_backend.h"

namespace nephos {

VulkanBackend* RendererTestAccess::vulkan(const Renderer& renderer) {
    return dynamic_cast<VulkanBackend*>(renderer.impl_->backend.get());
}

GpuDevice& RendererTestAccess::device(const Renderer& renderer) {
    if (VulkanBackend* backend = vulkan(renderer)) return backend->scene().gpu;
    if (auto* backend = dynamic_cast<BlendedBackend*>(renderer.impl_->backend.get()))
        return backend->scene().gpu;
    throw Error(ErrorCode::usage, "the back-end cpu has no device");
}

namespace {

BinnedView& binned_view(VulkanBackend* backend) {
    if (backend == nullptr) throw Error(ErrorCode::usage, "only the back-end vulkan bins on a device");
    return backend->view();
}

GpuBuffer storage(const GpuDevice& gpu, std::size_t bytes, std::span<const std::byte> content = {},
                  vk::BufferUsageFlags more = {}) {
    GpuBuffer buffer = create_buffer(gpu, std::max<std::size_t>(bytes, 4),
                                     vk::BufferUsageFlagBits::eStorageBuffer | more, HostAccess::read);
    std::ranges::copy(content, buffer.mapped);
    return buffer;
}

std::vector<std::uint32_t> words_of(const GpuBuffer& buffer, std::size_t count) {
    std::vector<std::uint32_t> words(count);
    if (count > 0) std::memcpy(words.data(), buffer.mapped, 4 * count);
    return words;
}

// The passes with nothing but what sums and sorts need.
struct SortBench {
    const GpuDevice& gpu;
    std::vector<Pipeline> pipelines = create_order_pipelines(gpu);
    DescriptorSets sets{gpu};
    GpuBuffer counts, table, sums;
    SortBuffers buffers;

    SortBench(const GpuDevice& device, std::span<const std::uint32_t> words, std::size_t table_size)
        : gpu(device) {
        const shader::OrderCounts known = counts_for(words.size(), 0);
        counts = storage(gpu, sizeof known, std::as_bytes(std::span(&known, 1)),
                         vk::BufferUsageFlagBits::eIndirectBuffer);
        table = storage(gpu, 4 * table_size);
        sums = storage(gpu, 4 * blocks_of(table_size));
        std::vector<std::uint32_t> indices(words.size());
        std::iota(indices.begin(), indices.end(), 0u);
        for (const std::size_t n : {0u, 1u}) {
            buffers.keys[n] = storage(gpu, words.size_bytes(), std::as_bytes(words));
            buffers.values[n] = storage(gpu, words.size_bytes(), std::as_bytes(std::span(indices)));
        }
    }

    Resources resources() const { return {{1, counts}, {9, table}, {10, sums}}; }

    template <class Record>
    void run(const Record& record) {
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            record(OrderRecorder(commands, pipelines, sets, counts));
            full_barrier(commands);
            for (const GpuBuffer* each : {&counts, &table, &buffers.values[0], &buffers.values[1]})
                buffer_barrier(commands, *each, access::compute, access::host);
        });
    }
};

}  // namespace

std::size_t RendererTestAccess::light_passes(const Renderer& renderer) {
    return renderer.impl_->lit.light_passes;
}

std::size_t RendererTestAccess::rains_on_device(const Renderer& renderer) {
    const VulkanBackend* const backend = vulkan(renderer);
    return backend != nullptr && backend->rain_if_created() != nullptr ? backend->rain_if_created()->pictures : 0;
}

void RendererTestAccess::limit_rain_rows(Renderer& renderer, int rows) { vulkan(renderer)->rain().most_rows = rows; }

std::uint64_t RendererTestAccess::uploaded_bytes(const Renderer& renderer) {
    return device(renderer).uploaded_bytes;
}

void RendererTestAccess::divide_memory(Renderer& renderer) { device(renderer).unified_memory = false; }

// Two copies into the same buffer with no barrier between them.
void RendererTestAccess::provoke_hazard(Renderer& renderer) {
    const GpuDevice& gpu = device(renderer);
    with_gpu_errors("provoking a hazard", [&] {
        using Usage = vk::BufferUsageFlagBits;
        const GpuBuffer from = create_buffer(gpu, 64, Usage::eTransferSrc, HostAccess::write);
        const GpuBuffer to = create_buffer(gpu, 64, Usage::eTransferDst, HostAccess::read);
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            for (int i = 0; i < 2; ++i)
                commands.copyBuffer(*from.buffer, *to.buffer, vk::BufferCopy(0, 0, 64));
        });
    });
}

// Sums up a block of numbers of which few are there.
void RendererTestAccess::provoke_overrun(Renderer& renderer) {
    const std::vector<std::uint32_t> numbers(1000);
    with_gpu_errors("provoking an overrun", [&] {
        SortBench bench(device(renderer), numbers, 16);
        bench.run([&](const OrderRecorder& recorder) {
            shader::OrderStep step{};
            step.table = shader::kSeenSplats;
            recorder.run(OrderPass::scan_reduce, bench.resources(), step, 1);
        });
    });
}

std::vector<std::uint32_t> RendererTestAccess::sorted(Renderer& renderer, std::span<const std::uint32_t> keys,
                                                      std::uint32_t bits) {
    SortBench bench(device(renderer), keys, digits_in_table(keys.size()));
    bench.run([&](const OrderRecorder& recorder) {
        recorder.sort(bench.resources(), bench.buffers, 0, shader::kSeenDigits, bits);
    });
    return words_of(bench.buffers.values[OrderRecorder::end_of_sort(0, bits)], keys.size());
}

std::vector<std::uint32_t> RendererTestAccess::prefix_sums(Renderer& renderer,
                                                           std::span<const std::uint32_t> numbers) {
    SortBench bench(device(renderer), numbers, numbers.size());
    std::ranges::copy(std::as_bytes(numbers), bench.table.mapped);
    bench.run([&](const OrderRecorder& recorder) {
        shader::OrderStep step{};
        step.table = shader::kSeenSplats;
        recorder.scan(bench.resources(), step);
    });
    std::vector<std::uint32_t> sums = words_of(bench.table, numbers.size());
    sums.push_back(reinterpret_cast<const shader::OrderCounts*>(bench.counts.mapped)->total);
    return sums;
}

RendererTestAccess::Lists RendererTestAccess::lists(Renderer& renderer, int tile_width, int tile_height) {
    BinnedView::Lists lists = binned_view(vulkan(renderer)).read_lists({0, 0, tile_width, tile_height});
    return {std::move(lists.balls), std::move(lists.ranges), std::move(lists.list)};
}

void RendererTestAccess::limit_lists(Renderer& renderer, std::size_t entries, std::size_t batch) {
    ListLimits& limits = binned_view(vulkan(renderer)).limits;
    limits.entries = std::min(limits.entries, entries);
    limits.batch = std::min(limits.batch, batch);
    limits.batch_with_billboards = std::min(limits.batch_with_billboards, batch);
}

void RendererTestAccess::limit_splats(Renderer& renderer, std::size_t splats) {
    binned_view(vulkan(renderer)).limits.splats = splats;
}

std::size_t RendererTestAccess::overflows(const Renderer& renderer) {
    const BinnedView* const view =
        vulkan(renderer) == nullptr ? nullptr : vulkan(renderer)->view_if_created();
    return view != nullptr ? view->overflows : 0;
}

std::size_t RendererTestAccess::grounds_on_device(const Renderer& renderer) {
    const BinnedView* const view =
        vulkan(renderer) == nullptr ? nullptr : vulkan(renderer)->view_if_created();
    return view != nullptr ? view->grounds : 0;
}

void RendererTestAccess::limit_storage(Renderer& renderer, std::uint32_t bytes) {
    device(renderer).properties.limits.maxStorageBufferRange = bytes;
}

}  // namespace nephos
