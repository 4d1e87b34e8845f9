// SPDX-License-Identifier: Apache-2.0
#pragma once

// The key `models`: base models from other scene files. Internal to scenes/.

#include <filesystem>

#include "scenes/format/document.h"

namespace nephos {

// Puts the [[model]] tables of the files that `models` names in front of the document's own, in the order of
// the list, so that they are read, checked, written and hashed as if they stood in the scene. What else those
// files hold is ignored, their own `models` too. A relative name is relative to `folder`, one from a --set
// option to the current folder. Problems are reported.
void take_models_from_files(Document& document, const std::filesystem::path& folder);

}  // namespace nephos
