// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/shell_buffers.h"

namespace nephos {

ShellBuffers::ShellBuffers(const GpuDevice& gpu, const Bindings& bindings)
    : shells_(create_buffer(gpu, sizeof(shader::Shells), vk::BufferUsageFlagBits::eUniformBuffer,
                            HostAccess::write)) {
    bind_buffer(gpu, bindings, 13, shells_);
    use(gpu, bindings, {});
}

void ShellBuffers::use(const GpuDevice& gpu, const Bindings& bindings, const AirShells& shells) {
    write(gpu, shells_, shells.data);
    if (shade_.bytes != 0 && shells.serial == serial_) return;
    serial_ = shells.serial;
    upload(gpu, bindings, 14, shade_, std::as_bytes(shells.shade));
}

}  // namespace nephos
