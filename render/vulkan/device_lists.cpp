// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_lists.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/vec.h"
#include "render/frame/frame_data.h"
#include "render/frame/view_sorting.h"

namespace nephos {
namespace {

// A number as a sum of two floats.
struct HighLow {
    float high, low;
};
HighLow high_low(double value) {
    const auto high = float(value);
    return {high, float(value - double(high))};
}

bool within_reach(double value) { return std::abs(value) < double(shader::kFarthest_m); }
bool within_reach(const Metaball& ball) {
    return within_reach(ball.x) && within_reach(ball.y) && within_reach(ball.z) && within_reach(ball.radius);
}

void make(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes, vk::BufferUsageFlags more = {}) {
    buffer = {};  // the old one goes before the new one comes
    const vk::BufferUsageFlags usage = vk::BufferUsageFlagBits::eStorageBuffer |
                                       vk::BufferUsageFlagBits::eTransferSrc |
                                       vk::BufferUsageFlagBits::eTransferDst;
    buffer = create_buffer(gpu, bytes, usage | more, HostAccess::none);
}

}  // namespace

std::uint32_t bits_of(std::size_t tiles) { return std::uint32_t(std::bit_width(tiles - 1)); }

ListLimits limits_of(const GpuDevice& gpu) {
    const std::size_t range = gpu.properties.limits.maxStorageBufferRange;
    ListLimits most;
    // lavapipe (Mesa 22.3) leaves all loops of a shader after 65,535 turns in all; a metaball that is not
    // fitted takes more than one in the loop over a tile's list (view_tiles.cpp).
    if (gpu.properties.deviceType == vk::PhysicalDeviceType::eCpu) most.balls = 50'000;
    // The table of digits is smaller than either.
    return {std::min(most.balls, range / sizeof(shader::CloudBall) / shader::kSortBlock * shader::kSortBlock),
            std::min(most.entries, range / sizeof(shader::uint) / shader::kSortBlock * shader::kSortBlock)};
}

bool is_near_enough(const PreparedCloud& cloud) {
    return std::ranges::all_of(cloud.visible,
                               [&](std::uint32_t i) { return within_reach(cloud.metaballs[i]); });
}

bool is_near_enough(const Vec3& eye) {
    return within_reach(eye.x) && within_reach(eye.y) && within_reach(eye.z);
}

std::vector<shader::CloudBall> cloud_balls(const PreparedCloud& cloud, std::span<const float> sun_depths) {
    const double scale = cloud.top_m > cloud.base_m ? 1.0 / (cloud.top_m - cloud.base_m) : 0.0;
    std::vector<shader::CloudBall> balls(cloud.visible.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, balls.size(), 8192), [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const Metaball& ball = cloud.metaballs[cloud.visible[i]];
            balls[i] = {ball.x,
                        ball.y,
                        ball.z,
                        ball.radius,
                        cloud.depth_scale[i],
                        sun_depths[i],
                        float((ball.z - cloud.base_m) * scale),
                        0};
        }
    });
    return balls;
}

shader::OrderFrame order_frame(const CameraFrame& camera, const Camera& options, const Ground& ground,
                               bool has_flash) {
    const HighLow x = high_low(camera.position_m.x), y = high_low(camera.position_m.y),
                  z = high_low(camera.position_m.z), height = high_low(ground.height_m);
    const Frustum pyramid(camera);
    const double half_width = 0.5 * options.width, half_height = 0.5 * options.height;
    shader::OrderFrame frame;
    frame.eye_high = {x.high, y.high, z.high, height.high};
    frame.eye_low = {x.low, y.low, z.low, height.low};
    for (std::size_t n = 0; n < 5; ++n) frame.inward[n] = to_vec4(pyramid.inward(n), 0);
    frame.right = to_vec4(camera.right, half_width / camera.half_width);
    frame.up = to_vec4(camera.up, half_height / camera.half_height);
    frame.forward = to_vec4(camera.forward, pixels_per_unit(options, camera));
    frame.middle = {float(half_width), float(half_height),
                    camera.position_m.z > ground.height_m ? 1.0f : 0.0f, has_flash ? 1.0f : 0.0f};
    return frame;
}

bool DeviceLists::has_room(std::size_t balls, std::size_t tiles, std::size_t entries) const {
    return sums_.bytes != 0 && balls <= ball_capacity_ && tiles <= tile_capacity_ &&
           entries <= entry_capacity_;
}

void DeviceLists::reserve_balls(const GpuDevice& gpu, std::size_t count) {
    constexpr std::size_t kWord = sizeof(shader::uint);
    ball_capacity_ = 0;  // until all of them are there
    make(gpu, cloud_, count * sizeof(shader::CloudBall));
    make(gpu, flash_, count * kWord);
    make(gpu, balls_, count * sizeof(shader::ViewBall));
    make(gpu, splats_, count * sizeof(shader::ViewSplat));
    make(gpu, tails_, count * kWord);
    make(gpu, boxes_, count * 2 * kWord);
    for (GpuBuffer* each : {&order_.keys[0], &order_.keys[1], &order_.values[0], &order_.values[1]})
        make(gpu, *each, count * kWord);
    ball_capacity_ = count;
}

void DeviceLists::reserve_entries(const GpuDevice& gpu, std::size_t count) {
    constexpr std::size_t kWord = sizeof(shader::uint);
    entry_capacity_ = 0;
    for (GpuBuffer* each : {&entries_.keys[0], &entries_.keys[1], &entries_.values[0], &entries_.values[1]})
        make(gpu, *each, count * kWord);
    entry_capacity_ = count;
}

