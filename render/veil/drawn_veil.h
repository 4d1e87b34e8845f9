// SPDX-License-Identifier: Apache-2.0
#pragma once

// A veil that is drawn per pixel (Splats::veils).

#include <memory>

#include "density/veil_slab.h"
#include "render/options/veil_view.h"

namespace nephos {

struct DrawnVeil {
    std::shared_ptr<const VeilSlab> slab;  // not null
    double extinction_per_m = 0.001;       // at density 1, > 0
    VeilView view;
};

}  // namespace nephos
