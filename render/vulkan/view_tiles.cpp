// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/view_tiles.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>

#include "render/frame/frame_data.h"
#include "render/frame/screen_box.h"
#include "render/gpu/frame_uploads.h"

namespace nephos {
namespace {

constexpr std::size_t kMaxBalls = std::size_t{1} << 20;    // on the device at once: 52 MiB with their splats
constexpr std::size_t kMaxEntries = std::size_t{1} << 24;  // of the tiles' lists: 64 MiB

// Entries that a tile's list may have at once. lavapipe (Mesa 22.3) leaves all loops of a shader after 65,535
// turns in all: eight fitted metaballs take one where lanes hand them round (kShared), else nine; of others
// each takes more than one, and where there are billboards up to three.
std::size_t longest_list(const GpuDevice& gpu, const ViewSortedSplats& order) {
    if (gpu.properties.deviceType != vk::PhysicalDeviceType::eCpu) return kMaxEntries;
    if (!order.billboards.empty()) return 20'000;
    return order.all_fitted && gpu.tiles_are_subgroups ? 500'000 : 50'000;
}

std::size_t groups(std::size_t invocations) {
    return (invocations + shader::kComputeGroup - 1) / shader::kComputeGroup;
}

}  // namespace

ViewTiles::ViewTiles(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& unused,
                     const vk::raii::Sampler& sampler, const ShaderVariant& variant)
    : layout_(&layout),
      variant_(variant),
      project_(create_compute_pipeline(gpu, layout, shaders().view_project_comp, variant)),
      finish_(create_compute_pipeline(gpu, layout, shaders().view_finish_comp, variant)),
      between_(variant.shells ? create_compute_pipeline(gpu, layout, shaders().view_shells_comp, variant)
                              : nullptr),
      bindings_(create_bindings(gpu, layout)),
      frame_(create_buffer(gpu, sizeof(shader::Frame), vk::BufferUsageFlagBits::eUniformBuffer,
                           HostAccess::write)),
      no_parts_(create_buffer(gpu, sizeof(shader::uint), vk::BufferUsageFlagBits::eStorageBuffer,
                              HostAccess::none)),
      shells_(gpu, bindings_) {
    bind_buffer(gpu, bindings_, 0, frame_);
    bind_buffer(gpu, bindings_, 15, no_parts_);
    for (const std::uint32_t binding : {3u, 11u}) bind_image(gpu, bindings_, binding, unused, sampler);
    if (!variant.billboards) return;
    billboard_textures_ = upload_billboard_textures(gpu);
    bind_image(gpu, bindings_, 3, billboard_textures_, sampler);
}

void ViewTiles::use_sky(const GpuDevice& gpu, const GpuImage& tables, const vk::raii::Sampler& sampler) {
    bind_image(gpu, bindings_, 11, tables, sampler);
}

void ViewTiles::use_shadow_map(const GpuDevice& gpu, const GpuImage& map, const vk::raii::Sampler& sampler) {
    bind_image(gpu, bindings_, 4, map, sampler);
}

void ViewTiles::use_shells(const GpuDevice& gpu, const AirShells& shells, const ViewSortedSplats& order) {
    shells_.use(gpu, bindings_, shells);
    before_shells_ = splats_before_shells(shells, order);
}

void ViewTiles::use_scattering(const GpuDevice& gpu, const GpuBuffer& table) {
    bind_buffer(gpu, bindings_, 12, table);
}

const vk::raii::Pipeline& ViewTiles::tiles_for(const GpuDevice& gpu, const ViewSortedSplats& order) {
    const bool mixed = !order.all_fitted || variant_.billboards;
    vk::raii::Pipeline& pipeline = tiles_[mixed ? 1 : 0][order.depth ? 1 : 0];
    if (!*pipeline)
        pipeline =
            create_tile_pipeline(gpu, *layout_, shaders().view_tiles_comp, {mixed, order.depth}, variant_);
    return pipeline;
}

// Splats up to the next shell, that shell and those that follow at once, splats again. `step` has the tiles.
void ViewTiles::draw_between_shells(const vk::raii::CommandBuffer& commands, const vk::raii::Pipeline& tiles,
                                    const shader::TileStep& step, std::size_t begin, std::size_t end,
                                    bool last) {
    const std::size_t shells = before_shells_.size();
    shader::TileStep own = step;
    for (std::size_t at = begin;;) {
        const bool shell_follows = next_shell_ < shells && (last || before_shells_[next_shell_] < end);
        const std::size_t until =
            shell_follows ? std::max<std::size_t>(at, before_shells_[next_shell_]) : end;
        own.first = shader::uint(at - begin);
        own.end = shader::uint(until - begin);
        begin_compute(commands, *layout_, bindings_, tiles, own);
        dispatch_groups(commands, step.tile_count);
        compute_barrier(commands);
        own.first_batch = false;
        if (!shell_follows) return;
        own.first = shader::uint(next_shell_);
        while (next_shell_ < shells && before_shells_[next_shell_] <= until) ++next_shell_;
        own.end = shader::uint(next_shell_);
        begin_compute(commands, *layout_, bindings_, between_, own);
        dispatch_groups(commands, groups(std::size_t(step.width) * step.height));
        compute_barrier(commands);
        at = until;
        if (at == end && next_shell_ == shells) return;
    }
}

void ViewTiles::draw_batch(const GpuDevice& gpu, const TileGrid& grid, const ViewSortedSplats& order,
                           std::size_t begin, std::size_t end) {
    const bool last = end == order.balls.size() + order.billboards.size();
    shader::TileStep step = step_over(grid);
    step.tile_count = shader::uint(end - begin);
    step.first_batch = begin == 0;
    step.last_batch = last;
    step.distances = order.depth;
    const vk::raii::Pipeline& tiles = tiles_for(gpu, order);
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        begin_compute(commands, *layout_, bindings_, project_, step);
        dispatch_groups(commands, groups(end - begin));
        compute_barrier(commands);
        step.tile_count = shader::uint(grid.tiles());
        if (variant_.shells) {
            draw_between_shells(commands, tiles, step, begin, end, last);
        } else {
            begin_compute(commands, *layout_, bindings_, tiles, step);
            dispatch_groups(commands, grid.tiles());
            compute_barrier(commands);
        }
        if (last) {
            begin_compute(commands, *layout_, bindings_, finish_, step);
            dispatch_groups(commands, groups(std::size_t(grid.width) * std::size_t(grid.height)));
        }
        buffer_barrier(commands, radiance_, access::compute, access::host);
        buffer_barrier(commands, depth_, access::compute, access::host);
    });
}

