// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace nephos {

// Returns the names of what a folder holds, sorted; none where there is no folder. Throws ReadFailure where it cannot be read to
// its end: what it holds is then not known, and none of it may be taken for missing.
std::vector<std::string> names_in_folder(const std::filesystem::path& folder);

}  // namespace nephos
