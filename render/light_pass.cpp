// SPDX-License-Identifier: Apache-2.0
#include "render/light_pass.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "render/vector_math.h"

namespace nephos {
namespace {

constexpr std::size_t kBatch = std::size_t(1) << 20;  // metaballs on the device at once: 32 MiB
constexpr vk::Format kFormat = vk::Format::eR32Sfloat;

}  // namespace

// Slabs [first, last) of the order, with their metaballs.
struct LightPass::Batch {
    std::span<const shader::LightBall> balls;
    std::vector<Slab> slabs;  // relative to balls
    shader::LightStep step{};
};

LightPass::LightPass(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& attenuation,
                     const vk::raii::Sampler& sampler)
    : layout_(&layout),
      sampler_(&sampler),
      splat_(create_graphics_pipeline(gpu, layout, shaders().light_splat_vert, shaders().light_splat_frag,
                                      std::array{kFormat}, Blend::multiply)),
      dense_splat_(create_graphics_pipeline(gpu, layout, shaders().light_splat_vert,
                                            shaders().light_splat_frag, std::array{kFormat}, Blend::multiply,
                                            true)),
      sample_(create_compute_pipeline(gpu, layout, shaders().light_sample_comp)),
      bindings_(create_bindings(gpu, layout)),
      balls_(create_buffer(gpu, kBatch * sizeof(shader::LightBall), vk::BufferUsageFlagBits::eStorageBuffer,
                           HostAccess::write)),
      light_(create_buffer(gpu, kBatch * sizeof(float), vk::BufferUsageFlagBits::eStorageBuffer,
                           HostAccess::read)) {
    bind_buffer(gpu, bindings_, 1, balls_);
    bind_buffer(gpu, bindings_, 2, light_);
    bind_image(gpu, bindings_, 3, attenuation, sampler);
}

void LightPass::resize_map(const GpuDevice& gpu, int shadow_size) {
    const std::uint32_t size = std::uint32_t(shadow_size);
    if (map_.width != size) {
        using Usage = vk::ImageUsageFlagBits;
        map_ = create_image(
            gpu, size, size, 1, kFormat,
            Usage::eColorAttachment | Usage::eSampled | Usage::eTransferSrc | Usage::eTransferDst);
        bind_image(gpu, bindings_, 4, map_, *sampler_);
    }
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        begin_image(commands, map_, access::draw);
        const std::array<const GpuImage*, 1> attachments{&map_};
        draw_into(commands, attachments, {size, size}, vk::AttachmentLoadOp::eClear, [] {});
    });
}

void LightPass::use(const GpuDevice& gpu, std::span<const float> shadow, int shadow_size) {
    resize_map(gpu, shadow_size);
    const GpuBuffer staging =
        create_buffer(gpu, shadow.size_bytes(), vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
    std::memcpy(staging.mapped, shadow.data(), shadow.size_bytes());
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        image_barrier(commands, map_, access::draw, access::copy_to);
        const vk::BufferImageCopy region(0, 0, 0, {vk::ImageAspectFlagBits::eColor, 0, 0, 1}, {0, 0, 0},
                                         {map_.width, map_.height, 1});
        commands.copyBufferToImage(*staging.buffer, *map_.image, vk::ImageLayout::eGeneral, region);
        image_barrier(commands, map_, access::copy_to, access::sample_in_fragment);
    });
}

std::vector<float> LightPass::run(const GpuDevice& gpu, const SunOrder& order, const ShadowFrame& frame,
                                  int shadow_size) {
    resize_map(gpu, shadow_size);
    const double width = length(frame.u_axis_m), height = length(frame.v_axis_m);
    Batch batch;
    batch.step.clip_per_metre_u = float(2.0 / width);
    batch.step.clip_per_metre_v = float(2.0 / height);
    batch.step.min_radius_u = shader::kMinRadiusPixels * float(width / shadow_size);
    batch.step.min_radius_v = shader::kMinRadiusPixels * float(height / shadow_size);

    std::vector<float> light(order.balls.size());
    std::size_t begin = 0;
    const auto flush = [&](std::size_t end) {
        batch.balls = std::span(order.balls).subspan(begin, end - begin);
        if (!batch.slabs.empty()) run_batch(gpu, batch, std::span(light).subspan(begin, end - begin));
        batch.slabs.clear();
        begin = end;
    };
    // A batch ends at a slab's end where it can; a slab larger than a batch is cut, and its second part sees
    // the first.
    for (const Slab& slab : order.slabs) {
        if (slab.end - begin > kBatch) flush(slab.begin);
        for (std::size_t from = slab.begin; from < slab.end;) {
            const std::size_t to = std::min<std::size_t>(slab.end, from + kBatch);
            const std::size_t dense = std::clamp<std::size_t>(slab.dense, from, to);
            batch.slabs.push_back(
                {std::uint32_t(from - begin), std::uint32_t(dense - begin), std::uint32_t(to - begin)});
            if (to < slab.end) flush(to);
            from = to;
        }
    }
    flush(order.balls.size());
    return light;
}

