// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where the time of a picture goes, and how far each stage is from what memory or vector units allow.

#include <functional>
#include <string>

#include "render/renderer.h"

namespace nephos::bench {

// Draws `rounds` pictures 640x480 with `draw`, after one that does not count, and prints the medians of each
// stage that `renderer` has noted.
void print_stages(const std::string& what, const Renderer& renderer, int rounds,
                  const std::function<void()>& draw);

}  // namespace nephos::bench
