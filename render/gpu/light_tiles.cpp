// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/light_tiles.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <utility>

#include "render/frame/tile_bins.h"

namespace nephos {
namespace {

constexpr std::size_t kMaxSplats = std::size_t{1} << 20;   // on the device at once: 32 MiB
constexpr std::size_t kMaxEntries = std::size_t{1} << 24;  // of their lists: 64 MiB
constexpr std::size_t kMaxQueries = std::size_t{1} << 20;

// Entries that a tile's list may have at once. lavapipe (Mesa 22.3) leaves all loops of a shader after 65,535
// turns in all: eight metaballs take one where lanes hand them round (kShared), else nine.
std::size_t longest_list(const GpuDevice& gpu) {
    if (gpu.properties.deviceType != vk::PhysicalDeviceType::eCpu) return kMaxEntries;
    return gpu.tiles_are_subgroups ? 500'000 : 50'000;
}

}  // namespace

// All centres, tile by tile, and in each tile in order from the sun.
struct LightTiles::Queries {
    std::vector<shader::LightQuery> queries;
    std::vector<std::uint32_t> source;  // index into the order
    std::vector<shader::LightItem> items;

    Queries(const LightSortedSplats& order, const TileGrid& grid, std::uint32_t per_item) {
        const TileBins bins = bin_centres(order.splats, grid);
        source = bins.list;
        queries.reserve(source.size());
        for (const std::uint32_t i : source)
            queries.push_back({order.splats[i].x, order.splats[i].y, order.places[i].z, 0.0f});
        for (std::uint32_t tile = 0; tile < bins.ranges.size(); ++tile) {
            const shader::TileRange range = bins.ranges[tile];
            for (std::uint32_t first = range.begin; first < range.end; first += per_item)
                items.push_back({tile, first, std::min(per_item, range.end - first), 0});
        }
    }
};

LightTiles::LightTiles(const GpuDevice& gpu)
    : map_pipeline_(create_tile_pipeline(gpu, shaders().light_map_comp)),
      centres_pipeline_(create_tile_pipeline(gpu, shaders().light_centres_comp)),
      sets_(gpu) {}

void LightTiles::resize_map(const GpuDevice& gpu, int shadow_size) {
    const auto size = std::uint32_t(shadow_size);
    if (map_.width == size) return;
    map_ = {};
    GpuImage map = create_image(gpu, size, size, 1, vk::Format::eR32Sfloat,
                                vk::ImageUsageFlagBits::eStorage | vk::ImageUsageFlagBits::eSampled |
                                    vk::ImageUsageFlagBits::eTransferDst);
    depths_ = create_buffer(gpu, std::size_t{size} * size * sizeof(float),
                            vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eTransferSrc,
                            gpu.unified_memory ? HostAccess::read : HostAccess::none);
    submit_and_wait(
        gpu, [&](const vk::raii::CommandBuffer& commands) { begin_image(commands, map, access::compute); });
    map_ = std::move(map);  // all of it is there
}

void LightTiles::use(const GpuDevice& gpu, std::span<const float> shadow, int shadow_size) {
    resize_map(gpu, shadow_size);
    upload_image(gpu, map_, std::as_bytes(shadow));
}

void LightTiles::record_map(const vk::raii::CommandBuffer& commands, DescriptorSets& sets,
                            const Resources& resources, const TileGrid& grid, const Batch& batch) const {
    shader::TileStep step = step_over(grid);
    step.first_batch = batch.first;
    step.last_batch = batch.last;
    const Resources all = resources.with({{8, depths_}, {10, map_}});
    begin_compute(commands, map_pipeline_, sets.fill(map_pipeline_, all), step);
    image_barrier(commands, map_, access::sample, access::compute);
    dispatch_groups(commands, grid.tiles());
    buffer_barrier(commands, depths_, access::compute, access::host);
    image_barrier(commands, map_, access::compute, access::sample);
}

void LightTiles::record(const vk::raii::CommandBuffer& commands, DescriptorSets& sets,
                        const Resources& resources, const TileGrid& grid, const Batch& batch,
                        std::size_t items, const GpuBuffer& arguments, std::size_t offset) const {
    record_map(commands, sets, resources, grid, batch);
    shader::TileStep step = step_over(grid);
    step.largest_radius = batch.largest_radius;
    step.tile_count = shader::uint(items);
    begin_compute(commands, centres_pipeline_, sets.fill(centres_pipeline_, resources), step);
    commands.dispatchIndirect(*arguments.buffer, offset);
}

// Adds what the splats on the device take from the light of all centres.
void LightTiles::ask(const GpuDevice& gpu, const LightSortedSplats& order, const TileGrid& grid,
                     Queries& queries) {
    for (std::size_t begin = 0; begin < queries.items.size();) {
        const std::uint32_t first = queries.items[begin].first;
        std::vector<shader::LightItem> items;
        std::uint32_t end = first;
        for (; begin < queries.items.size() && end - first < kMaxQueries; ++begin) {
            shader::LightItem item = queries.items[begin];
            end = item.first + item.count;
            item.first -= first;
            items.push_back(item);
        }
        const std::span asked = std::span(queries.queries).subspan(first, end - first);
        upload(gpu, queries_, std::as_bytes(asked));
        upload(gpu, items_, std::as_bytes(std::span(items)));
        shader::TileStep step = step_over(grid);
        step.tile_count = shader::uint(items.size());
        step.largest_radius = order.largest_radius;
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            const Resources all{{1, queries_}, {2, splats_}, {5, ranges_},
                                {6, list_},    {7, items_},  {9, places_}};
            begin_compute(commands, centres_pipeline_, sets_.fill(centres_pipeline_, all), step);
            dispatch_groups(commands, items.size());
            buffer_barrier(commands, queries_, access::compute, access::host);
        });
        const std::byte* const answers = read_back(gpu, queries_, asked.size_bytes(), queries_copy_);
        std::memcpy(asked.data(), answers, asked.size_bytes());
    }
}

