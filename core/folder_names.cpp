// SPDX-License-Identifier: Apache-2.0
#include "core/folder_names.h"

#include <algorithm>
#include <system_error>

#include "core/descriptor.h"

namespace nephos {

std::vector<std::string> names_in_folder(const std::filesystem::path& folder) {
    std::vector<std::string> names;
    std::error_code error;
    std::filesystem::directory_iterator at(folder, error), end;
    if (error == std::errc::no_such_file_or_directory || error == std::errc::not_a_directory) return names;
    for (; !error && at != end; at.increment(error)) names.push_back(at->path().filename().string());
    if (error) throw ReadFailure(folder, error.message());
    std::ranges::sort(names);
    return names;
}

}  // namespace nephos
