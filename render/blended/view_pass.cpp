// SPDX-License-Identifier: Apache-2.0
#include "render/blended/view_pass.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

namespace nephos {
namespace {

constexpr std::uint32_t kBatch = 1u << 20;  // metaballs, and billboards, on the device at once: 32 MiB each
constexpr std::array kFormats{vk::Format::eR32G32B32A32Sfloat, vk::Format::eR32Sfloat};

}  // namespace

ViewPass::ViewPass(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& attenuation,
                   const vk::raii::Sampler& sampler, const ShaderVariant& variant)
    : layout_(&layout),
      background_(create_graphics_pipeline(gpu, layout, shaders().background_vert, shaders().background_frag,
                                           kFormats, Blend::none, variant)),
      splat_(create_graphics_pipeline(gpu, layout, shaders().view_splat_vert, shaders().view_splat_frag,
                                      kFormats, Blend::over, variant)),
      integrated_splat_(create_graphics_pipeline(gpu, layout, shaders().view_splat_vert,
                                                 shaders().view_splat_frag, kFormats, Blend::over,
                                                 {true, variant.physical_sky, variant.shells, variant.fog})),
      shell_(variant.shells ? create_graphics_pipeline(gpu, layout, shaders().shell_vert,
                                                       shaders().shell_frag, kFormats, Blend::over, variant)
                            : nullptr),
      bindings_(create_bindings(gpu, layout)),
      frame_(create_buffer(gpu, sizeof(shader::Frame), vk::BufferUsageFlagBits::eUniformBuffer,
                           HostAccess::write)),
      balls_(create_buffer(gpu, kBatch * sizeof(shader::ViewBall), vk::BufferUsageFlagBits::eStorageBuffer,
                           HostAccess::write)),
      billboards_(gpu, layout, kFormats, frame_, variant),
      shells_(gpu, bindings_) {
    bind_buffer(gpu, bindings_, 0, frame_);
    bind_buffer(gpu, bindings_, 1, balls_);
    for (const std::uint32_t binding : {3u, 11u}) bind_image(gpu, bindings_, binding, attenuation, sampler);
}

void ViewPass::use_sky(const GpuDevice& gpu, const GpuImage& tables, const vk::raii::Sampler& sampler) {
    bind_image(gpu, bindings_, 11, tables, sampler);
    billboards_.use_sky(gpu, tables, sampler);
}

void ViewPass::use_shadow_map(const GpuDevice& gpu, const GpuImage& map, const vk::raii::Sampler& sampler) {
    bind_image(gpu, bindings_, 4, map, sampler);
}

void ViewPass::use_shells(const GpuDevice& gpu, const AirShells& shells, const ViewSortedSplats& order) {
    shells_.use(gpu, bindings_, shells);
    billboards_.use_shells(gpu, shells);
    runs_ = runs_between_shells(shells, order);
}

void ViewPass::use_scattering(const GpuDevice& gpu, const GpuBuffer& table) {
    bind_buffer(gpu, bindings_, 12, table);
    billboards_.use_scattering(gpu, table);
}

void ViewPass::resize_targets(const GpuDevice& gpu, const Tile& tile) {
    const std::uint32_t width = std::uint32_t(tile.width), height = std::uint32_t(tile.height);
    if (radiance_.width >= width && radiance_.height >= height) return;
    using Usage = vk::ImageUsageFlagBits;
    const auto target = [&](vk::Format format) {
        return create_image(gpu, width, height, 1, format, Usage::eColorAttachment | Usage::eTransferSrc);
    };
    radiance_ = {};  // the old ones go before the new ones come
    depth_ = {};
    radiance_ = target(kFormats[0]);
    depth_ = target(kFormats[1]);
    const std::size_t pixels = std::size_t(width) * height;
    const auto pixel_buffer = [&](std::size_t bytes) {
        return create_buffer(gpu, bytes, vk::BufferUsageFlagBits::eTransferDst, HostAccess::read);
    };
    radiance_pixels_ = pixel_buffer(pixels * 4 * sizeof(float));
    depth_pixels_ = pixel_buffer(pixels * sizeof(float));
}

void ViewPass::bind(const vk::raii::CommandBuffer& commands, const vk::raii::Pipeline& pipeline) const {
    commands.bindPipeline(vk::PipelineBindPoint::eGraphics, *pipeline);
    commands.bindDescriptorSets(vk::PipelineBindPoint::eGraphics, *layout_->layout, 0, bindings_.set, {});
}

void ViewPass::draw_background(const GpuDevice& gpu, vk::Extent2D area) const {
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        begin_image(commands, radiance_, access::draw);
        begin_image(commands, depth_, access::draw);
        bind(commands, background_);
        const std::array<const GpuImage*, 2> targets{&radiance_, &depth_};
        draw_into(commands, targets, area, vk::AttachmentLoadOp::eDontCare,
                  [&] { commands.draw(3, 1, 0, 0); });
    });
}

