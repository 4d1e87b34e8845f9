// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_mirror.h"

#include <span>
#include <vector>

namespace nephos {
namespace {

constexpr std::size_t kTexelBytes = 4 * sizeof(float);

shader::GroundMirrorLevel level_of(const MirrorView::Level& level) {
    return {shader::uint(level.first), shader::uint(level.width), shader::uint(level.height)};
}

}  // namespace

DeviceMirror::DeviceMirror(const GpuDevice& gpu)
    : level_(create_compute_pipeline(gpu, shaders().mirror_level_comp)), sets_(gpu) {}

const GpuBuffer& DeviceMirror::texels(const GpuDevice& gpu) {
    reserve_storage(gpu, texels_, kTexelBytes);
    return texels_;
}

void DeviceMirror::begin(const GpuDevice& gpu, const Camera& camera) {
    layout_ = mirror_layout(camera);
    reserve_storage(gpu, texels_, kTexelBytes * mirror_texels(layout_));
}

void DeviceMirror::record_part(const vk::raii::CommandBuffer& commands, const GpuBuffer& radiance,
                               const PicturePart& part) const {
    const std::size_t width = std::size_t(layout_.levels.front().width);
    std::vector<vk::BufferCopy> rows;
    for (int y = 0; y < part.height; ++y) {
        const std::size_t from = std::size_t(y) * std::size_t(part.width),
                          to = std::size_t(part.y + y) * width + std::size_t(part.x);
        rows.emplace_back(kTexelBytes * from, kTexelBytes * to, kTexelBytes * std::size_t(part.width));
    }
    commands.copyBuffer(*radiance.buffer, *texels_.buffer, rows);
}

void DeviceMirror::build(const GpuDevice& gpu) {
    sets_.reset();
    const vk::DescriptorSet set = sets_.fill(level_, {{0, texels_}});
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        full_barrier(commands);
        for (std::size_t n = 1; n < layout_.levels.size(); ++n) {
            const shader::MirrorStep step{level_of(layout_.levels[n - 1]), level_of(layout_.levels[n])};
            begin_compute(commands, level_, set, step);
            const std::size_t texels = std::size_t(step.coarse.width) * step.coarse.height;
            dispatch_groups(commands, (texels + shader::kComputeGroup - 1) / shader::kComputeGroup);
            compute_barrier(commands);
        }
    });
}

void DeviceMirror::use(const GpuDevice& gpu, const MirrorView& view) {
    layout_ = {view.frame, view.levels, {}, view.pixels_per_unit};
    reserve_storage(gpu, texels_, kTexelBytes * mirror_texels(layout_));
    upload_staged(gpu, texels_, std::as_bytes(std::span(view.texels)));
}

}  // namespace nephos
