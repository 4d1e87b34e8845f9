// SPDX-License-Identifier: Apache-2.0
#pragma once

// Shells of air on the device: bindings 13 and 14. Private to the module.

#include "render/frame/air_shells.h"
#include "render/gpu/gpu_pipeline.h"

namespace nephos {

class ShellBuffers {
  public:
    // Binds both, still without shells: descriptors must be bound, used or not.
    ShellBuffers(const GpuDevice& gpu, const Bindings& bindings);

    // Sets the data that shaders read in later draws.
    void use(const GpuDevice& gpu, const Bindings& bindings, const AirShells& shells);

  private:
    GpuBuffer shells_, shade_;
    std::uint64_t serial_ = 0;  // of what is in shade_
};

}  // namespace nephos
