// SPDX-License-Identifier: Apache-2.0
#pragma once

// What only the tests may do to a Renderer (not installed).

#include "render/renderer.h"

namespace nephos {

struct RendererTestAccess {
    // How often light was computed so far.
    static std::size_t light_passes(const Renderer& renderer);
    // Submits a deliberate write-after-write hazard, which the synchronization validation must report.
    static void provoke_hazard(Renderer& renderer);
};

}  // namespace nephos
