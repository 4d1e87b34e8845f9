// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_lists.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
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
bool within_reach(const Vec3& at) { return within_reach(at.x) && within_reach(at.y) && within_reach(at.z); }
bool within_reach(const Metaball& ball) {
    return within_reach(Vec3{ball.x, ball.y, ball.z}) && within_reach(double(ball.radius));
}

std::size_t whole_blocks(std::size_t count) {
    return std::max<std::size_t>(1, blocks_of(count)) * shader::kSortBlock;
}

}  // namespace

std::uint32_t bits_of(std::size_t tiles) { return std::uint32_t(std::bit_width(tiles - 1)); }

ListLimits limits_of(const GpuDevice& gpu) {
    const std::size_t range = gpu.properties.limits.maxStorageBufferRange;
    const auto longest = [&](std::size_t bytes) {
        return range / bytes / shader::kSortBlock * shader::kSortBlock;
    };
    ListLimits limits;
    // Of all buffers of splats, that of the billboards has the largest elements; indices have 28 bits.
    limits.splats = std::min(longest(sizeof(shader::SeenBillboard)), std::size_t{1} << 28);
    limits.entries = std::min(limits.entries, longest(sizeof(shader::uint)));
    // lavapipe (Mesa 22.3) leaves all loops of a shader after 65,535 turns in all: eight metaballs take nine at most,
    // or one where lanes hand them round, and a splat among billboards up to three.
    if (gpu.properties.deviceType == vk::PhysicalDeviceType::eCpu) {
        limits.batch = 50'000;
        limits.batch_with_billboards = 20'000;
        limits.batch_with_march = 15'000;  // two turns each; a sample of a ray takes about five
    }
    return limits;
}

std::size_t smaller_batch(std::size_t batch, std::size_t required, const ListLimits& limits) {
    if (batch <= 1)
        throw Error(ErrorCode::gpu, "the lists of a picture's tiles need " + std::to_string(required) +
                                        " entries for one metaball; this device has room for " +
                                        std::to_string(limits.entries));
    return std::max<std::size_t>(1, std::min(batch / 2, batch * limits.entries / (2 * required)));
}

void check_distances(const PreparedCloud& cloud, const Vec3& eye) {
    if (within_reach(eye) &&
        std::ranges::all_of(cloud.visible, [&](std::uint32_t i) { return within_reach(cloud.metaballs[i]); }))
        return;
    throw Error(ErrorCode::usage,
                "the back-end vulkan draws clouds, and has a camera, up to 1e15 m from the origin");
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
                        cloud.detail_of(i)};
        }
    });
    return balls;
}

shader::OrderFrame order_frame(const CameraFrame& camera, const Camera& options, const Ground& ground,
                               bool has_flash, double footprint_scale) {
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
    frame.march = {footprint_scale > 0 ? float(1 / footprint_scale) : 0.0f, 0, 0, 0};
    return frame;
}

bool DeviceLists::has_room(const ListSizes& sizes) const {
    return balls_.bytes != 0 && sums_.bytes != 0 && sizes.splats <= splat_capacity_ && sizes.billboards <= billboard_capacity_ &&
           sizes.tiles <= tile_capacity_ && sizes.entries <= entry_capacity_;
}

void DeviceLists::reserve_cloud(const GpuDevice& gpu, std::size_t balls) {
    if (cloud_.bytes != 0 && balls <= ball_capacity_) return;
    cloud_ = {};  // the last that is made: until both are there
    const std::size_t count = whole_blocks(balls);
    make_storage(gpu, flash_, count * sizeof(shader::uint));
    make_storage(gpu, cloud_, count * sizeof(shader::CloudBall));
    ball_capacity_ = count;
}

void DeviceLists::reserve_splats(const GpuDevice& gpu, std::size_t count, std::size_t billboards) {
    constexpr std::size_t kWord = sizeof(shader::uint);
    balls_ = {};  // the last that is made: until all of them are there
    make_storage(gpu, splats_, (count + 4 * billboards) * sizeof(shader::ViewSplat));
    make_storage(gpu, tails_, count * kWord);
    make_storage(gpu, boxes_, count * 2 * kWord);
    for (GpuBuffer* each : {&order_.keys[0], &order_.keys[1], &order_.values[0], &order_.values[1]})
        make_storage(gpu, *each, count * kWord);
    make_storage(gpu, balls_, count * sizeof(shader::ViewBall));
    splat_capacity_ = count;
    billboard_capacity_ = billboards;
}

void DeviceLists::reserve_entries(const GpuDevice& gpu, std::size_t count) {
    constexpr std::size_t kWord = sizeof(shader::uint);
    entry_capacity_ = 0;
    for (GpuBuffer* each : {&entries_.keys[0], &entries_.keys[1], &entries_.values[0], &entries_.values[1]})
        make_storage(gpu, *each, count * kWord);
    entry_capacity_ = count;
}