void DeviceLists::reserve(const GpuDevice& gpu, std::size_t balls, std::size_t tiles, std::size_t entries) {
    if (has_room(balls, tiles, entries)) return;
    constexpr std::size_t kWord = sizeof(shader::uint);
    if (parts_.bytes == 0) {
        make(gpu, counts_, sizeof(shader::OrderCounts), vk::BufferUsageFlagBits::eIndirectBuffer);
        // Between shells, before the first and behind the last; fog has one shell more.
        make(gpu, parts_, sizeof(shader::ViewPart) * (shader::kMaxShells + 2),
             vk::BufferUsageFlagBits::eIndirectBuffer);
    }
    const auto whole_blocks = [](std::size_t count) {
        return std::max<std::size_t>(1, blocks_of(count)) * shader::kSortBlock;
    };
    if (balls > ball_capacity_) reserve_balls(gpu, whole_blocks(balls));
    if (entries > entry_capacity_) reserve_entries(gpu, whole_blocks(entries));
    if (tiles > tile_capacity_) {
        tile_capacity_ = 0;
        make(gpu, ranges_, tiles * sizeof(shader::TileRange));
        tile_capacity_ = tiles;
    }
    // Marks or tiles of balls, digits of entries, items of the tiles of a shadow map.
    const std::size_t numbers = std::max({ball_capacity_, digits_in_table(entry_capacity_), tile_capacity_});
    if (numbers * kWord > table_.bytes || sums_.bytes == 0) {
        sums_ = {};
        make(gpu, table_, numbers * kWord);
        make(gpu, sums_, blocks_of(numbers) * kWord);
    }
}

const GpuBuffer& DeviceLists::list(std::size_t tiles) const {
    return entries_.values[OrderRecorder::passes(bits_of(tiles)) % 2];
}

void DeviceLists::bind(const GpuDevice& gpu, const Sets& sets, const GpuBuffer& frame,
                       const GpuBuffer& shells) const {
    for (std::size_t n = 0; n < sets.size(); ++n) {
        bind_order_buffer(gpu, sets[n], 0, frame);
        bind_order_buffer(gpu, sets[n], 1, counts_);
        bind_order_buffer(gpu, sets[n], 2, cloud_);
        bind_order_buffer(gpu, sets[n], 3, flash_);
        bind_order_buffer(gpu, sets[n], 4, balls_);
        bind_sort_buffers(gpu, sets[n], n < 2 ? order_ : entries_, n % 2);
        bind_order_buffer(gpu, sets[n], 9, table_);
        bind_order_buffer(gpu, sets[n], 10, sums_);
        bind_order_buffer(gpu, sets[n], 11, boxes_);
        bind_order_buffer(gpu, sets[n], 12, ranges_);
        bind_order_buffer(gpu, sets[n], 13, parts_);
        bind_order_buffer(gpu, sets[n], 14, shells);
    }
}

void DeviceLists::record_order(const vk::raii::CommandBuffer& commands, const Sets& sets,
                               std::size_t count) const {
    const OrderRecorder recorder(commands, pipelines_, counts_);
    shader::OrderStep step{};
    step.count = shader::uint(count);
    step.table = shader::kAllBalls;
    const std::size_t each = (count + shader::kSortGroup - 1) / shader::kSortGroup;
    recorder.run(OrderPass::cull, sets[0], step, each);  // keys to buffer 1
    recorder.scan(sets[0], step);
    recorder.run(OrderPass::compact, sets[1], step, each);  // from there to buffer 0
    recorder.run(OrderPass::plan, sets[0], step, 1);
    recorder.sort({sets[0], sets[1]}, shader::kSeenDigits, 32);
    recorder.run_indirect(OrderPass::view, sets[0], step, offsetof(shader::OrderCounts, visible_each));
}

shader::OrderStep DeviceLists::step_of(const Tile& tile, std::size_t shells) const {
    const TileGrid grid{tile.width, tile.height};
    return {.count = 0,
            .table = shader::kSeenBalls,
            .shift = 0,
            .x = shader::uint(tile.x),
            .y = shader::uint(tile.y),
            .width = shader::uint(tile.width),
            .height = shader::uint(tile.height),
            .columns = shader::uint(grid.columns()),
            .tiles = shader::uint(grid.tiles()),
            .capacity = shader::uint(entry_capacity_),
            .shells = shader::uint(shells),
            .per_item = 0};
}

void DeviceLists::record_lists(const OrderRecorder& recorder, const Sets& sets,
                               const shader::OrderStep& step) const {
    const std::uint32_t bits = bits_of(step.tiles);
    recorder.scan(sets[0], step);
    recorder.run(OrderPass::bins_plan, sets[0], step, 1);
    recorder.run_indirect(OrderPass::emit, sets[3], step, offsetof(shader::OrderCounts, entries_each));
    recorder.sort({sets[2], sets[3]}, shader::kListDigits, bits);
    recorder.run(OrderPass::ranges, sets[2 + OrderRecorder::passes(bits) % 2], step,
                 (step.tiles + shader::kSortGroup - 1) / shader::kSortGroup);
}

void DeviceLists::record_bins(const vk::raii::CommandBuffer& commands, const Sets& sets, const Tile& tile,
                              std::size_t shells) const {
    const OrderRecorder own = recorder(commands);
    const shader::OrderStep step = step_of(tile, shells);
    own.run_indirect(OrderPass::boxes, sets[0], step, offsetof(shader::OrderCounts, visible_each));
    record_lists(own, sets, step);
    pass_barrier(commands);
}

}  // namespace nephos
