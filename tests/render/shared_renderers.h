// SPDX-License-Identifier: Apache-2.0
#pragma once

// One renderer of each back-end for all tests of a program: opening a device takes longer than many tests.

#include "render/renderer.h"

namespace nephos::test {

inline Renderer& renderer(Splatting splatting = Splatting::cpu) {
    const auto make = [](Splatting way) {
        DeviceOptions options;
        options.splatting = way;
        return Renderer(options);
    };
    static Renderer processor = make(Splatting::cpu), tiles = make(Splatting::vulkan),
                    billboards = make(Splatting::blended);
    return splatting == Splatting::cpu ? processor : splatting == Splatting::vulkan ? tiles : billboards;
}

}  // namespace nephos::test
