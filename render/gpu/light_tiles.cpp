// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/light_tiles.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <span>

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

LightTiles::LightTiles(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& unused,
                       const vk::raii::Sampler& sampler)
    : layout_(&layout),
      sampler_(&sampler),
      map_pipeline_(create_tile_pipeline(gpu, layout, shaders().light_map_comp)),
      centres_pipeline_(create_tile_pipeline(gpu, layout, shaders().light_centres_comp)),
      bindings_(create_bindings(gpu, layout)),
      listed_(create_bindings(gpu, layout)) {
    for (const Bindings* each : {&bindings_, &listed_})
        for (const std::uint32_t binding : {3u, 11u}) bind_image(gpu, *each, binding, unused, sampler);
}

void LightTiles::resize_map(const GpuDevice& gpu, int shadow_size) {
    const auto size = std::uint32_t(shadow_size);
    if (map_.width == size) return;
    map_ = {};
    map_ = create_image(gpu, size, size, 1, vk::Format::eR32Sfloat,
                        vk::ImageUsageFlagBits::eStorage | vk::ImageUsageFlagBits::eSampled |
                            vk::ImageUsageFlagBits::eTransferDst);
    depths_ = create_buffer(gpu, std::size_t{size} * size * sizeof(float),
                            vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eTransferSrc,
                            gpu.unified_memory ? HostAccess::read : HostAccess::none);
    for (const Bindings* each : {&bindings_, &listed_}) {
        bind_image(gpu, *each, 4, map_, *sampler_);
        bind_storage_image(gpu, *each, 10, map_);
        bind_buffer(gpu, *each, 8, depths_);
    }
    submit_and_wait(
        gpu, [&](const vk::raii::CommandBuffer& commands) { begin_image(commands, map_, access::compute); });
}

void LightTiles::use(const GpuDevice& gpu, std::span<const float> shadow, int shadow_size) {
    resize_map(gpu, shadow_size);
    const GpuBuffer staging =
        create_buffer(gpu, shadow.size_bytes(), vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
    write(gpu, staging, std::as_bytes(shadow));
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        image_barrier(commands, map_, access::sample, access::copy_to);
        const vk::BufferImageCopy region(0, 0, 0, {vk::ImageAspectFlagBits::eColor, 0, 0, 1}, {0, 0, 0},
                                         {map_.width, map_.height, 1});
        commands.copyBufferToImage(*staging.buffer, *map_.image, vk::ImageLayout::eGeneral, region);
        image_barrier(commands, map_, access::copy_to, access::sample);
    });
}

void LightTiles::upload_bins(const GpuDevice& gpu, const TileBins& bins) {
    upload(gpu, bindings_, 5, ranges_, std::as_bytes(std::span(bins.ranges)));
    upload(gpu, bindings_, 6, list_, std::as_bytes(std::span(bins.list)));
}

void LightTiles::draw_map(const GpuDevice& gpu, const TileGrid& grid, bool first, bool last) {
    shader::TileStep step = step_over(grid);
    step.first_batch = first;
    step.last_batch = last;
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        compute_barrier(commands);  // the batch before left its sums
        begin_compute(commands, *layout_, bindings_, map_pipeline_, step);
        image_barrier(commands, map_, access::sample, access::compute);
        dispatch_groups(commands, grid.tiles());
        buffer_barrier(commands, depths_, access::compute, access::host);
        image_barrier(commands, map_, access::compute, access::sample);
    });
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
        upload(gpu, bindings_, 1, queries_, std::as_bytes(asked));
        upload(gpu, bindings_, 7, items_, std::as_bytes(std::span(items)));
        shader::TileStep step = step_over(grid);
        step.tile_count = shader::uint(items.size());
        step.first_batch = step.last_batch = 0;
        step.largest_radius = order.largest_radius;
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            begin_compute(commands, *layout_, bindings_, centres_pipeline_, step);
            dispatch_groups(commands, items.size());
            buffer_barrier(commands, queries_, access::compute, access::host);
        });
        const std::byte* const answers = read_back(gpu, queries_, asked.size_bytes(), queries_copy_);
        std::memcpy(asked.data(), answers, asked.size_bytes());
    }
}

void LightTiles::use_lists(const GpuDevice& gpu, int shadow_size, const Lists& lists) {
    resize_map(gpu, shadow_size);
    const std::pair<std::uint32_t, const GpuBuffer*> buffers[] = {{1, lists.queries}, {2, lists.splats},
                                                                  {5, lists.ranges},  {6, lists.list},
                                                                  {7, lists.items},   {9, lists.places}};
    for (const auto& [binding, buffer] : buffers) bind_buffer(gpu, listed_, binding, *buffer);
}

void LightTiles::record_lists(const vk::raii::CommandBuffer& commands, const TileGrid& grid,
                              float largest_radius, std::size_t items, const GpuBuffer& arguments,
                              std::size_t offset) const {
    shader::TileStep step = step_over(grid);
    step.largest_radius = largest_radius;
    begin_compute(commands, *layout_, listed_, map_pipeline_, step);
    image_barrier(commands, map_, access::sample, access::compute);
    dispatch_groups(commands, grid.tiles());
    buffer_barrier(commands, depths_, access::compute, access::host);
    image_barrier(commands, map_, access::compute, access::sample);
    step.tile_count = shader::uint(items);
    begin_compute(commands, *layout_, listed_, centres_pipeline_, step);
    commands.dispatchIndirect(*arguments.buffer, offset);
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
        upload(gpu, bindings_, 2, splats_, std::as_bytes(splats));
        upload(gpu, bindings_, 9, places_,
               std::as_bytes(std::span(order.places).subspan(begin, end - begin)));
        upload_bins(gpu, bins);
        draw_map(gpu, grid, begin == 0, end == boxes.size());
        ask(gpu, order, grid, queries);
        begin = end;
    } while (begin < boxes.size());

    std::vector<float> depths(order.splats.size());
    for (std::size_t i = 0; i < depths.size(); ++i) depths[queries.source[i]] = queries.queries[i].depth;
    return depths;
}

}  // namespace nephos
