// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tells files that a sweep or fit wrote from those of others, before anything is written into their folder.

#include <filesystem>
#include <string_view>

namespace nephos {

// Throws Error(usage) that names a file in the folder which a sweep would replace and no sweep wrote, as a scene or a plan of
// the user's own, or what a run left. A folder with records is one of a sweep; elsewhere each file tells by its beginning.
// Thread-safe.
void require_sweep_folder(const std::filesystem::path& folder);

// The same for a fit, and the files of its result.
void require_fit_folder(const std::filesystem::path& folder);

// Throws Error(usage) when the file is there and does not begin as those that `by` writes: "a sweep". Thread-safe.
void require_own(const std::filesystem::path& file, std::string_view beginning, std::string_view by);

}  // namespace nephos
