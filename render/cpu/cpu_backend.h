// SPDX-License-Identifier: Apache-2.0
#pragma once

// The back-end of machines without a graphics card: vectors on the processor, tile by tile, front to back
// (processor_view.h). Opens no Vulkan device and loads no library for one. Light is computed where the
// picture shows it; a second picture of the same cloud computes the rest. Private to the module.

#include "render/backend/backend.h"

namespace nephos {

class CpuBackend : public Backend {
  public:
    std::string name() const override { return "cpu"; }
    // Returns a name such as "cpu (AVX2, 8 threads)": Highway's name of the instruction set, and how many
    // threads draw now.
    std::string device_name() const override;
    int longest_part() const override;
    int largest_shadow_map() const override;

    bool marches() const override { return true; }
    void light_all(LitCloud& cloud, StageTimes& times) override;
    // Draws at once.
    bool begin(const FrameDescription& frame, Picture& picture) override;
};

}  // namespace nephos