void DeviceLists::reserve(const GpuDevice& gpu, const ListSizes& sizes) {
    if (has_room(sizes)) return;
    constexpr std::size_t kWord = sizeof(shader::uint);
    if (parts_.bytes == 0) {
        make_storage(gpu, counts_, sizeof(shader::OrderCounts), vk::BufferUsageFlagBits::eIndirectBuffer);
        // Between shells, before the first and behind the last; fog has one shell more.
        make_storage(gpu, parts_, sizeof(shader::ViewPart) * (shader::kMaxShells + 2),
             vk::BufferUsageFlagBits::eIndirectBuffer);
    }
    if (balls_.bytes == 0 || sizes.splats > splat_capacity_ || sizes.billboards > billboard_capacity_)
        reserve_splats(gpu, std::max(splat_capacity_, whole_blocks(sizes.splats)),
                       std::max(billboard_capacity_, sizes.billboards));
    if (sizes.entries > entry_capacity_) reserve_entries(gpu, whole_blocks(sizes.entries));
    if (sizes.tiles > tile_capacity_) {
        tile_capacity_ = 0;
        make_storage(gpu, ranges_, sizes.tiles * sizeof(shader::TileRange));
        tile_capacity_ = sizes.tiles;
    }
    // Marks or entries of splats, digits of entries, items of the tiles of a shadow map.
    const std::size_t numbers = std::max({splat_capacity_, digits_in_table(entry_capacity_), tile_capacity_});
    if (numbers * kWord > table_.bytes || sums_.bytes == 0) {
        sums_ = {};
        make_storage(gpu, table_, numbers * kWord);
        make_storage(gpu, sums_, blocks_of(numbers) * kWord);
    }
}

const GpuBuffer& DeviceLists::list(std::size_t tiles) const {
    return entries_.values[OrderRecorder::end_of_sort(0, bits_of(tiles))];
}

Resources DeviceLists::resources() const {
    return {{1, counts_}, {2, cloud_},  {3, flash_},   {4, balls_}, {9, table_},
            {10, sums_},  {11, boxes_}, {12, ranges_}, {13, parts_}};
}

Resources DeviceLists::with_order(const Resources& resources, std::size_t from) const {
    Resources both = resources;
    both.set(order_.from(from));
    return both;
}

shader::OrderStep DeviceLists::step_of(const PicturePart& part, std::size_t shells) const {
    const TileGrid grid{part.width, part.height};
    return {.count = 0,
            .billboards = 0,
            .begin = 0,
            .end = 0,
            .table = shader::kSeenSplats,
            .shift = 0,
            .x = shader::uint(part.x),
            .y = shader::uint(part.y),
            .width = shader::uint(part.width),
            .height = shader::uint(part.height),
            .columns = shader::uint(grid.columns()),
            .tiles = shader::uint(grid.tiles()),
            .capacity = shader::uint(entry_capacity_),
            .shells = shader::uint(shells),
            .per_item = 0};
}

void DeviceLists::record_order(const OrderRecorder& recorder, const Resources& resources, std::size_t balls,
                               std::size_t billboards) const {
    shader::OrderStep step{};
    step.count = shader::uint(balls);
    step.billboards = shader::uint(billboards);
    step.table = shader::kAllSplats;
    const std::size_t each = (balls + billboards + shader::kSortGroup - 1) / shader::kSortGroup;
    recorder.run(OrderPass::cull, with_order(resources, 0), step, each);  // keys to buffer 1
    recorder.scan(resources, step);
    recorder.run(OrderPass::compact, with_order(resources, 1), step, each);  // from there to buffer 0
    recorder.run(OrderPass::plan, resources, step, 1);
    recorder.sort(resources, order_, 0, shader::kSeenDigits, 32);
    recorder.run_indirect(OrderPass::view, with_order(resources), step,
                          offsetof(shader::OrderCounts, visible_each));
}

void DeviceLists::record_batch(const OrderRecorder& recorder, const Resources& resources,
                               const shader::OrderStep& step) const {
    const std::uint32_t bits = bits_of(step.tiles);
    Resources all = with_order(resources);
    recorder.run_indirect(OrderPass::bins_count, all, step, offsetof(shader::OrderCounts, visible_each));
    recorder.scan(all, step);
    recorder.run(OrderPass::bins_plan, all, step, 1);
    all.set(entries_.from(1));  // to buffer 0
    recorder.run_indirect(OrderPass::emit, all, step, offsetof(shader::OrderCounts, entries_each));
    recorder.sort(all, entries_, 0, shader::kListDigits, bits);
    all.set(entries_.from(OrderRecorder::end_of_sort(0, bits)));
    recorder.run(OrderPass::ranges, all, step, (step.tiles + shader::kSortGroup - 1) / shader::kSortGroup);
}

}  // namespace nephos
