// SPDX-License-Identifier: Apache-2.0
#include "render/options/level_of_detail_options.h"

#include "render/options/option_checks.h"

namespace nephos {

void check(const LevelOfDetailOptions& options) {
    require(within(options.pixels, 0, 1000), "level_of_detail.pixels", "0..1000 pixels");
}

}  // namespace nephos
