// SPDX-License-Identifier: Apache-2.0
#pragma once

// What running a program takes.

#include <string>
#include <vector>

namespace nephos::bench {

// What a process took, with its children.
struct Cost {
    double wall_ms = 0, processor_ms = 0, peak_mib = 0;
};

// Runs a program quietly; its path is the first argument. Throws std::runtime_error when it fails.
Cost cost_of(const std::vector<std::string>& arguments);

}  // namespace nephos::bench
