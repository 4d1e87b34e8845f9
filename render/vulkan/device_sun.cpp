// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_sun.h"

#include <algorithm>
#include <cstring>

#include "core/vec.h"
#include "render/frame/frame_data.h"

namespace nephos {
namespace {

// The most items of work that there may be.
std::size_t items_in(const SunRequest& request, std::size_t per_item) {
    const TileGrid grid{request.shadow_size, request.shadow_size};
    return grid.tiles() + request.metaballs / per_item;
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

DeviceSun::DeviceSun(const GpuDevice& gpu)
    : per_item_(shader::kQueriesPerLane * gpu.tile_lanes),
      sets_(gpu),
      frame_(create_buffer(gpu, sizeof(shader::SunFrame), vk::BufferUsageFlagBits::eUniformBuffer,
                           HostAccess::write)),
      no_shells_(create_buffer(gpu, sizeof(shader::Shells), vk::BufferUsageFlagBits::eUniformBuffer,
                               HostAccess::write)) {
    write(gpu, no_shells_, shader::Shells{});
    reserve_copy(gpu, counts_, sizeof(shader::OrderCounts));
}

void DeviceSun::record(const vk::raii::CommandBuffer& commands, const SunRequest& request,
                       const DeviceLists& lists, std::size_t batch, const LightTiles& tiles) {
    const std::size_t count = request.metaballs;
    const TileGrid grid{request.shadow_size, request.shadow_size};
    const OrderRecorder recorder = lists.recorder(commands, sets_);
    Resources resources = lists.resources();
    resources.set({{14, no_shells_},
                   {16, frame_},
                   {17, lists.tails()},
                   {18, lists.splats()},
                   {19, queries_},
                   {20, places_},
                   {21, items_}});
    shader::OrderStep step = lists.step_of({0, 0, grid.width, grid.height}, 0);
    step.count = shader::uint(count);
    step.per_item = per_item_;
    const auto each = [&](OrderPass pass, const Resources& with) {
        recorder.run_indirect(pass, with, step, offsetof(shader::OrderCounts, visible_each));
    };
    recorder.run(OrderPass::sun_keys, lists.with_order(resources, 1), step,
                 (count + shader::kSortGroup - 1) / shader::kSortGroup);
    recorder.run(OrderPass::plan, resources, step, 1);
    recorder.sort(resources, lists.order(), 0, shader::kSeenDigits, 32);
    each(OrderPass::sun_view, lists.with_order(resources, 0));

    // Tiles of the centres are in buffers 1.
    const std::uint32_t bits = bits_of(grid.tiles());
    recorder.sort(resources, lists.order(), 1, shader::kSeenDigits, bits);
    const Resources centres = lists.with_order(resources, OrderRecorder::end_of_sort(1, bits));
    const std::size_t tile_groups = (grid.tiles() + shader::kSortGroup - 1) / shader::kSortGroup;
    step.table = shader::kMapTiles;
    recorder.run(OrderPass::sun_count_items, centres, step, tile_groups);
    recorder.scan(centres, step);
    recorder.run(OrderPass::sun_items, centres, step, tile_groups);
    each(OrderPass::sun_queries, centres);

    step.table = shader::kSeenSplats;
    const Resources of_tiles{{1, queries_}, {2, lists.splats()},           {5, lists.ranges()},
                             {7, items_},   {6, lists.list(grid.tiles())}, {9, places_}};
    for (std::size_t begin = 0; begin < count; begin += batch) {
        step.begin = shader::uint(begin);
        step.end = shader::uint(std::min(count, begin + batch));
        lists.record_batch(recorder, resources, step);
        pass_barrier(commands);
        tiles.record(commands, sets_, of_tiles, grid,
                     {begin == 0, begin + batch >= count, request.largest_radius},
                     items_in(request, per_item_), lists.counts(), offsetof(shader::OrderCounts, items));
    }
    each(OrderPass::sun_store, centres);
}

void DeviceSun::run(const GpuDevice& gpu, const SunRequest& request, DeviceLists& lists,
                    const ListLimits& limits, LightTiles& tiles) {
    const std::size_t count = request.metaballs;
    const TileGrid grid{request.shadow_size, request.shadow_size};
    write(gpu, frame_, sun_frame(request.frame, request.shadow_size));
    reserve_storage(gpu, places_, count * sizeof(shader::LightPlace));
    reserve_storage(gpu, queries_, count * sizeof(shader::LightQuery));
    reserve_storage(gpu, items_, items_in(request, per_item_) * sizeof(shader::LightItem));
    reserve_copy(gpu, depths_, count * sizeof(float));
    tiles.resize_map(gpu, request.shadow_size);
    std::size_t required = std::min(4 * count, limits.entries), batch = std::min(count, limits.batch);
    do {
        if (required > limits.entries) batch = smaller_batch(batch, required, limits);
        lists.reserve(gpu, {.splats = count,
                            .billboards = 0,
                            .tiles = grid.tiles(),
                            .entries = std::min(required, limits.entries)});
        sets_.reset();
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            full_barrier(commands);
            // Beyond one row, more work groups run than there are items: the others find empty ones.
            commands.fillBuffer(*items_.buffer, 0, VK_WHOLE_SIZE, 0);
            full_barrier(commands);
            record(commands, request, lists, batch, tiles);
            full_barrier(commands);
            commands.copyBuffer(*lists.table().buffer, *depths_.buffer,
                                vk::BufferCopy(0, 0, count * sizeof(float)));
            commands.copyBuffer(*lists.counts().buffer, *counts_.buffer,
                                vk::BufferCopy(0, 0, sizeof(shader::OrderCounts)));
            buffer_barrier(commands, depths_, access::copy_to, access::host);
            buffer_barrier(commands, counts_, access::copy_to, access::host);
        });
        required = reinterpret_cast<const shader::OrderCounts*>(counts_.mapped)->required;
    } while (required > lists.entry_capacity());
}

void DeviceSun::read_depths(std::span<float> depths) const {
    if (!depths.empty()) std::memcpy(depths.data(), depths_.mapped, depths.size_bytes());
}

}  // namespace nephos
