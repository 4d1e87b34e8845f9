// SPDX-License-Identifier: Apache-2.0
#include "render/shell_buffers.h"

#include <cstring>

namespace nephos {

ShellBuffers::ShellBuffers(const GpuDevice& gpu, const Bindings& bindings)
    : shells_(create_buffer(gpu, sizeof(shader::Shells), vk::BufferUsageFlagBits::eUniformBuffer,
                            HostAccess::write)) {
    bind_buffer(gpu, bindings, 13, shells_);
    use(gpu, bindings, {});
}

void ShellBuffers::use(const GpuDevice& gpu, const Bindings& bindings, const AirShells& shells) {
    std::memcpy(shells_.mapped, &shells.data, sizeof shells.data);
    upload(gpu, bindings, 14, shade_, std::as_bytes(std::span(shells.shade)));
}

}  // namespace nephos