// Cuts the runs into batches that fit into the buffers.
void ViewPass::draw_splats(const GpuDevice& gpu, vk::Extent2D area, const ViewSortedSplats& order) {
    if (!order.runs.empty()) billboards_.use_clouds(gpu, order.clouds);
    std::vector<Run> batch;
    std::uint32_t balls = 0, billboards = 0;
    for (Run run : runs_.empty() ? order.runs : runs_) {
        if (run.kind == SplatKind::shell) {
            batch.push_back(run);
            continue;
        }
        std::uint32_t& used = run.kind == SplatKind::billboard ? billboards : balls;
        while (run.begin < run.end) {
            if (used == kBatch) {
                draw_batch(gpu, area, order, batch);
                batch.clear();
                balls = billboards = 0;
            }
            const std::uint32_t end = std::min(run.end, run.begin + (kBatch - used));
            batch.push_back({run.begin, end, run.kind});
            used += end - run.begin;
            run.begin = end;
        }
    }
    if (!batch.empty()) draw_batch(gpu, area, order, batch);
}

void ViewPass::draw_batch(const GpuDevice& gpu, vk::Extent2D area, const ViewSortedSplats& order,
                          std::span<const Run> runs) {
    Run balls, billboards;  // the consecutive ones of this batch
    for (const Run& run : runs) {
        if (run.kind == SplatKind::shell) continue;
        Run& all = run.kind == SplatKind::billboard ? billboards : balls;
        if (all.begin == all.end) all.begin = run.begin;
        all.end = run.end;
    }
    if (balls.begin < balls.end) {
        const std::size_t bytes = (balls.end - balls.begin) * sizeof(shader::ViewBall);
        write(gpu, balls_,
              std::as_bytes(std::span(order.balls)).subspan(balls.begin * sizeof(shader::ViewBall), bytes));
    }
    billboards_.use_billboards(
        gpu, std::span(order.billboards).subspan(billboards.begin, billboards.end - billboards.begin));
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        image_barrier(commands, radiance_, access::draw, access::draw);
        image_barrier(commands, depth_, access::draw, access::draw);
        const std::array<const GpuImage*, 2> targets{&radiance_, &depth_};
        draw_into(commands, targets, area, vk::AttachmentLoadOp::eLoad, [&] {
            for (const Run& run : runs) {
                const std::uint32_t count = run.end - run.begin;
                if (run.kind == SplatKind::billboard) {
                    billboards_.draw(commands, run.begin - billboards.begin, count, order.depth);
                } else if (run.kind == SplatKind::shell) {
                    bind(commands, shell_);
                    commands.draw(3, 1, 0, run.begin);
                } else {
                    bind(commands, run.kind == SplatKind::metaball ? splat_ : integrated_splat_);
                    commands.draw(6 * count, 1, 6 * (run.begin - balls.begin), 0);
                }
            }
        });
    });
}

void ViewPass::read_back(const GpuDevice& gpu, vk::Extent2D area) const {
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        const vk::BufferImageCopy region(0, 0, 0, {vk::ImageAspectFlagBits::eColor, 0, 0, 1}, {0, 0, 0},
                                         {area.width, area.height, 1});
        const auto copy = [&](const GpuImage& image, const GpuBuffer& buffer) {
            image_barrier(commands, image, access::draw, access::copy_from);
            commands.copyImageToBuffer(*image.image, vk::ImageLayout::eGeneral, *buffer.buffer, region);
            buffer_barrier(commands, buffer, access::copy_to, access::host);
        };
        copy(radiance_, radiance_pixels_);
        copy(depth_, depth_pixels_);
    });
}

void ViewPass::draw_tile(const GpuDevice& gpu, const shader::Frame& frame, const Tile& tile,
                         const ViewSortedSplats& order, Picture& picture) {
    resize_targets(gpu, tile);
    write(gpu, frame_, frame);
    const vk::Extent2D area{std::uint32_t(tile.width), std::uint32_t(tile.height)};
    draw_background(gpu, area);
    draw_splats(gpu, area, order);
    read_back(gpu, area);
    store_tile(reinterpret_cast<const float*>(radiance_pixels_.mapped),
               order.depth ? reinterpret_cast<const float*>(depth_pixels_.mapped) : nullptr, tile, picture);
}

}  // namespace nephos
