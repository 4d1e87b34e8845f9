// SPDX-License-Identifier: Apache-2.0
#pragma once

// Values of an axis that are names of files: "lattice.initial_state" = "a.vdb". What is in the files is part of a run's id,
// and not where they are.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/file_stamp.h"
#include "scenes/format/scene.h"

namespace nephos {

struct Axis;

// The files of one value.
struct AxisFiles {
    std::vector<std::filesystem::path> paths;  // absolute
    bool is_list = false;                      // the value is an array of names
    std::string digest;                        // of all that is in them
    FileStamps stamps;                         // before they were read
};

// Reads the files that value `value` of an axis names; none where it names none. `scene`: with that value. Throws Error(usage)
// when it names one within a larger value, such as a table; Error(io), with its place, when one cannot be read. Thread-safe.
std::optional<AxisFiles> axis_files(const Axis& axis, const std::string& value, const Scene& scene);

// Returns the value as TOML with these names in place of the paths.
std::string axis_value(const AxisFiles& files, const std::vector<std::filesystem::path>& names);

}  // namespace nephos
