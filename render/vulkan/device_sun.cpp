// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_sun.h"

#include <algorithm>
#include <cstring>

#include "core/vec.h"
#include "render/frame/frame_data.h"

namespace nephos {
namespace {

// Sets: four as of DeviceLists, and two for the centres.
constexpr std::uint32_t kSets = 6;
constexpr std::size_t kCentres = 4;

void make(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes) {
    if (buffer.bytes >= bytes) return;
    buffer = {};
    buffer = create_buffer(gpu, bytes,
                           vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eTransferDst,
                           HostAccess::none);
}

}  // namespace

shader::SunFrame sun_frame(const ShadowFrame& frame, int shadow_size) {
    const Vec3& corner = frame.origin_m;
    const double width = length(frame.u_axis_m), height = length(frame.v_axis_m);
    const Vec3 high{double(float(corner.x)), double(float(corner.y)), double(float(corner.z))};
    return {.corner_high = to_vec4(high, 0),
            .corner_low = to_vec4(corner - high, 0),
            .direction = to_vec4(frame.direction, 0),
            .u = to_vec4((shadow_size / (width * width)) * frame.u_axis_m, width / shadow_size),
            .v = to_vec4((shadow_size / (height * height)) * frame.v_axis_m, height / shadow_size)};
}

DeviceSun::DeviceSun(const GpuDevice& gpu, const DeviceLists& lists)
    : sets_(lists.create_sets(gpu, kSets)),
      frame_(create_buffer(gpu, sizeof(shader::SunFrame), vk::BufferUsageFlagBits::eUniformBuffer,
                           HostAccess::write)),
      no_shells_(create_buffer(gpu, sizeof(shader::Shells), vk::BufferUsageFlagBits::eUniformBuffer,
                               HostAccess::write)) {
    write(gpu, no_shells_, shader::Shells{});
    reserve_copy(gpu, counts_, sizeof(shader::OrderCounts));
}

void DeviceSun::bind(const GpuDevice& gpu, const DeviceLists& lists) {
    const auto& sets = sets_.sets;
    lists.bind(gpu, {sets[kCentres], sets[kCentres + 1], sets[2], sets[3]}, frame_, no_shells_);
    lists.bind(gpu, {sets[0], sets[1], sets[2], sets[3]}, frame_, no_shells_);
    for (const std::size_t n : {std::size_t{0}, std::size_t{1}, kCentres, kCentres + 1}) {
        bind_order_buffer(gpu, sets[n], 3, lists.tails());  // sources
        bind_order_buffer(gpu, sets[n], 4, lists.splats());
        bind_order_buffer(gpu, sets[n], 12, places_);
        if (n < kCentres) continue;
        bind_order_buffer(gpu, sets[n], 11, queries_);
        bind_order_buffer(gpu, sets[n], 13, items_);
    }
}

vk::DescriptorSet DeviceSun::centres_of(const TileGrid& grid) const {
    return sets_.sets[kCentres + (1 + OrderRecorder::passes(bits_of(grid.tiles()))) % 2];
}

void DeviceSun::record(const vk::raii::CommandBuffer& commands, const DeviceLists& lists, std::size_t count,
                       const TileGrid& grid, std::uint32_t per_item) const {
    const auto& sets = sets_.sets;
    const OrderRecorder recorder = lists.recorder(commands);
    shader::OrderStep step = lists.step_of({0, 0, grid.width, grid.height}, 0);
    step.count = shader::uint(count);
    step.per_item = per_item;
    const auto each = [&](OrderPass pass, vk::DescriptorSet set) {
        recorder.run_indirect(pass, set, step, offsetof(shader::OrderCounts, visible_each));
    };
    const std::size_t tile_groups = (grid.tiles() + shader::kSortGroup - 1) / shader::kSortGroup;
    recorder.run(OrderPass::sun_keys, sets[1], step, (count + shader::kSortGroup - 1) / shader::kSortGroup);
    recorder.run(OrderPass::plan, sets[0], step, 1);
    recorder.sort({sets[0], sets[1]}, shader::kSeenDigits, 32);
    each(OrderPass::sun_view, sets[0]);
    lists.record_lists(recorder, {sets[0], sets[1], sets[2], sets[3]}, step);

    // Tiles of the centres are in buffers 1.
    recorder.sort({sets[1], sets[0]}, shader::kSeenDigits, bits_of(grid.tiles()));
    const vk::DescriptorSet centres = centres_of(grid);
    step.table = shader::kMapTiles;
    recorder.run(OrderPass::sun_count_items, centres, step, tile_groups);
    recorder.scan(centres, step);
    recorder.run(OrderPass::sun_items, centres, step, tile_groups);
    each(OrderPass::sun_queries, centres);
}

bool DeviceSun::run(const GpuDevice& gpu, const SunRequest& request, DeviceLists& lists,
                    const ListLimits& limits, LightTiles& tiles) {
    const std::size_t count = request.metaballs;
    const TileGrid grid{request.shadow_size, request.shadow_size};
    const std::uint32_t per_item = shader::kQueriesPerLane * gpu.tile_lanes;
    const std::size_t items = grid.tiles() + count / per_item;
    write(gpu, frame_, sun_frame(request.frame, request.shadow_size));
    make(gpu, places_, count * sizeof(shader::LightPlace));
    make(gpu, queries_, count * sizeof(shader::LightQuery));
    make(gpu, items_, items * sizeof(shader::LightItem));
    reserve_copy(gpu, depths_, count * sizeof(float));
    std::size_t entries = std::min(4 * count, limits.entries), wanted = entries;
    do {
        entries = wanted;
        lists.reserve(gpu, count, grid.tiles(), entries);
        bind(gpu, lists);
        tiles.use_lists(
            gpu, request.shadow_size,
            {&queries_, &lists.splats(), &lists.ranges(), &lists.list(grid.tiles()), &items_, &places_});
        entries = lists.entry_capacity();
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            full_barrier(commands);
            // Beyond one row, more work groups run than there are items: the others find empty ones.
            commands.fillBuffer(*items_.buffer, 0, VK_WHOLE_SIZE, 0);
            full_barrier(commands);
            record(commands, lists, count, grid, per_item);
            pass_barrier(commands);
            tiles.record_lists(commands, grid, request.largest_radius, items, lists.counts(),
                               offsetof(shader::OrderCounts, items));
            lists.recorder(commands).run_indirect(OrderPass::sun_store, centres_of(grid), {},
                                                  offsetof(shader::OrderCounts, visible_each));
            full_barrier(commands);
            commands.copyBuffer(*lists.table().buffer, *depths_.buffer,
                                vk::BufferCopy(0, 0, count * sizeof(float)));
            commands.copyBuffer(*lists.counts().buffer, *counts_.buffer,
                                vk::BufferCopy(0, 0, sizeof(shader::OrderCounts)));
            buffer_barrier(commands, depths_, access::copy_to, access::host);
            buffer_barrier(commands, counts_, access::copy_to, access::host);
        });
        wanted = reinterpret_cast<const shader::OrderCounts*>(counts_.mapped)->wanted;
        if (wanted > limits.entries) return false;
    } while (wanted > entries);
    return true;
}

void DeviceSun::read_depths(std::span<float> depths) const {
    if (!depths.empty()) std::memcpy(depths.data(), depths_.mapped, depths.size_bytes());
}

}  // namespace nephos