void LightTiles::read_map(const GpuDevice& gpu, std::vector<float>& shadow) {
    shadow.resize(std::size_t(map_.width) * map_.height);
    const std::size_t bytes = shadow.size() * sizeof(float);
    std::memcpy(shadow.data(), read_back(gpu, depths_, bytes, depths_copy_), bytes);
}

std::vector<float> LightTiles::run(const GpuDevice& gpu, const LightSortedSplats& order, int shadow_size) {
    resize_map(gpu, shadow_size);
    const TileGrid grid{shadow_size, shadow_size};
    const std::vector<PixelBox> boxes = light_boxes(order.splats);
    Queries queries(order, grid, shader::kQueriesPerLane * gpu.tile_lanes);
    std::size_t begin = 0;
    do {  // once even without any splat: the map is then all light
        std::size_t end = end_of_batch(boxes, begin, grid, kMaxSplats, kMaxEntries);
        const TileBins bins = bin_batch(boxes, begin, end, grid, longest_list(gpu));
        const std::span splats = std::span(order.splats).subspan(begin, end - begin);
        upload(gpu, splats_, std::as_bytes(splats));
        upload(gpu, places_, std::as_bytes(std::span(order.places).subspan(begin, end - begin)));
        upload(gpu, ranges_, std::as_bytes(std::span(bins.ranges)));
        upload(gpu, list_, std::as_bytes(std::span(bins.list)));
        sets_.reset();
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            compute_barrier(commands);  // the batch before left its sums
            record_map(commands, sets_, {{2, splats_}, {5, ranges_}, {6, list_}}, grid,
                       {.first = begin == 0, .last = end == boxes.size()});
        });
        ask(gpu, order, grid, queries);
        begin = end;
    } while (begin < boxes.size());

    std::vector<float> depths(order.splats.size());
    for (std::size_t i = 0; i < depths.size(); ++i) depths[queries.source[i]] = queries.queries[i].depth;
    return depths;
}

}  // namespace nephos
