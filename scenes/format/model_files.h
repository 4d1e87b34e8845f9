// SPDX-License-Identifier: Apache-2.0
#pragma once

// The key `models`: base models from other scene files (not installed).

#include <filesystem>

#include "scenes/format/document.h"

namespace nephos {

// Inserts the [[model]] tables of the files that `models` names before the document's own, in the order of
// the list, so that they are read, checked, written and hashed as parts of the scene. Ignores all else in
// those files, including their own `models`. A relative name is relative to `folder`, one from a --set option
// to the current folder. Reports problems in the document.
void take_models_from_files(Document& document, const std::filesystem::path& folder);

}  // namespace nephos
