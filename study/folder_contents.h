// SPDX-License-Identifier: Apache-2.0
#pragma once

// What stands in the folder of a sweep or of a fit before anything is written into it.

#include <filesystem>

namespace nephos {

// Throws Error(usage) that names a file in the folder which a sweep would replace and no sweep wrote, as a scene or a plan of
// the user's own, or what a run left. A folder with records is one of a sweep, and so is one with the plan of a sweep or
// with tables.
void require_sweep_folder(const std::filesystem::path& folder);

// The same for a fit: fit.json, fitted.toml and posterior.csv.
void require_fit_folder(const std::filesystem::path& folder);

}  // namespace nephos
