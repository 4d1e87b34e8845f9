// SPDX-License-Identifier: Apache-2.0
#pragma once

// The list of a file's grids on its way from the child process that reads the file (not installed).

#include "density/vdb/sandbox.h"
#include "density/vdb/vdb_file.h"

namespace nephos {

class VdbArchive;

// In the child: sends names, types, classes, transforms, bounds and metadata of all grids, and the file's metadata.
void send_info(VdbArchive& archive, SandboxWriter& writer);

// In the parent: receives what send_info() sends. Throws std::runtime_error when the child's answer ends early.
VdbInfo receive_info(SandboxReader& reader);

}  // namespace nephos
