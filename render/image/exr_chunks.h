// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tells whether an OpenEXR file has all that its pixels are made of. For a confined child process (density/vdb/sandbox.h): the
// caller runs it there. Private to the module.

namespace nephos {

// Decodes each chunk of the first part of an open file, of tiles those of full size, by OpenEXR's core library, which compares what
// a chunk gives with what its pixels take. OpenEXR's own reader does not (3.1.5): of a chunk of fewer bytes the pixels are what
// memory held. Throws std::runtime_error with what is wrong, also for what that version of the core cannot decode, DWA and channels of
// less than half the rows; "cannot read: ..." where a read failed; std::bad_alloc.
void require_whole_chunks(int fd);

}  // namespace nephos
