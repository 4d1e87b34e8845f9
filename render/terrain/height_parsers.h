// SPDX-License-Identifier: Apache-2.0
#pragma once

// What read_height_file() runs in a confined child process (density/vdb/sandbox.h), for tests that damage files and want to
// see what it does to the parser itself. Private to the module.

#include "render/terrain/height_map.h"

namespace nephos {

// Parses an open PNG file from its beginning. Throws std::runtime_error with what is wrong: no PNG, not 16 bits of grey, or a
// side outside of 2..kMostHeights.
HeightImage parse_height_png(int fd);

}  // namespace nephos