void LightPass::run_batch(const GpuDevice& gpu, const Batch& batch, std::span<float> light) {
    std::memcpy(balls_.mapped, batch.balls.data(), batch.balls.size_bytes());
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) { record(commands, batch); });
    std::memcpy(light.data(), light_.mapped, light.size_bytes());
}

void LightPass::record(const vk::raii::CommandBuffer& commands, const Batch& batch) const {
    constexpr vk::ShaderStageFlags kAll = vk::ShaderStageFlagBits::eVertex |
                                          vk::ShaderStageFlagBits::eFragment |
                                          vk::ShaderStageFlagBits::eCompute;
    for (const auto point : {vk::PipelineBindPoint::eGraphics, vk::PipelineBindPoint::eCompute})
        commands.bindDescriptorSets(point, *layout_->layout, 0, bindings_.set, {});
    commands.bindPipeline(vk::PipelineBindPoint::eCompute, *sample_);
    commands.pushConstants<shader::LightStep>(*layout_->layout, kAll, 0, batch.step);

    const std::array<const GpuImage*, 1> attachments{&map_};
    const auto sample = [&](std::uint32_t first, std::uint32_t middle, std::uint32_t end) {
        const std::array<std::uint32_t, 3> range{first, middle, end};
        commands.pushConstants<std::uint32_t>(*layout_->layout, kAll, offsetof(shader::LightStep, first),
                                              range);
        commands.dispatch((end - first + shader::kComputeGroup - 1) / shader::kComputeGroup, 1, 1);
    };
    const auto draw = [&](const vk::raii::Pipeline& pipeline, std::uint32_t begin, std::uint32_t end) {
        if (begin == end) return;
        commands.bindPipeline(vk::PipelineBindPoint::eGraphics, *pipeline);
        commands.draw(6 * (end - begin), 1, 6 * begin, 0);
    };
    image_barrier(commands, map_, access::draw, access::sample_in_compute);
    sample(0, 0, batch.slabs.front().end);
    for (std::size_t i = 0; i < batch.slabs.size(); ++i) {
        const Slab& slab = batch.slabs[i];
        image_barrier(commands, map_, access::sample_in_compute, access::draw);
        draw_into(commands, attachments, {map_.width, map_.height}, vk::AttachmentLoadOp::eLoad, [&] {
            draw(splat_, slab.begin, slab.dense);
            draw(dense_splat_, slab.dense, slab.end);
        });
        image_barrier(commands, map_, access::draw, access::sample_in_compute);
        buffer_barrier(commands, light_, access::compute, access::compute);
        sample(slab.begin, slab.end, i + 1 < batch.slabs.size() ? batch.slabs[i + 1].end : slab.end);
    }
    buffer_barrier(commands, light_, access::compute, access::host);
    image_barrier(commands, map_, access::sample_in_compute, access::draw);
}

std::vector<float> LightPass::read_shadow_map(const GpuDevice& gpu) const {
    const std::size_t texels = std::size_t(map_.width) * map_.height;
    const GpuBuffer buffer =
        create_buffer(gpu, texels * sizeof(float), vk::BufferUsageFlagBits::eTransferDst, HostAccess::read);
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        image_barrier(commands, map_, access::draw, access::copy_from);
        const vk::BufferImageCopy region(0, 0, 0, {vk::ImageAspectFlagBits::eColor, 0, 0, 1}, {0, 0, 0},
                                         {map_.width, map_.height, 1});
        commands.copyImageToBuffer(*map_.image, vk::ImageLayout::eGeneral, *buffer.buffer, region);
        buffer_barrier(commands, buffer, access::copy_to, access::host);
        image_barrier(commands, map_, access::copy_from, access::sample_in_fragment);
    });
    std::vector<float> shadow(texels);
    std::memcpy(shadow.data(), buffer.mapped, texels * sizeof(float));
    return shadow;
}

}  // namespace nephos
