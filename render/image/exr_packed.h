// SPDX-License-Identifier: Apache-2.0
#pragma once

// Checks that packed pixels of OpenEXR are as many as they should be. Private to the module.

#include <OpenEXR/openexr.h>

namespace nephos {

// Throws std::runtime_error where a chunk of PXR24, B44 or B44A has more than the pixels that were taken of it, as after a bit of
// the head that says of what type they are: OpenEXR's core (3.1.5) takes what it needs of these, of others all. `chunk`: after it
// was decoded; not one that is stored as it is.
void require_all_used(const exr_decode_pipeline_t& chunk, exr_compression_t compression);

}  // namespace nephos
