// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_shade.h"

namespace nephos {

DeviceShade::DeviceShade(const GpuDevice& gpu)
    : light_(create_compute_pipeline(gpu, shaders().shade_light_comp)), sets_(gpu) {
    make_storage(gpu, words_, sizeof(shader::uint));
}

void DeviceShade::use(const GpuDevice& gpu, const ShadeInputs& shade, const vk::raii::Sampler& white_beyond) {
    serial_ = 0;  // until all of it is there
    reserve_storage(gpu, words_, shade.words.size_bytes());
    upload_staged(gpu, words_, std::as_bytes(shade.words));
    if (shade.shadow_map != nullptr) {
        const std::size_t texels = std::size_t(shade.step.columns) * shade.step.columns;
        sets_.reset();
        const vk::DescriptorSet set =
            sets_.fill(light_, {{4, *shade.shadow_map, white_beyond}, {14, words_}});
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            full_barrier(commands);
            begin_compute(commands, light_, set, shade.step);
            dispatch_groups(commands, (texels + shader::kComputeGroup - 1) / shader::kComputeGroup);
            full_barrier(commands);
        });
    }
    serial_ = shade.serial;
}

}  // namespace nephos
