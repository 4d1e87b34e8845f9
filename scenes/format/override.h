// SPDX-License-Identifier: Apache-2.0
#pragma once

// The paths of keys, as --set and axes of studies name them: "wind[0].levels[1].height_m".

#include <string>
#include <string_view>
#include <vector>

namespace nephos {

// Returns why a text cannot be the path of a key, as "its character 5 is `=`"; empty where it can. Whether a scene has the
// key, is another question.
std::string key_problem(std::string_view key);

// Returns how messages name an option, as their file: "--set density.half=maybe", shortened.
std::string option_label(std::string_view option);

// Returns the names on the path, without indices; of what is no path those that begin it.
std::vector<std::string> names_of_key(std::string_view key);

}  // namespace nephos