void ViewTiles::upload_splats(const GpuDevice& gpu, const ViewSortedSplats& order,
                              std::span<const std::uint32_t> splats) {
    static_assert(sizeof(shader::ViewBillboard) == sizeof(shader::ViewBall) &&
                  sizeof(shader::ViewCloud) == sizeof(shader::ViewBall));
    std::vector<shader::ViewBall> all;
    all.reserve(splats.size() + (variant_.billboards ? order.clouds.size() : 0));
    for (const std::uint32_t splat : splats) {
        if ((splat & kBillboardSplat) == 0) {
            all.push_back(order.balls[splat]);
        } else {
            shader::ViewBillboard billboard = order.billboards[splat & ~kBillboardSplat];
            billboard.cloud = billboard.cloud << 4 | shader::kBillboardFlag;
            all.push_back(std::bit_cast<shader::ViewBall>(billboard));
        }
    }
    if (variant_.billboards)
        for (const shader::ViewCloud& cloud : order.clouds)
            all.push_back(std::bit_cast<shader::ViewBall>(cloud));
    upload(gpu, bindings_, 1, balls_, std::as_bytes(std::span(all)));
}

void ViewTiles::draw_tile(const GpuDevice& gpu, const RenderOptions& options, const CameraFrame& camera,
                          const shader::Frame& frame, const Tile& tile, const ViewSortedSplats& order,
                          Picture& picture) {
    write(gpu, frame_, frame);
    const TileGrid grid{tile.width, tile.height};
    const std::size_t pixels = std::size_t(tile.width) * std::size_t(tile.height);
    // Shells of air read them again and again.
    const HostAccess sums = gpu.unified_memory ? HostAccess::read : HostAccess::none;
    const std::size_t depth_bytes = sizeof(float) * pixels, radiance_bytes = 4 * depth_bytes;
    reserve(gpu, bindings_, 8, radiance_, radiance_bytes, sums);
    reserve(gpu, bindings_, 9, depth_, depth_bytes, sums);

    const std::vector<std::uint32_t> splats = splats_near_to_far(order);
    const std::vector<PixelBox> boxes = screen_boxes(order, camera, options.camera, tile, splats);
    std::size_t begin = 0;
    next_shell_ = 0;
    do {  // once even without any ball, for the background
        std::size_t end = end_of_batch(boxes, begin, grid, kMaxBalls, kMaxEntries);
        const TileBins bins = bin_batch(boxes, begin, end, grid, longest_list(gpu, order));
        const std::size_t count = end - begin;
        upload_splats(gpu, order, std::span(splats).subspan(begin, count));
        reserve(gpu, bindings_, 2, splats_, sizeof(shader::ViewSplat) * count * (variant_.billboards ? 5 : 1),
                HostAccess::none);
        reserve(gpu, bindings_, 7, tails_, sizeof(shader::uint) * count, HostAccess::none);
        upload(gpu, bindings_, 5, ranges_, std::as_bytes(std::span(bins.ranges)));
        upload(gpu, bindings_, 6, list_, std::as_bytes(std::span(bins.list)));
        draw_batch(gpu, grid, order, begin, end);
        begin = end;
    } while (begin < boxes.size());
    const std::byte* const radiance = read_back(gpu, radiance_, radiance_bytes, radiance_copy_);
    const std::byte* const depth = order.depth ? read_back(gpu, depth_, depth_bytes, depth_copy_) : nullptr;
    store_tile(reinterpret_cast<const float*>(radiance), reinterpret_cast<const float*>(depth), tile,
               picture);
}

}  // namespace nephos
