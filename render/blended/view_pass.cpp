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

ShaderVariant exactly(ShaderVariant variant) {
    variant.exact = true;
    return variant;
}

}  // namespace

ViewPass::ViewPass(const GpuDevice& gpu, const ShaderVariant& variant)
    : background_(create_graphics_pipeline(gpu, shaders().background_vert, shaders().background_frag,
                                           kFormats, Blend::none, variant)),
      splat_(create_graphics_pipeline(gpu, shaders().view_splat_vert, shaders().view_splat_frag, kFormats,
                                      Blend::over, variant)),
      integrated_splat_(create_graphics_pipeline(gpu, shaders().view_splat_vert, shaders().view_splat_frag,
                                                 kFormats, Blend::over,
                                                 exactly(variant))),
      sets_(gpu),
      frame_(create_buffer(gpu, sizeof(shader::FrameUniforms), vk::BufferUsageFlagBits::eUniformBuffer,
                           HostAccess::write)),
      balls_(create_buffer(gpu, kBatch * sizeof(shader::ViewBall), vk::BufferUsageFlagBits::eStorageBuffer,
                           HostAccess::write)),
      billboards_(gpu, kFormats, variant),
      shells_(gpu) {
    if (variant.shells)
        shell_ = create_graphics_pipeline(gpu, shaders().shell_vert, shaders().shell_frag, kFormats,
                                          Blend::over, variant);
    use_terrain(gpu, {});
    resources_.set({{0, frame_}, {1, balls_}, {13, shells_.shells()}, {14, shells_.shade()}});
}

void ViewPass::use(const Resources& resources) { resources_.set(resources); }

void ViewPass::use_shells(const GpuDevice& gpu, const AirShells& shells, const ViewSortedSplats& order) {
    shells_.use(gpu, shells);
    resources_.set({{14, shells_.shade()}});
    runs_ = runs_between_shells(shells, order);
}

void ViewPass::use_terrain(const GpuDevice& gpu, std::span<const float> distance_m) {
    upload_terrain(gpu, terrain_, distance_m);
    resources_.set({{23, terrain_}});
}

void ViewPass::resize_targets(const GpuDevice& gpu, const PicturePart& part) {
    const std::uint32_t width = std::uint32_t(part.width), height = std::uint32_t(part.height);
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

void ViewPass::draw_background(const GpuDevice& gpu, vk::Extent2D area) {
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        begin_image(commands, radiance_, access::draw);
        begin_image(commands, depth_, access::draw);
        bind(commands, vk::PipelineBindPoint::eGraphics, background_, sets_.fill(background_, resources_));
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
        gpu, std::span(order.billboards).subspan(billboards.begin, billboards.end - billboards.begin), order.pictures);
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        image_barrier(commands, radiance_, access::draw, access::draw);
        image_barrier(commands, depth_, access::draw, access::draw);
        const std::array<const GpuImage*, 2> targets{&radiance_, &depth_};
        const vk::DescriptorSet splats = sets_.fill(splat_, resources_),
                                integrated_splats = sets_.fill(integrated_splat_, resources_),
                                air = shell_.exists() ? sets_.fill(shell_, resources_) : vk::DescriptorSet();
        const vk::DescriptorSet textured =
            billboards.begin < billboards.end ? billboards_.fill(sets_, resources_) : vk::DescriptorSet();
        const auto use = [&](const Pipeline& pipeline, vk::DescriptorSet set) {
            bind(commands, vk::PipelineBindPoint::eGraphics, pipeline, set);
        };
        draw_into(commands, targets, area, vk::AttachmentLoadOp::eLoad, [&] {
            for (const Run& run : runs) {
                const std::uint32_t count = run.end - run.begin;
                if (run.kind == SplatKind::billboard) {
                    use(billboards_.pipeline(order.depth), textured);
                    commands.draw(6 * count, 1, 6 * (run.begin - billboards.begin), 0);
                } else if (run.kind == SplatKind::shell) {
                    use(shell_, air);
                    commands.draw(3, 1, 0, run.begin);
                } else {
                    const bool textures = run.kind == SplatKind::metaball;
                    use(textures ? splat_ : integrated_splat_, textures ? splats : integrated_splats);
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

void ViewPass::draw_part(const GpuDevice& gpu, const shader::FrameUniforms& frame, const PicturePart& part,
                         const ViewSortedSplats& order, Picture& picture) {
    resize_targets(gpu, part);
    write(gpu, frame_, frame);
    sets_.reset();
    const vk::Extent2D area{std::uint32_t(part.width), std::uint32_t(part.height)};
    draw_background(gpu, area);
    draw_splats(gpu, area, order);
    read_back(gpu, area);
    store_part(reinterpret_cast<const float*>(radiance_pixels_.mapped),
               order.depth ? reinterpret_cast<const float*>(depth_pixels_.mapped) : nullptr, part, picture);
}

}  // namespace nephos
